"""The shared drawings: lines, stacked bars, dots and images, one panel per value of a column. Matplotlib's SVG is
written in about half of its bytes (:func:`short`): the same elements, texts and looks.
"""

import io
import itertools
import math
import re
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..results.table import PART_COLUMNS
from . import numbers, style
from .dataframe import DataFrame, Series
from .picture import png_bytes

DASHES = ("-", "--", ":", "-.")
WHOLE = "ms per frame: a number and its bar; the parts, measured apart, are shown as shares of it"
"""The text below stacked bars."""
GREY = "#555555"
Parts = Mapping[str, tuple[str, Any]]
"""The parts of a bar: column and colour by title; a number makes it that much lighter than the method's colour."""
FRAME: Parts = {part: (f"{column}_ms", style.PART_SHARE[part]) for part, column in PART_COLUMNS.items()}

TAG = re.compile(r"<[^!?>][^>]*>")
STYLE = re.compile(r' style="([^"]*)"')
NUMBER = re.compile(r"-?\d+\.\d{3,}")
RULES = "</style>"  # where further rules of style are put: matplotlib writes one element of them


@contextmanager
def sheet(
    path: Path, size: tuple[float, float], down: int = 1, across: int = 1, *, legend: int = 2, grid: str = "both",
    dpi: int = 150, colours: int = 0, inks: Sequence[str] = (), below: str = "", left: str = "",
    late: Callable[[], None] | None = None, **shared: Any,
) -> Iterator[tuple[Any, Any]]:  # fmt: skip
    """Yield a figure of ``size`` inches and its axes [down, across]; on leaving, add texts and legend and write ``path``.

    legend   columns of the legend above the panels: every label of every panel once; 0 for none
    grid     "x", "y", "both" or "" for none
    colours, inks   of a PNG: how many colours it keeps, for a quarter of its bytes (0: all); or greys and these colours
    below, left     texts beside the panels
    late     called once the places of the panels are known, for what depends on them
    """
    import matplotlib
    from matplotlib.figure import Figure

    looks = {**style.SHEET, "axes.grid": bool(grid), "axes.grid.axis": grid or "both"}
    with matplotlib.rc_context(looks):
        figure = Figure(figsize=size, layout="constrained", dpi=dpi)
        yield figure, figure.subplots(down, across, squeeze=False, **shared)
        letters = int(size[0] * 72 / (0.57 * 6.5))
        lines = [textwrap.fill(text, letters, break_on_hyphens=False) for text in below.splitlines()]
        figure.supxlabel("\n".join(lines), fontsize=6.5)
        figure.supylabel(left, fontsize=7)
        named: dict[str, Any] = {}
        for axes in figure.axes if legend else ():
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                named.setdefault(label, handle)
        if named:
            place = {"loc": "outside upper center", "ncols": legend, "frameon": False}
            figure.legend(named.values(), named.keys(), **place)
        if late:
            figure.draw_without_rendering()
            late()
        if path.suffix == ".svg":
            drawing = io.StringIO()
            figure.savefig(drawing, format="svg", metadata={"Date": None})  # the same records give the same bytes
            path.write_text(short(drawing.getvalue()), "utf-8")
        else:
            figure.savefig(path)
    if colours or inks:
        with Image.open(path) as whole:
            picture = np.asarray(whole.convert("RGB"))
        path.write_bytes(png_bytes(picture, colours or 256, inks=inks))


def cut_mark() -> dict[str, Any]:
    """The mark at the end of a bar that is cut off: two strokes."""
    from matplotlib.path import Path as Outline

    ends = [(-0.75, -1.0), (0.0, 1.0), (0.0, -1.0), (0.75, 1.0)]
    strokes = Outline(ends, [Outline.MOVETO, Outline.LINETO] * 2)
    return {"marker": strokes, "color": "black", "ms": 5, "mew": 0.7, "ls": "none"}


