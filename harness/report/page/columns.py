"""A DataFrame as compact JSON: one list per column, texts as indices into a list of distinct texts, numbers with few
digits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pandas import DataFrame, Series

DIGITS = 6
"""Significant digits of a measured number: finer than any spread."""


def columns(table: DataFrame) -> dict[str, Any]:
    """Each column by name: ``{"d": distinct texts, "i": their numbers}`` for texts, else a list; null: not known."""
    return {"rows": len(table), "columns": {str(name): column(table[name]) for name in table}}


def column(values: Series) -> Any:
    """One column: see :func:`columns`. Tuples, lists and dictionaries stay as they are."""
    known = values.dropna()
    if len(known) and all(isinstance(value, str) for value in known):
        distinct = list(dict.fromkeys(known))
        place = {text: number for number, text in enumerate(distinct)}
        return {"d": distinct, "i": [place.get(value) for value in values]}
    return [shortened(value) for value in values.astype(object)]


def shortened(value: Any) -> Any:
    """A value as JSON holds it: a number with :data:`DIGITS` digits, whole ones whole, None where it is not known."""
    if isinstance(value, dict):
        return {str(key): shortened(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [shortened(one) for one in value]
    if value is None or isinstance(value, str | bool | np.bool_):
        return bool(value) if isinstance(value, np.bool_) else value
    if isinstance(value, int | np.integer):
        return int(value)
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None  # pandas' <NA>
    if not math.isfinite(number):
        return None
    short = float(f"{number:.{DIGITS}g}")
    return int(number) if number == int(number) and abs(number) < 1e15 else short
