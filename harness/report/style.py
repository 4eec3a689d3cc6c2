"""Style that all tables and drawings share: one colour per method, one name for each quantity, light axes."""

import importlib
import math
import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..frame.registry import PACKAGE, method_names
from ..frame.schedule.passes import PARTS

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#882255", "#8C564B")
"""Okabe and Ito's colours (distinct with every common colour vision), a wine red, a brown. Greys: parts of a frame."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")  # beside colours, so that lines are distinct in a grey print

PART_SHARE = dict(zip(PARTS, (0.0, 0.40, 0.68, 0.88), strict=True))
"""How much each part of a frame is lightened from its method's colour, in steps that are distinct in a grey print."""

COLUMN_WIDTH = 3.4  # inches: one column of a two-column page

LOST = {"rejected": "x", "timeout": "+", "failed": "1", "skipped": "2"}
"""The mark of a point without a time, by its status."""


def in_order(methods: Iterable[str]) -> list[str]:
    """The registry's methods, then others by name: the order of rows and columns."""
    known = method_names()
    return known + sorted(set(methods) - set(known))


def look(method: str) -> dict[str, str]:
    """The colour and the marker of a method: as the methods' package says, or for others from the checksum of the name.
    So they are the same whatever else is measured or installed.
    """
    place, slot = divmod(zlib.crc32(method.encode()), len(COLOURS))
    other = (COLOURS[slot], MARKERS[place % len(MARKERS)])
    colour, marker = importlib.import_module(PACKAGE).LOOKS.get(method, other)
    return {"color": colour, "marker": marker}


def kind(method: str) -> str:
    """The kind of structure of a method, as the methods' package says; else its name."""
    found: str = importlib.import_module(PACKAGE).KINDS.get(method, method)
    return found


def colours(methods: Iterable[str]) -> dict[str, str]:
    """The colour of each method, in their order."""
    return {name: look(name)["color"] for name in in_order(methods)}


def lightened(colour: str, share: float) -> tuple[float, ...]:
    """An "#rrggbb" colour mixed with white: 0 leaves it, 1 is white."""
    return tuple((1 - share) * int(colour[i : i + 2], 16) / 255 + share for i in (1, 3, 5))


def radii(distance: float) -> str:
    """A distance in short form: 0.1, 10, 1e5, 1e7."""
    return f"{distance:.0e}".replace("e+0", "e") if distance >= 1e4 else f"{distance:g}"


SHEET = {  # matplotlib settings for figures that are read at column width
    **dict.fromkeys(("font.size", "axes.labelsize"), 7), "axes.titlesize": 7.5,
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), 6.5),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right"), False), "axes.axisbelow": True, "axes.linewidth": 0.6,
    "grid.color": "#dddddd", "grid.linewidth": 0.5, "lines.linewidth": 1.1, "lines.markersize": 3.5,
    "text.parse_math": False,  # a name with two dollar signs is no formula
    "svg.fonttype": "none", "svg.hashsalt": "shadowbench", "font.family": "DejaVu Sans",
}  # fmt: skip


def plain_number(value: float, _: int = 0) -> str:
    """A label of an axis, without an exponent however small or large."""
    return np.format_float_positional(float(f"{value:.6g}"), trim="-")


def plain_log(axes: Any, which: str = "y") -> None:
    """A logarithmic axis with plain numbers, once all is drawn: 1, 2 and 5 of each power where few powers lie on it; where
    fewer than three of these do, numbers at equal distances.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

    if not getattr(axes.dataLim, f"{which}1") > 0.0:
        return
    axes.set(**{f"{which}scale": "log"})
    axis = getattr(axes, f"{which}axis")
    low, high = axis.get_view_interval()
    powers = math.floor(math.log10(high)) - math.ceil(math.log10(low)) + 1
    few = 5 if which == "x" and powers > 4 else 99  # labels beside one another take more room
    parts = (1.0, 2.0, 5.0) if powers < 3 else (1.0,)
    around = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    if sum(low <= part * 10.0**power <= high for part in parts for power in around) > 2:
        axis.set_major_locator(LogLocator(subs=parts, numticks=few))
    else:
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(plain_number if few == 99 else lambda at, _: radii(at)))
    axis.set_minor_formatter(NullFormatter())