@contextmanager
def facets(
    path: Path, table: DataFrame, facet: str, across: int, high: float, wide: float, **options: Any
) -> Iterator[list[tuple[Any, str, DataFrame]]]:
    """Yield axes, value and rows of a panel, ``high`` inches, for each value of ``facet``; ``wide``: columns of a page."""
    found = list(table.groupby(facet, sort=False)) if facet else [("", table)]
    across = max(1, min(across, len(found)))
    down = -(-len(found) // across)
    with sheet(path, (style.COLUMN_WIDTH * wide, high * down + 0.9), down, across, **options) as (_, grid):
        for axes in grid.flat[len(found) :]:
            axes.set_visible(False)
        yield [(axes, str(value), rows) for axes, (value, rows) in zip(grid.flat, found, strict=False)]


def looks(table: DataFrame, hue: str = "label") -> dict[Any, dict[str, Any]]:
    """A colour and a marker for each value of ``hue``; a label has its method's, dashed and hollow after the first of it."""
    if hue != "label":
        kinds = zip(table[hue].unique(), itertools.cycle(zip(style.COLOURS, style.MARKERS, strict=True)))
        return {value: {"color": colour, "marker": marker} for value, (colour, marker) in kinds}
    labels = table.drop_duplicates("label")
    before = labels.groupby("method").cumcount()
    return {
        label: {**style.look(method), "ls": DASHES[n % len(DASHES)], "mfc": "white" if n else None}
        for label, method, n in zip(labels["label"], labels["method"], before, strict=True)
    }


def lines(
    path: Path, table: DataFrame, x: str, y: str, *, below: str, left: str, hue: str = "label", facet: str = "",
    across: int = 1, whisker: str = "", drawn: Mapping[Any, Mapping[str, Any]] | None = None, log_x: int = 0,
    log_y: bool = True, ticks: Callable[[Any], str] | None = None, wrong: str = "", proportion: str = "",
    high: float = 1.6, wide: float = 1.0, **options: Any,
) -> Path | None:  # fmt: skip
    """Lines of ``y`` over ``x``: one per value of ``hue``, in a panel per value of ``facet``, ``across`` beside one another.
    None where nothing was measured, as of the other drawings of tables.

    A row with an ``x`` and no ``y`` has a mark at the upper edge; a line without any ``y`` is named above its panel.

    whisker, wrong  columns: the spread of y; true where answers are wrong, a cross
    log_x    base of a logarithmic x; 0: linear. ``log_y``: logarithmic with plain numbers; else from zero
    ticks    the text of a value of x: each value has a tick then
    proportion  the label of a line y ~ x
    """
    if table[y].isna().all():
        return None
    drawn = drawn or looks(table, hue)
    with facets(path, table, facet, across, high, wide, below=below, left=left, **options) as shown:
        for axes, title, here in shown:
            for value, own in here.groupby(hue, sort=False):
                line(axes, own, x, y, whisker, str(value), drawn[value])
            gone = here[here[y].isna().groupby(here[hue]).transform("all")].groupby(hue, sort=False)["status"]
            lost = [f"{value}: {' and '.join(status)}" for value, status in gone.unique().items()]
            axes.set_title("\n".join([title, *lost]), fontsize=6.5)
            if wrong and here[wrong].any():
                own = here[here[wrong]]
                axes.plot(own[x], own[y], "kx", ms=5, mew=0.9, zorder=3, label="a frame with wrong answers")
            values = sorted(here[x].dropna().unique())
            if proportion:
                ends = np.array([values[0], values[-1]], float)
                rising = 0.8 * table[y].min() * ends / ends[0]
                axes.plot(ends, rising, c="0.7", lw=0.9, ls=":", label=proportion, scalex=False, scaley=False)
            if log_x:
                axes.set_xscale("log", base=log_x)
            if ticks:
                axes.set_xticks(values, map(ticks, values), rotation=90 if log_x and len(values) > 5 else 0)
                axes.tick_params(axis="x", which="minor", length=0, labelbottom=False)
            elif log_x:
                axes.xaxis.set_major_formatter(lambda at, _: style.radii(at))
        for axes, *_ in shown:
            style.plain_log(axes) if log_y else axes.set_ylim(bottom=0)
        for axes, *_ in shown[-across:]:
            axes.tick_params(labelbottom=True)  # the lowest of a column has the numbers
    return path


def line(axes: Any, own: DataFrame, x: str, y: str, whisker: str, label: str, look: Mapping[str, Any]) -> None:
    """One line; the legend names the status of rows without a ``y``."""
    known = own[own[y].notna()]
    ends = known[whisker].fillna(0.0) if whisker else None
    axes.errorbar(known[x], known[y], yerr=ends, elinewidth=0.7, alpha=0.9, label=label, **look)
    for status, lost in own[own[y].isna() & own[x].notna()].groupby("status", sort=False):
        axes.plot(lost[x], [0.95] * len(lost), style.LOST.get(status, "x"), color=look["color"], ms=6, mew=1.6, ls="",
                  transform=axes.get_xaxis_transform(), clip_on=False, label=f"{status} ({label})")  # fmt: skip


def bars(
    path: Path, table: DataFrame, *, below: str = WHOLE, name: str = "label", facet: str = "", across: int = 1,
    parts: Parts = FRAME, cut: float = math.inf, room: float = 1.6, legend: int = 3,
) -> Path | None:  # fmt: skip
    """Panels of :func:`stacked` bars, cut at ``cut`` times the shortest; the axis is ``room`` times the longest."""
    if table.empty:
        return None
    sizes = table[facet].value_counts() if facet else [len(table)]
    across, high = min(across, len(sizes)), (0.13 if facet else 0.24) * max(sizes) + 0.3
    size = across, high, 0.35 + 0.65 * across
    with facets(path, table, facet, *size, grid="x", legend=legend, below=below) as shown:
        for i, (axes, title, own) in enumerate(shown):
            limit, longest = cut * own["total_ms"].min(), whisker_ends(own).max()
            stacked(axes, own, parts, limit)
            beside = i % across > 0 and list(own[name]) == list(shown[i - 1][2][name])
            axes.set_yticks(range(len(own)), [""] * len(own) if beside else own[name])
            axes.set_xlim(0, room * min(limit, longest) if longest > 0 else 1)
            axes.set_title(title, loc="left", fontsize=7)
        for part, (_, colour) in parts.items():
            shade = style.lightened(GREY, colour) if isinstance(colour, float) else colour
            shown[0][0].fill_between([], [], color=shade, edgecolor=GREY, lw=0.4, label=part)
    return path


def stacked(axes: Any, own: DataFrame, parts: Parts = FRAME, limit: float = math.inf) -> None:
    """One stacked bar per row, from the top down, as long as ``total_ms``. Whisker: its interquartile range. The parts
    of a frame are measured apart from the whole and may add up to another time: a bar shows the share of each in their
    sum. ``text`` at its end is red where answers are wrong, in italics where nothing was measured.
    """
    # Stages are differences: on a busy machine one may be negative.
    widths = own[[column for column, _ in parts.values()]].clip(lower=0.0).fillna(0.0)
    widths = widths.mul(own["total_ms"].fillna(0.0) / widths.sum(axis=1).replace(0.0, 1.0), axis=0)
    ends = widths.cumsum(axis=1).clip(upper=limit)
    starts = ends.shift(axis=1, fill_value=0.0)
    tints = [style.look(method)["color"] for method in own["method"]]
    for column, colour in parts.values():
        shades = [style.lightened(t, colour) if isinstance(colour, float) else colour for t in tints]
        edge = tints if isinstance(colour, float) else GREY
        look = {"height": 0.74, "color": shades, "lw": 0.4, "edgecolor": edge}
        axes.barh(range(len(own)), ends[column] - starts[column], left=starts[column], **look)
    for place, (ms, end, text) in enumerate(zip(own["total_ms"], whisker_ends(own), own["text"], strict=True)):
        known, cut = not math.isnan(ms), end > limit
        if known and ms <= limit:
            reach = [[min(end - ms, ms)], [min(end, limit) - ms]]  # no time is less than nothing
            axes.errorbar(ms, place, xerr=reach, c="black", elinewidth=0.6)
        if cut:
            axes.plot([limit], [place], **cut_mark(), label="bar cut off" if ms > limit else "whisker cut off")
        axes.annotate(text, (min(end, limit) if known else 0, place), (3 + 2 * cut, 0), annotation_clip=False,
                      textcoords="offset points", va="center", size=5.5, style="normal" if known else "italic",
                      color="#B00000" if numbers.WRONG in text else "black")  # fmt: skip
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(own) - 0.4, -0.6)


