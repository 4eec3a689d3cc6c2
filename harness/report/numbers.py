"""How a measured number is written: its digits, as many as its spread carries, and its marks.

Terminal, Markdown, LaTeX, drawings and the page show the texts that are made here, so that a number reads the same in all.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pandas import Series

NOISY = "~"
"""Mark before a number that is shown with fewer digits, because its spread is too large or not known."""
OK, WRONG, UNSCORED = "✓", "✗", "unscored"
"""Marks of answers: none is wrong, some are, nobody knows."""
MEANINGS = {
    NOISY: f"{NOISY}: shown with fewer digits, as the spread of the repeats carries no more, or a single repeat has none.",
    r"\[\d+/\d+\]": "[1/3]: the mean over 1 of 3 frames; the others were not measured.",
}
"""What a mark says, by the pattern that finds it in a text."""

TIME, COUNT = "ms", "count"
count = "{:,.0f}".format


def carried(value: float | None, spread: float = 0.0, form: str = "") -> str:
    """A number to the first digit that its ``spread`` changes (nan: two), three at most.

    form  "+": with a sign; "ms": a time, of which one below zero, a difference of two times that are alike, is none;
          "count": whole numbers are whole
    """
    if value is None or not math.isfinite(value):
        return "-"
    if form == TIME:
        return carried(value, spread) if value >= 0 else f"{NOISY}0"
    if form == COUNT:
        return count(value) if value == int(value) else carried(value, spread)
    value = float(value)
    size = math.floor(math.log10(abs(value))) if value else -3
    finest = min(0, max(size - 2, -3))
    coarsest = max(finest, size - 1 if math.isnan(spread) else math.floor(math.log10(max(spread, 1e-9))))
    shown = round(value, -coarsest) or 0.0  # no minus before a zero
    return NOISY * (coarsest > max(finest, size - 2)) + f"{shown:{form * (shown != 0)},.{max(0, -coarsest)}f}"


def carry(values: Series, spreads: Series, form: str = "") -> Series:
    """:func:`carried` of each value with its spread; what is not known is missing."""
    pairs = zip(values.astype("float64"), spreads.astype("float64"), strict=True)
    texts = [carried(*pair, form) for pair in pairs]
    # As texts also where there are none: pyarrow, where it is installed, joins no column of unknown type to a text.
    return values.astype(object).where(values.isna(), texts).astype("str")


def of_frames(texts: Series, frames: Series, whole: Series) -> Series:
    """Times, marked where they are means over fewer frames than others beside them: "0.363 [1/3]"."""
    fewer = (frames > 0) & (frames < whole)
    return texts.where(~fewer, texts + " [" + frames.astype(str) + "/" + whole.astype(str) + "]")


def check_text(row: Mapping[str, Any]) -> str:
    """The mark that goes with a point's times: a tick, how many answers are wrong, or "unscored"."""
    wrong = row["true_errors"]
    if wrong != wrong or wrong is None or str(wrong) == "<NA>":
        return UNSCORED
    if wrong:
        return f"{WRONG} {wrong:,.0f} wrong"
    return OK if row["check"] == "ok" else f"{WRONG} {row['excused_share']:.2%} excused"


def meanings(texts: Iterable[str]) -> list[str]:
    """What the marks in these texts say, a line each."""
    whole = "\n".join(texts)
    return [meaning for mark, meaning in MEANINGS.items() if re.search(mark, whole)]
