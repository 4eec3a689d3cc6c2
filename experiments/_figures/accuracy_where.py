"""Where the wrong pixels are: acne, leaks, edges and wrong triangles, painted over the reference's picture in grey."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ...harness.judge.verdict import Verdict
from ...harness.report import points, style
from ...harness.report.flip import reference_path
from ...harness.report.sheet import title_of
from ...harness.results.pixel_maps import read_wrong, wrong_path
from .accuracy_rows import Row, scenes

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


def draw(folder: Path, made: Sequence[Row], shown: Sequence[str]) -> list[Path]:
    """A picture a scene: panels of the points of ``shown`` (labels) whose maps were kept.

    Maps are large, and a folder that travels may have left them out: its pictures of an earlier drawing stay.
    """
    for scene, own in scenes(made):
        kept = _kept(folder, own, shown)
        if kept:
            _panels(folder, kept, folder / f"accuracy_where-{scene}.png")
    return sorted(folder.glob("accuracy_where*.png"))


def _panels(folder: Path, kept: Sequence[tuple[Row, NDArray[np.int64]]], path: Path) -> None:
    """One scene's panels, all of the same part of the image."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    across = min(ACROSS, len(kept))
    down = -(-len(kept) // across)
    worst = max(kept, key=lambda pair: int(_wrong(pair[1]).sum()))[1]
    window = _window(_wrong(worst))
    with matplotlib.rc_context({**style.axes_style(), "axes.grid": False}):
        figure = Figure(figsize=(2.2 * across, 2.45 * down + 0.6), layout="constrained", dpi=150)
        panels = figure.subplots(down, across, squeeze=False).ravel()
        for axes in panels:
            axes.set_axis_off()
        for axes, (r, classes) in zip(panels, kept, strict=False):
            axes.imshow(painted(folder, r, classes)[window], interpolation="nearest")
            axes.set_title(_caption(r["label"], classes), fontsize=6)
        handles = [Patch(facecolor=colour, label=name) for name, (_, colour) in PAINT.items()]
        figure.legend(
            handles=handles, loc="outside lower center", ncols=min(across, len(handles)), frameon=False,
            handlelength=1.2, fontsize=6,
        )  # fmt: skip
        figure.suptitle(f"Where the wrong pixels are: {title_of(kept[0][0])}", fontsize=7.5)
        points.save(figure, path, inks=[colour for _, colour in PAINT.values()])


def _kept(folder: Path, rows: Sequence[Row], shown: Sequence[str]) -> list[tuple[Row, NDArray[np.int64]]]:
    by_label = {r["label"]: r for r in rows}
    result = []
    for label in shown:
        if label in by_label:
            r = by_label[label]
            path = wrong_path(folder, r["key"], _frame(r))
            if path.exists():
                result.append((r, read_wrong(path)))
    return result


def _frame(r: Row) -> int:
    frames: list[dict[str, Any]] = r["record"]["frames"]
    return int(frames[-1]["frame"]) if frames else 0


def painted(folder: Path, r: Row, classes: NDArray[np.int64]) -> NDArray[np.uint8]:
    """The reference in light grey with every wrong or excused pixel in its class's colour. uint8 [h, w, 3]."""
    from matplotlib.colors import to_rgb

    path = reference_path(folder, r["scene"], _frame(r))
    if path.exists():
        with Image.open(path) as image:
            grey = np.asarray(image.convert("L"), dtype=float)
    else:
        grey = np.full(classes.shape, 255.0)
    picture = np.repeat((110 + grey * 0.55)[..., None], 3, axis=2).clip(0, 255).astype(np.uint8)
    for kinds, colour in PAINT.values():
        picture[np.isin(classes, kinds)] = np.round(255 * np.array(to_rgb(colour)))
    return picture


def _wrong(classes: NDArray[np.int64]) -> NDArray[np.bool_]:
    return ~np.isin(classes, (Verdict.OK, Verdict.TIE))


def _window(wrong: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Of a large frame the square with most wrong pixels, else the whole."""
    height, width = wrong.shape
    if max(height, width) <= LARGEST:
        return slice(None), slice(None)
    total = np.pad(wrong.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    h, w = min(LARGEST, height), min(LARGEST, width)
    inside = total[h:, w:] - total[:-h, w:] - total[h:, :-w] + total[:-h, :-w]
    y, x = np.unravel_index(int(inside.argmax()), inside.shape)
    return slice(int(y), int(y) + h), slice(int(x), int(x) + w)


def _caption(label: str, classes: NDArray[np.int64]) -> str:
    """Label and counts, each broken into lines that stay within a panel."""
    lines = [line for text in (label, _counted(classes)) for line in textwrap.wrap(text, 44)]
    return "\n".join(lines)


def _counted(classes: NDArray[np.int64]) -> str:
    found = [
        f"{int(np.isin(classes, kinds).sum()):,} {name.split(':')[0].split(' or')[0]}"
        for name, (kinds, _) in PAINT.items()
        if np.isin(classes, kinds).any()
    ]
    return ", ".join(found) or "nothing wrong"