def whisker_ends(own: DataFrame) -> Series:
    """Where the whisker of each row ends, ms: half the interquartile range after the bar's end."""
    return own["total_ms"] + own["iqr_ms"].fillna(0.0) / 2


BAND = 0.3  # height of a row of dots, inches


def dots(
    path: Path, table: DataFrame, rows: str, x: str, hue: str, *, below: str, facet: str = "",
    order: Sequence[str] = (), whisker: str = "", legend: int = 2,
) -> Path | None:  # fmt: skip
    """Markers of the ratios ``x``, a band for each value of ``rows`` from the top down; a line stands at one. Logarithmic.

    hue, facet  columns with a marker, and a panel side by side, for each value
    order    of the rows; by default the table's
    whisker  column: the uncertainty of a value
    """
    own = table[table[x].notna()].reset_index(drop=True)
    if own.empty:
        return None
    here = list(own[rows].unique())
    names = [name for name in order if name in here] + [name for name in here if name not in order]
    drawn, across = looks(own, hue), own[facet].nunique() if facet else 1
    lane = {value: (i + 0.5) / len(drawn) - 0.5 for i, value in enumerate(drawn)}
    heights = own[rows].map(names.index) + 0.84 * own[hue].map(lane)
    high, wide = BAND * len(names) + 0.3, 0.45 + 0.55 * across
    with facets(path, own, facet, across, high, wide, legend=legend, grid="x", below=below, sharey=True) as shown:
        for axes, title, part in shown:
            for k in range(0, len(names), 2):
                axes.axhspan(k - 0.5, k + 0.5, color="#f3f3f3", zorder=0)
            axes.axvline(1.0, color="#444444", lw=0.8, zorder=1)
            for value, mine in part.groupby(hue, sort=False):
                look = {**drawn[value], "ls": "none", "ms": 2.5, "mew": 0.5, "elinewidth": 0.6}
                ends = mine[whisker].clip(upper=0.9 * mine[x]).fillna(0.0) if whisker else None
                axes.errorbar(mine[x], heights[mine.index], xerr=ends, label=str(value), **look)
            style.plain_log(axes, "x")
            axes.minorticks_off()
            axes.tick_params(axis="y", length=0)
            axes.set_title(title, loc="left")
        shown[0][0].set_yticks(range(len(names)), names)
        shown[0][0].set_ylim(len(names) - 0.5, -0.5)
    return path


