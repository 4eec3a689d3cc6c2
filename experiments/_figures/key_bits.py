"""The columns of key_bits for the claims, which still read records: to go with them."""

from __future__ import annotations

from typing import Any

from ...harness.report import points
from .._sorting import SORT


def add(r: dict[str, Any]) -> dict[str, Any]:
    """The row with its bits, its pairs, and the time of the sort alone."""
    record = r["record"]
    r["bits"], r["pairs"] = record["point"]["bits"], record["point"]["pairs"]
    r["sort_ms"] = points.pass_ms(record, "build", SORT)
    r["copy_ms"] = points.pass_ms(record, "build", "copy")
    r["ns_a_pair"] = None if r["sort_ms"] is None else 1e6 * r["sort_ms"] / r["pairs"]
    return r
