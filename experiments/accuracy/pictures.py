"""Where the wrong pixels are, and what share of a frame each safety measure takes."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ...harness.judge.verdict import Verdict
from ...harness.report import panels, style
from ...harness.report.dots import dots
from ...harness.report.flip import reference_path
from ...harness.results.pixel_maps import read_wrong, wrong_path
from .tables import usable

if TYPE_CHECKING:
    import pandas as pd

UNJUDGED = -1
"""Of so many disputed pixels only a sample is judged."""

PAINT: dict[str, tuple[tuple[int, ...], str]] = {
    "acne: says shadowed, is lit": ((Verdict.ACNE,), "#D55E00"),
    "leak: says lit, is shadowed": ((Verdict.LEAK,), "#0072B2"),
    "wrong triangle or no answer": ((Verdict.TRUE, Verdict.INVALID), "#000000"),
    "not judged: differs from the reference": ((UNJUDGED,), "#CC79A7"),
    "excused: edge or near tie": ((Verdict.EDGE, Verdict.NEAR_TIE), "#009E73"),
}
ABOUT = (
    "accuracy_where-SCENE.png show of large frames the part where most is wrong in any of a picture's panels; the "
    "numbers above a panel count the whole frame."
)
WRONG_SIDE = "wrong answers a frame"
NONE = 0.1
"""Where no wrong answer stands on a logarithmic axis of their number."""
ACROSS = 3
"""Panels beside one another."""
LARGEST = 320
"""Pixels along a side of a panel: larger frames are cropped to where most is wrong."""


def draw_frontier(table: pd.DataFrame, path: Path) -> list[Path]:
    """Wrong answers of every point beside its time: a row a point, a marker a scene."""
    import pandas as pd

    known = usable(table)
    if known.empty:
        return []
    rank = {family: i for i, family in enumerate(known["family"].unique())}
    known = known.sort_values("family", key=lambda s: s.map(rank), kind="stable")
    wrong = known.assign(side=WRONG_SIDE, x=known["wrong_per_frame"].clip(lower=NONE))
    rows = pd.concat([wrong, known.assign(side="ms per frame", x=known["total_ms"])])
    return [dots(path, rows, "name", "x", "title", facet="side", marked="on_frontier", band=0.24, legend=3,
                 zeros={WRONG_SIDE: NONE},
                 below="black edge: no other point of the scene is both faster and less wrong")]  # fmt: skip


def draw_costs(cost: pd.DataFrame, base: str, path: Path) -> list[Path]:
    """A bar a scene: the frame of the point ``base``, split into the costs of its measures and the rest.

    A difference within the noise is no cost.
    """
    own = cost[cost["with"] == base]
    if own.empty:
        return []
    names = list(own["measure"].unique())
    colours = {"all else": "#cccccc", **{name: style.COLOURS[i % 8] for i, name in enumerate(names)}}
    known = own.assign(added=own["cost_ms"].clip(lower=0).where(~own["within_noise"], 0.0))
    parts = known.pivot(index="scene_title", columns="measure", values="added").fillna(0.0)
    total = own.groupby("scene_title", sort=False)["with_ms"].first()
    table = parts.loc[total.index].assign(total_ms=total, iqr_ms=0.0, scene=total.index, whose=base)
    table = table.assign(text=total.map(style.number) + " ms", **{"all else": total - parts.sum(axis=1)})
    size = (2 * style.COLUMN_WIDTH, 0.24 * len(table) + 1.1)
    look = {"tints": {base: colours}, "by": "whose", "name": "scene", "edge": "#888888", "room": 1.12}
    with panels.bar_panels(path, table, size, legend=2, **look) as (_, places):  # type: ignore[arg-type]
        axes = places[0][0]
        for name, colour in colours.items():
            adds = name == "all else" or (parts[name] > 0).any()
            axes.fill_between([], [], color=colour, label=name + " (adds no time)" * (not adds))
        axes.set_xlabel(f"ms: the frame of {base}, and what of it each measure adds")
    return [path]


def draw_where(folder: Path, table: pd.DataFrame, shown: Sequence[str]) -> list[Path]:
    """A picture a scene: panels of the points of ``shown`` (labels) whose maps were kept, all of the same part of the image.

    Maps are large, and a folder that travels may have left them out: its pictures of an earlier drawing stay.
    """
    from matplotlib.patches import Patch

    for name, own in table.groupby("file", sort=False):
        by_label = own.drop_duplicates("label").set_index("label")
        rows = [(label, by_label.loc[label]) for label in shown if label in by_label.index]
        paths = [(label, r, wrong_path(folder, r["key"], last_frame(r))) for label, r in rows]
        kept = [(label, r, read_wrong(path)) for label, r, path in paths if path.exists()]
        if not kept:
            continue
        across = min(ACROSS, len(kept))
        down = -(-len(kept) // across)
        part = window(max((wrong_in(classes) for *_, classes in kept), key=np.sum))
        inks = [colour for _, colour in PAINT.values()]
        path = folder / f"accuracy_where-{name}.png"
        size = (2.2 * across, 2.45 * down + 0.6)
        with panels.sheet(path, size, down, across, legend=0, grid="", inks=inks) as (figure, grid):
            for axes in grid.ravel():
                axes.set_axis_off()
            for axes, (label, r, classes) in zip(grid.ravel(), kept, strict=False):
                axes.imshow(painted(folder, r, classes)[part], interpolation="nearest")
                lines = [line for text in (label, counted(classes)) for line in textwrap.wrap(text, 44)]
                axes.set_title("\n".join(lines), fontsize=6)
            handles = [Patch(facecolor=colour, label=title) for title, (_, colour) in PAINT.items()]
            figure.legend(handles=handles, loc="outside lower center", ncols=across, frameon=False, handlelength=1.2,
                          fontsize=6)  # fmt: skip
            figure.suptitle(f"Where the wrong pixels are: {own['title'].iloc[0]}", fontsize=7.5)
    return sorted(folder.glob("accuracy_where*.png"))


def last_frame(r: pd.Series) -> int:
    """The frame of which maps are kept."""
    return int(r["frame_numbers"][-1]) if len(r["frame_numbers"]) else 0


def painted(folder: Path, r: pd.Series, classes: NDArray[np.int64]) -> NDArray[np.uint8]:
    """The reference in light grey with every wrong or excused pixel in its class's colour. uint8 [h, w, 3]."""
    from matplotlib.colors import to_rgb

    path = reference_path(folder, r["scene"], last_frame(r))
    grey = np.full(classes.shape, 255.0)
    if path.exists():
        with Image.open(path) as image:
            grey = np.asarray(image.convert("L"), dtype=float)
    picture = np.repeat((110 + grey * 0.55)[..., None], 3, axis=2).clip(0, 255).astype(np.uint8)
    for kinds, colour in PAINT.values():
        picture[np.isin(classes, kinds)] = np.round(255 * np.array(to_rgb(colour)))
    return picture


def wrong_in(classes: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which pixels of a map are wrong or excused."""
    return ~np.isin(classes, (Verdict.OK, Verdict.TIE))


def window(wrong: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Of a large frame the square with most wrong pixels, else the whole."""
    height, width = wrong.shape
    if max(height, width) <= LARGEST:
        return slice(None), slice(None)
    total = np.pad(wrong.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    h, w = min(LARGEST, height), min(LARGEST, width)
    inside = total[h:, w:] - total[:-h, w:] - total[h:, :-w] + total[:-h, :-w]
    y, x = np.unravel_index(int(inside.argmax()), inside.shape)
    return slice(int(y), int(y) + h), slice(int(x), int(x) + w)


def counted(classes: NDArray[np.int64]) -> str:
    """How many pixels of a map are in each class that is painted."""
    found = [
        f"{int(np.isin(classes, kinds).sum()):,} {name.split(':')[0].split(' or')[0]}"
        for name, (kinds, _) in PAINT.items()
        if np.isin(classes, kinds).any()
    ]
    return ", ".join(found) or "nothing wrong"