def images(
    path: Path, shown: Sequence[tuple[str, NDArray[Any]]], *, across: int, below: str = "",
    key: Mapping[str, str] | None = None, scale: tuple[Any, Any, str] | None = None, wide: float = 1.0, **options: Any,
) -> Path:  # fmt: skip
    """Images [height, width(, 3)] with captions. ``key``: {meaning: colour}; ``scale``: colours, norm and text of a bar."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.ticker import MaxNLocator

    across = min(across, len(shown))
    down = -(-len(shown) // across)
    width = style.COLUMN_WIDTH * wide
    tallest = max(image.shape[0] / image.shape[1] for _, image in shown)
    captions = 0.11 * max(caption.count("\n") + 1 for caption, _ in shown) + 0.08
    beside = 0.15 * len(below.splitlines()) + 0.45 * bool(key) + 0.6 * bool(scale)
    size = (width, (min(2.5, tallest) * width / across + captions) * down + beside)
    colours, norm, about = scale or (None, None, "")
    look = {"cmap": colours, "norm": norm, "interpolation": "nearest" if scale or key else "antialiased"}
    options = {"grid": "", "legend": 2 * bool(key), "below": below, **options}
    with sheet(path, size, down, across, **options) as (figure, grid):
        for axes in grid.flat:
            axes.set_axis_off()
        for axes, (caption, image) in zip(grid.flat, shown, strict=False):
            axes.imshow(image, **look)
            axes.set_title(caption, fontsize=5.5)
        for text, colour in (key or {}).items():
            grid[0, 0].fill_between([], [], color=colour, label=text)
        if scale:
            bar = figure.colorbar(ScalarMappable(norm, colours), ax=list(grid.flat), location="bottom", shrink=0.9,
                                  aspect=35, pad=0.02, ticks=MaxNLocator(5))  # fmt: skip
            bar.set_label(about, fontsize=6.5)
    return path


def short(drawing: str) -> str:
    """The drawing with a class per repeated style, coordinates to 0.01 point, and no indentation."""
    styles = Counter(STYLE.findall(drawing)) if RULES in drawing else Counter()
    classes = {style: f"s{i}" for i, style in enumerate(style for style, count in styles.items() if count > 1)}

    def look(found: re.Match[str]) -> str:
        return f' class="{classes[found[1]]}"' if found[1] in classes else found[0]

    def tag(found: re.Match[str]) -> str:
        before, *style = re.split(r'( style="[^"]*")', re.sub(r"\s*\n\s*", " ", found[0]), maxsplit=1)
        whole = [NUMBER.sub(lambda number: f"{float(number[0]):.2f}", part) for part in (before, *style[1:])]
        return STYLE.sub(look, "".join([whole[0], *style[:1], *whole[1:]]))

    rules = "".join(f".{name}{{{style}}}" for style, name in classes.items())
    return re.sub(r">\n\s+<", ">\n<", TAG.sub(tag, drawing)).replace(RULES, rules + RULES, 1)
