"""Figure 11's columns for the claims, which still read records: to go with them."""

from __future__ import annotations

from typing import Any

from ...harness.report import points
from .figure11_rows import AXES, CLAMPS, panel, short

__all__ = ["AXES", "CLAMPS", "add", "panel", "short"]


def add(r: dict[str, Any], traversal: str) -> None:
    """Add what the panels are chosen by, the time of the traversal alone, and the work that was counted."""
    known = r["set"]
    r.update(
        clamp=known["clamp"],
        axes=AXES[truth(known["aimed"])],
        precision=known["precision"],
        r=int(known["r"]),
    )
    r["traversal_ms"] = points.pass_ms(r["record"], "shadow", traversal) if r.get("total_ms") else None


def truth(value: Any) -> bool:
    """A setting as a bool, be it text or not."""
    return str(value).lower() in ("true", "1")
