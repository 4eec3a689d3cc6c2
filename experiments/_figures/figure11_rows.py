"""Names and rows that the tables and drawings of Figure 11 share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

CLAMPS = {"none": "unclamped", "view": "clamped to the view", "hits": "clamped to the hits"}


AXES = {False: "world axes", True: "aimed"}


PRECISE, COARSE, CENTRED = "float64", "float32", "float32-centred"


FORMATS = (COARSE, CENTRED)
"""Number formats beside the exact one; the second is told from the middle of the hit points, of aimed frames."""


REJECTED = ("rejected", "timeout", "failed")


def panel(
    rows: Sequence[dict[str, Any]], clamp: str, axes: str, precision: str = PRECISE
) -> list[dict[str, Any]]:
    """The rows of a panel, nearest light first."""
    own = [r for r in rows if (r["clamp"], r["axes"], r["precision"]) == (clamp, axes, precision)]
    return sorted(own, key=lambda r: r["light_distance"])


def short(distance: float) -> str:
    """A distance as a person writes it: 0.1, 10, 1e5, 1e7."""
    return f"{distance:.0e}".replace("e+0", "e") if distance >= 1e4 else f"{distance:g}"
