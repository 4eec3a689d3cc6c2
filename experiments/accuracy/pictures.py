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
from ...harness.report import document, panels, style
from ...harness.report.dots import dots
from ...harness.report.flip import reference_path
from ...harness.results.pixel_maps import read_wrong, wrong_path
from .offsets import NAME
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
WRONG_SIDE = "wrong answers a frame"
NONE = 0.1
"""Where no wrong answer stands on a logarithmic axis of their number."""
LARGEST = 320
"""Pixels along a side of a panel: larger frames are cropped to where most is wrong."""


def draw_frontier(table: pd.DataFrame, path: Path) -> list[Path]:
    """Wrong answers of every point beside its time: a row a point, a marker a scene."""
    import pandas as pd

    known = usable(table)
    if known.empty:
        return []
    known = document.arranged(known, "family", known["family"].unique())
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
    known = own.assign(added=own["cost_ms"].clip(lower=0).where(~own["within_noise"], 0.0))
    table = known.pivot(index="scene_title", columns="measure", values="added").fillna(0.0)
    names = [name for name in own["measure"].unique() if table[name].any()]
    total = own.groupby("scene_title", sort=False)["with_ms"].first()
    table = table.loc[total.index].assign(
        total_ms=total, iqr_ms=0.0, scene=total.index, method="", text=total.map(style.number) + " ms",
        rest=total - table.sum(axis=1),
    )  # fmt: skip
    parts = {"all else": ("rest", "#cccccc")}
    parts |= {name: (name, style.COLOURS[i]) for i, name in enumerate(names)}
    below = [f"ms: the frame of {base}, and what of it each measure adds that adds more than the noise"]
    return [panels.bars(path, table, name="scene", parts=parts, room=1.12, wide=2, below=below)]


def draw_where(folder: Path, table: pd.DataFrame, shown: Sequence[str]) -> list[Path]:
    """A picture a scene: panels of the points of ``shown`` (labels) whose maps were kept, all of the same part of the image.

    Maps are large, and a folder that travels may have left them out: its pictures of an earlier drawing stay.
    """
    inks = {title: colour for title, (_, colour) in PAINT.items()}
    for name, own in table.groupby("file", sort=False):
        by_label = own.drop_duplicates("label").set_index("label", drop=False)
        rows = [by_label.loc[label] for label in shown if label in by_label.index]
        paths = [(r, wrong_path(folder, r["key"], last_frame(r))) for r in rows]
        kept = [(r, read_wrong(path)) for r, path in paths if path.exists()]
        if kept:
            part = window(max((wrong_in(classes) for _, classes in kept), key=np.sum))
            images = [
                (
                    "\n".join([r["label"], *textwrap.wrap(counted(classes), 44)]),
                    painted(folder, r, classes)[part],
                )
                for r, classes in kept
            ]
            below = [
                f"Where the wrong pixels are: {own['title'].iloc[0]}",
                "Of large frames the part where most is wrong in any panel; numbers count the whole frame.",
            ]
            path = folder / f"accuracy_where-{name}.png"
            panels.images(path, images, across=3, below=below, key=inks, wide=2, inks=list(inks.values()))
    return sorted(folder.glob("accuracy_where*.png"))


def draw_heat(folder: Path) -> list[Path]:
    """One panel a method: the share of pixels that differ from the exact answer, from white (none) to dark (all)."""
    import matplotlib
    import pandas as pd
    from matplotlib.colors import LogNorm

    rows = pd.read_csv(folder / NAME).query("status == 'ok'") if (folder / NAME).exists() else pd.DataFrame()
    if rows.empty:
        return []
    rows["share"] = (rows["wrong"] + rows["excused"]) / rows["pixels"]
    rows["text"] = rows["wrong"].map("{:,.0f}".format) + rows["excused"].map("\n(+{:,.0f})".format).where(
        rows["excused"] > 0, ""
    )
    panels_of, down = panels.places(rows, "label", 3)
    look = {"norm": LogNorm(1e-4, 1.0), "cmap": matplotlib.colormaps["magma_r"].with_extremes(bad="white")}
    scene, size = rows.iloc[0][["scene", "size"]]
    path = folder / "accuracy_heat.png"
    below = [
        "distance of the light from the middle, in scene radii",
        f"In a cell: answers that differ from the exact one on {scene}, {size}x{size}, scene not recentred: wrong (+ "
        "excused, within rounding of an edge)",
    ]
    with panels.sheet(path, (7.0, 0.8 + 1.6 * down), down, min(3, len(panels_of)), legend=0, grid="", dpi=200, colours=160,
                      sharex=True, sharey=True, below=below, left="offset of the scene from the origin, in radii") as (
        figure, grid,
    ):  # fmt: skip
        for axes in grid.flat[len(panels_of) :]:
            axes.set_axis_off()
        for axes, (label, own) in zip(grid.flat, panels_of, strict=False):
            share = own.pivot(index="offset", columns="distance", values="share")
            image = axes.imshow(share.where(share > 0), origin="lower", aspect="auto", **look)
            for r in own.itertuples():
                place = share.columns.get_loc(r.distance), share.index.get_loc(r.offset)
                ink = "white" if r.share > 0.02 else "black"
                axes.text(*place, r.text, ha="center", va="center", fontsize=4.8, color=ink)
            axes.set_title(label, fontsize=7)
            axes.set_xticks(range(share.shape[1]), map(style.radii, share.columns))
            axes.set_yticks(range(share.shape[0]), map(style.radii, share.index))
        bar = figure.colorbar(image, ax=list(grid.flat), shrink=0.9, pad=0.01)
        bar.set_label("differing answers / pixels (white: none)", fontsize=6.5)
    return [path]


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
