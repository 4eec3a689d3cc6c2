"""A sheet of panels: opened with the project's style, its legend gathered from all panels, saved without a date."""

from __future__ import annotations

import itertools
import math
import textwrap
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
CUT = {"marker": "$//$", "color": "black", "ms": 6, "mew": 0.3, "ls": "none"}
"""The mark at the end of a bar that is cut off."""


WHOLE = "ms per frame: a number and its bar; the parts, measured apart, are shown as shares of it"
"""What to say below stacked bars."""


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


def caption(figure: Any, *texts: str, size: float = 6.5) -> None:
    """Texts below the panels, each in as many lines as the width of the figure needs."""
    across = int(figure.get_figwidth() * 72 / (0.57 * size))  # letters of the usual width
    lines = [line for text in texts for line in textwrap.wrap(text, across, break_on_hyphens=False)]
    figure.supxlabel("\n".join(lines), fontsize=size)


def looks(table: DataFrame, hue: str = "label") -> dict[Any, dict[str, Any]]:
    """How each value of ``hue`` is drawn, by value.

    A label has the colour and the marker of its method (:func:`.style.look`); after the first label of a method they are
    dashed and hollow. Other values have a colour and a marker each, in the table's order.
    """
    if hue != "label":
        kinds = zip(table[hue].unique(), itertools.cycle(zip(style.COLOURS, style.MARKERS, strict=True)))
        return {value: {"color": colour, "marker": marker} for value, (colour, marker) in kinds}
    labels = table.drop_duplicates("label")
    before = labels.groupby("method").cumcount()
    return {
        label: {**style.look(method), "ls": DASHES[n % len(DASHES)], "mfc": "white" if n else None}
        for label, method, n in zip(labels["label"], labels["method"], before, strict=True)
    }


@contextmanager
def lines(
    path: Path, table: DataFrame, x: str, y: str, size: tuple[float, float], *, hue: str = "label",
    facet: str | list[str] = "", across: int = 1, whisker: str = "",
    drawn: Mapping[Any, Mapping[str, Any]] | None = None, **sheet_options: Any,
) -> Iterator[tuple[Any, list[tuple[Any, DataFrame]]]]:  # fmt: skip
    """A line plot of the rows of a table: yields the figure and of each panel its axes and rows, then writes ``path``.

    facet    column with a panel for each value, ``across`` of them side by side, in the table's order; "": one panel
    hue      column with a line for each value; the column ``status`` says why a row has no ``y``
    whisker  column of the spread of y: the length of a whisker above and below its marker
    drawn    how each value of hue is drawn; by default :func:`looks`
    sheet_options  see :func:`sheet`
    """
    drawn = drawn or looks(table, hue)
    places = list(table.groupby(facet, sort=False)) if facet else [("", table)]
    down = -(-len(places) // across)
    with sheet(path, size, down, across, **sheet_options) as (figure, grid):
        for axes, (title, here) in zip(grid.flat, places, strict=False):
            lost = []
            for value, own in here.groupby(hue, sort=False):
                line(axes, own, x, y, whisker, str(value), drawn[value])
                if own[y].isna().all():
                    lost.append(f"{value}: {' and '.join(own['status'].unique())}")
            axes.set_title("\n".join([str(title), *lost]), fontsize=6.5)
        for axes in grid.flat[len(places) :]:
            axes.set_visible(False)
        for axes in grid.flat[max(0, len(places) - across) : len(places)]:
            axes.tick_params(labelbottom=True)  # the lowest of a column has the numbers
        yield figure, [(axes, here) for axes, (_, here) in zip(grid.flat, places, strict=False)]


def line(
    axes: Any, own: DataFrame, x: str, y: str, whisker: str, label: str, look: Mapping[str, Any]
) -> None:
    """One line. A row with an ``x`` and no ``y`` has a mark at the upper edge, and the legend names its status."""
    known = own[own[y].notna()]
    ends = known[whisker].fillna(0.0) if whisker else None
    axes.errorbar(known[x], known[y], yerr=ends, elinewidth=0.7, alpha=0.9, label=label, **look)
    for status, lost in own[own[y].isna() & own[x].notna()].groupby("status", sort=False):
        axes.plot(lost[x], [0.95] * len(lost), style.LOST.get(status, "x"), color=look["color"], ms=6, mew=1.6, ls="",
                  transform=axes.get_xaxis_transform(), clip_on=False, label=f"{status} ({label})")  # fmt: skip


def bars(
    axes: Any, table: DataFrame, tints: Sequence[Mapping[str, Any]], texts: Sequence[str], limit: float = math.inf,
    edge: str | None = None, size: float = 6.0,
) -> None:  # fmt: skip
    """A stacked bar a row of ``table``, from the top down, as long as ``total_ms``. Whisker: its interquartile range.

    The parts of a frame are measured apart from the whole and may add up to another time: a bar shows the share of each
    in their sum.

    tints  the colour of each column that is stacked, a mapping a row; its first colour is the edge unless ``edge`` is
    texts  what stands at each bar's end: red where answers are wrong, alone and in italics where nothing was measured
    limit  ms at which a longer bar is cut off, with a mark that the legend explains
    """
    for place, (row, colours, text) in enumerate(zip(table.to_dict("records"), tints, texts, strict=True)):
        if math.isnan(row["total_ms"]):
            axes.annotate(
                text, (0, place), (3, 0), textcoords="offset points", va="center", size=size, style="italic"
            )
            continue
        # Stages are differences: on a busy machine one may be negative.
        parts = {column: max(0.0, row[column]) for column in colours}
        scale = row["total_ms"] / (sum(parts.values()) or 1.0)
        left = 0.0
        for column, colour in colours.items():
            width = min(scale * parts[column], limit - left)
            axes.barh(place, width, left=left, height=0.74, color=colour, lw=0.4,
                      edgecolor=edge or next(iter(colours.values())))  # fmt: skip
            left += width
        end = row["total_ms"] + row["iqr_ms"] / 2
        if end > limit:
            axes.plot([limit], [place], **CUT, label="bar cut off")
        else:
            axes.errorbar(
                row["total_ms"], place, xerr=row["iqr_ms"] / 2, fmt="none", color="black", elinewidth=0.6
            )
        axes.annotate(text, (min(end, limit), place), (5 if end > limit else 3, 0), textcoords="offset points",
                      va="center", size=size, color="#B00000" if style.WRONG in text else "black")  # fmt: skip
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(table) - 0.4, -0.6)


