"""Numbers in a finding, written as a person says them: a mean, and of several the least and the greatest by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import numbers
from .compare import geometric

if TYPE_CHECKING:
    from pandas import DataFrame


def mean(table: DataFrame, ratio: str) -> str:
    """The geometric mean of a column of ratios, with the digits that their spreads (column RATIO_spread) carry."""
    values, spreads = table[ratio].astype("float64"), table.get(f"{ratio}_spread", table[ratio] * 0.0)
    middle = geometric(values)
    return numbers.carried(middle, middle * float(((spreads / values) ** 2).sum(skipna=False)) ** 0.5 / len(values))


def means(table: DataFrame, ratio: str, by: str) -> list[tuple[str, str]]:
    """Each value of ``by`` with its :func:`mean`, the least first: of the values that as many scenes have as any."""
    own = table[table[ratio].notna()].groupby(by, sort=False)
    order = own[ratio].agg(geometric).sort_values(kind="stable").index
    whole = own.size().max()
    return [(str(name), mean(own.get_group(name), ratio)) for name in order if own.size()[name] == whole]


def ends(table: DataFrame, ratio: str, by: str, one: str, other: str, lacking: str) -> str:
    """The form ``one`` of name and mean of the least, and ``other`` of those of the greatest where there are two."""
    found = means(table, ratio, by)
    if not found:
        return lacking
    return one.format(*found[0]) + (other.format(*found[-1]) if len(found) > 1 else "")


def over(table: DataFrame) -> str:
    """What a mean is over, in brackets: "(geometric means over 6 scenes)"; "" where there is only one."""
    count = table["title"].nunique()
    return f" (geometric means over {count} scenes)" if count > 1 else ""


def listed(texts: list[Any]) -> str:
    """Texts in a row as a sentence has them: "a", "a and b", "a, b and c"."""
    told = list(map(str, texts))
    return " and ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)
