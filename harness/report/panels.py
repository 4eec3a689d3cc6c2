"""A sheet of panels: opened with the project's style, its legend gathered from all panels, saved without a date."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from . import style
from .picture import inked_png_bytes, png_bytes

if TYPE_CHECKING:
    from pandas import DataFrame

DASHES = ("-", "--", ":", "-.")


@contextmanager
def sheet(
    path: Path, size: tuple[float, float], down: int = 1, across: int = 1, *, legend: int = 2, grid: str = "both",
    dpi: int = 150, colours: int = 0, inks: Sequence[str] = (), **shared: Any,
) -> Iterator[tuple[Any, Any]]:  # fmt: skip
    """Yield a figure of ``size`` inches and its axes [down, across]; on leaving, add the legend and write ``path``.

    legend   columns of the legend above the panels: every label of every panel once; 0 for none
    grid     "x", "y", "both" or "" for none
    colours, inks   of a PNG: see :func:`save`
    shared   passed on to ``Figure.subplots``: ``sharex``, ``sharey``, ``height_ratios``
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(
        {**style.sheet_style(), "axes.grid": bool(grid), "axes.grid.axis": grid or "both"}
    ):
        figure = Figure(figsize=size, layout="constrained", dpi=dpi)
        panels = figure.subplots(down, across, squeeze=False, **shared)
        yield figure, panels
        if legend:
            add_legend(figure, legend)
        save(figure, path, colours, inks)


def add_legend(figure: Any, columns: int) -> None:
    """A legend above the panels: every label of every panel once."""
    named: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    if named:
        figure.legend(named.values(), named.keys(), loc="outside upper center", ncols=columns, frameon=False)


def looks(table: DataFrame) -> dict[str, dict[str, Any]]:
    """How to draw each label: its method's colour, a marker of its own; dashed and hollow after the method's first."""
    methods = table.drop_duplicates("label").set_index("label")["method"]
    colours = style.colours(methods)
    result = {}
    for place, (label, method) in enumerate(methods.items()):
        before = list(methods[:place]).count(method)
        result[str(label)] = {
            "color": colours[method],
            "marker": style.MARKERS[place % len(style.MARKERS)],
            "ls": DASHES[before % len(DASHES)],
            "mfc": "white" if before else None,
        }
    return result


def save(figure: Any, path: Path, colours: int = 0, inks: Sequence[str] = ()) -> Path:
    """Write a figure without a date in it: the same records give the same bytes.

    ``colours``: of a picture with few, keep no more than so many, for a quarter of its bytes; 0: all. ``inks``: of a
    grey picture keep these colours, that mean something, and greys.
    """
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
    if colours or inks:
        with Image.open(path) as whole:
            picture = np.asarray(whole.convert("RGB"))
        path.write_bytes(inked_png_bytes(picture, inks) if inks else png_bytes(picture, colours))
    return path
