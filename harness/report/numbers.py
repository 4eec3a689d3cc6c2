"""How a measured number is written: its digits, as many as its spread carries, its marks, and its place in a finding.
Terminal, Markdown, LaTeX, drawings and the page show the texts that are made here, so that a number reads the same in
all.
"""

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

from .compare import geometric
from .dataframe import DataFrame, Series

NOISY = "~"  # mark before a number that is shown with fewer digits, because its spread is too large or not known
OK, WRONG, UNSCORED = "✓", "✗", "unscored"  # marks of answers: none is wrong, some are, nobody knows
MEANINGS = {  # what a mark says, by the pattern that finds it in a text
    NOISY: f"{NOISY}: shown with fewer digits, as the spread of the repeats carries no more, or a single repeat has none.",
    r"\[\d+/\d+\]": "[1/3]: the mean over 1 of 3 frames; the others were not measured.",
}

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


def texts(table: DataFrame, name: str, form: str = "") -> Series:
    """A column as texts, with the digits that its spread carries: the column NAME_spread; none is a spread of zero."""
    return carry(table[name], table.get(f"{name}_spread", table[name] * 0.0), form)


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


def mean(table: DataFrame, ratio: str) -> str:
    """The geometric mean of a column of ratios, with the digits that their spreads (column RATIO_spread) carry."""
    values, spreads = table[ratio].astype("float64"), table.get(f"{ratio}_spread", table[ratio] * 0.0)
    middle = geometric(values)
    return carried(middle, middle * float(((spreads / values) ** 2).sum(skipna=False)) ** 0.5 / len(values))


def means(table: DataFrame, ratio: str, by: str) -> list[tuple[str, str]]:
    """Each value of ``by`` with its :func:`mean`, the least first: of the values that as many scenes have as any."""
    own = table[table[ratio].notna()].groupby(by, sort=False)
    order, sizes = own[ratio].agg(geometric).sort_values(kind="stable").index, own.size()
    return [(str(name), mean(own.get_group(name), ratio)) for name in order if sizes[name] == sizes.max()]


def ends(table: DataFrame, ratio: str, by: str, one: str, other: str, lacking: str) -> str:
    """The form ``one`` of name and mean of the least, and ``other`` of those of the greatest where they differ. Means
    that read the same are one: "a or b".
    """
    found: dict[str, list[str]] = {}
    for name, text in means(table, ratio, by):
        found.setdefault(text, []).append(name)
    told = [(" or ".join(names), text) for text, names in found.items()]
    if not told:
        return lacking
    return one.format(*told[0]) + (other.format(*told[-1]) if len(told) > 1 else "")


def over(table: DataFrame) -> str:
    """What a mean is over, in brackets: "(geometric means over 6 scenes)"; "" where there is only one."""
    count = table["title"].nunique()
    return f" (geometric means over {count} scenes)" if count > 1 else ""


def listed(texts: Iterable[Any]) -> str:
    """Texts in a row as a sentence has them: "a", "a and b", "a, b and c"."""
    told = list(map(str, texts))
    return " and ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)
