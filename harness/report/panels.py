"""A sheet of panels: opened with the project's style, its legend gathered from all panels, saved without a date."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from ..results.table import PART_COLUMNS
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


def bars(
    axes: Any, table: DataFrame, tints: Sequence[Mapping[str, Any]], texts: Sequence[str], limit: float = math.inf,
    edge: str | None = None, size: float = 6.0,
) -> None:  # fmt: skip
    """A stacked bar a row of ``table``, from the top down. Black tick: ``total_ms``; whisker: its interquartile range.

    tints  the colour of each column that is stacked, a mapping a row; its first colour is the edge unless ``edge`` is
    texts  what stands at each bar's end: red where answers are wrong, alone and in italics where nothing was measured
    limit  ms at which a longer bar is cut off, with a mark
    """
    for place, (row, colours, text) in enumerate(zip(table.to_dict("records"), tints, texts, strict=True)):
        if math.isnan(row["total_ms"]):
            axes.annotate(
                text, (0, place), (3, 0), textcoords="offset points", va="center", size=size, style="italic"
            )
            continue
        left = 0.0
        for column, colour in colours.items():
            # Stages are differences: on a busy machine one may be negative, and all together more than the frame.
            width = max(0.0, min(row[column], limit - left))
            axes.barh(place, width, left=left, height=0.74, color=colour, lw=0.4,
                      edgecolor=edge or next(iter(colours.values())))  # fmt: skip
            left += width
        end = max(left, row["total_ms"] + row["iqr_ms"] / 2)
        if end > limit:
            axes.text(limit, place, "//", ha="center", va="center", fontsize=9)
        else:
            axes.errorbar(row["total_ms"], place, xerr=row["iqr_ms"] / 2, fmt="|", color="black", ms=6, mew=0.8,
                          elinewidth=0.6)  # fmt: skip
        axes.annotate(text, (min(end, limit), place), (5 if end > limit else 3, 0), textcoords="offset points",
                      va="center", size=size, color="#B00000" if style.WRONG in text else "black")  # fmt: skip
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(table) - 0.4, -0.6)


def name_parts(axes: Any) -> None:
    """Name the parts of a frame in the legend, in greys."""
    for part, share in style.PART_SHARE.items():
        grey = style.lightened("#555555", share)
        axes.fill_between([], [], color=grey, edgecolor="#555555", lw=0.4, label=part)


def part_tints(colour: str) -> dict[str, Any]:
    """A method's colour, lighter part by part, by the column of the part."""
    return {
        f"{column}_ms": style.lightened(colour, style.PART_SHARE[part])
        for part, column in PART_COLUMNS.items()
    }


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