@contextmanager
def bar_panels(
    path: Path, table: DataFrame, size: tuple[float, float], *, tints: Mapping[Any, Mapping[str, Any]], by: str = "method",
    name: str = "label", text: str = "text", facet: str = "", across: int = 1, cut: float = math.inf, room: float = 1.4,
    edge: str | None = None, font: float = 6.0, **sheet_options: Any,
) -> Iterator[tuple[Any, list[tuple[Any, DataFrame]]]]:  # fmt: skip
    """Panels of stacked bars (:func:`bars`), a bar a row: yields the figure and of each panel its axes and rows.

    facet        column with a panel for each value, ``across`` of them side by side; "": one panel
    tints, by    the colours of the columns that are stacked, for each value of the column ``by``
    name, text   the columns with what stands before a bar and at its end
    cut          so many times the median time of its panel a bar is cut off
    room         length of the axis over that of the longest bar
    """
    places = list(table.groupby(facet, sort=False)) if facet else [("", table)]
    down = -(-len(places) // across)
    with sheet(path, size, down, across, grid="x", **sheet_options) as (figure, grid):
        for place, (axes, (title, own)) in enumerate(zip(grid.flat, places, strict=False)):
            limit = cut * own["total_ms"].median()
            bars(axes, own, [tints[value] for value in own[by]], own[text], limit, edge, font)
            beside = places[place - 1][1] if place % across else own[:0]
            named = list(own[name])
            axes.set_yticks(range(len(own)), [""] * len(own) if named == list(beside[name]) else named)
            longest = own["total_ms"].max()
            axes.set_xlim(0, room * min(limit, longest) if longest > 0 else 1)
            axes.set_title(title, loc="left", fontsize=7)
        for axes in grid.flat[len(places) :]:
            axes.set_axis_off()
        yield figure, [(axes, own) for axes, (_, own) in zip(grid.flat, places, strict=False)]


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
