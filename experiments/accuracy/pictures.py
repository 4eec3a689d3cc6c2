"""Where the wrong pixels are, and what share of a frame each safety measure takes."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ...harness.judge.verdict import Verdict
from ...harness.report import panels, style
from ...harness.report.flip import reference_path
from ...harness.results.pixel_maps import read_wrong, wrong_path

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
ACROSS = 3
"""Panels beside one another."""
LARGEST = 320
"""Pixels along a side of a panel: larger frames are cropped to where most is wrong."""


def draw_costs(cost: pd.DataFrame, base: str, path: Path) -> list[Path]:
    """One bar a scene of the point ``base``, its frame split into the costs of its measures and the rest.

    A difference within the noise is no cost: it is drawn at zero and said to be within the noise.
    """
    from matplotlib.patches import Patch

    own = cost[cost["with"] == base]
    if own.empty:
        return []
    scenes, names = list(own["scene_title"].unique()), list(own["measure"].unique())
    added = own["cost_ms"].clip(lower=0).where(~own["within_noise"], 0.0) / own["with_ms"] * 100
    shares = (
        own.assign(added=added)
        .pivot(index="scene_title", columns="measure", values="added")
        .loc[scenes, names]
    )
    shares = shares.fillna(0.0)
    with panels.sheet(path, (7.0, 0.62 * len(scenes) + 1.3), legend=0, grid="x") as (figure, grid):
        axes = grid[0, 0]
        left = 100 - shares.sum(axis=1)
        axes.barh(range(len(scenes)), left, height=0.36, color="#cccccc", edgecolor="#888888", linewidth=0.4)
        handles = [Patch(facecolor="#cccccc", edgecolor="#888888", linewidth=0.4, label="all else")]
        for i, name in enumerate(names):
            axes.barh(range(len(scenes)), shares[name], left=left, height=0.36, color=style.COLOURS[i % 8])
            left = left + shares[name]
            adds = (shares[name] > 0).any()
            text = f"{i + 1}: {name}" + ("" if adds else " (no bar: adds no time)")
            handles.append(Patch(facecolor=style.COLOURS[i % 8] if adds else "none", label=text))
        for place, (_, mine) in enumerate(own.groupby("scene_title", sort=False)):
            told = ";  ".join(f"{names.index(c.measure) + 1}: {described(c)}" for c in mine.itertuples())
            axes.text(0.6, place + 0.36, f"{style.number(mine['with_ms'].iloc[0])} ms.  {told}", fontsize=6.5, va="center",
                      bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6})  # fmt: skip
        axes.set_yticks(range(len(scenes)), scenes)
        axes.set_ylim(len(scenes) - 0.4, -0.35)
        axes.set_xlim(0, 100.5)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("share of the exact tree's frame, %")
        figure.legend(handles=handles, loc="outside upper center", ncols=2, frameon=False, handlelength=1.2)
    return [path]


def described(c: Any) -> str:
    """A measure's cost in words, with its noise where that is larger."""
    if np.isnan(c.noise_ms):
        return "too few repeats to tell"
    if c.within_noise:
        return f"within noise (±{style.number(c.noise_ms)} ms)"
    return f"{c.cost_ms:+.3g} ms ({c.share:+.1%})"


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
