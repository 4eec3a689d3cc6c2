"""Rows of the accuracy experiment: a point's time with how wrong it is, class by class, for one frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.report import points, style

Row = dict[str, Any]

CLASSES = ("primary_wrong", "acne", "leak", "excused")
COLUMNS = [
    *points.COMMON,
    "family", "level", "known_inexact", "wrong_per_frame", *CLASSES, "ties", "flip", "flip_missing", "on_frontier",
]  # fmt: skip
FEW = 10
"""Fewer wrong pixels than this count as equal error in the equal-error table."""


def rows(folder: Path) -> list[Row]:
    """One row a point with its family, level, classes a frame (mean), FLIP of its last frame, and ``quartiles``."""
    return [_row(r) for r in points.rows(folder)]


def _row(r: Row) -> Row:
    family, _, level = r["label"].partition(": ")
    frames = [frame for frame in r["record"]["frames"] if frame.get("score")]
    times = [np.percentile(f["total_ms"], [25, 75]) for f in r["record"]["frames"] if f["total_ms"]]
    found: Row = {**r, "family": family, "level": level or family, "wrong_per_frame": None}
    found["quartiles"] = np.mean(times, axis=0) if times else None
    if frames and r.get("true_errors") is not None:
        found["wrong_per_frame"] = r["true_errors"] / len(frames)
        found |= {name: float(np.mean([_class(f["score"], name) for f in frames])) for name in CLASSES}
        found["ties"] = float(np.mean([f["score"]["primary"]["tie"] for f in frames]))
    looked = [frame for frame in r["record"]["frames"] if "flip" in frame]
    found["flip"] = looked[-1]["flip"] if looked else None
    found["flip_missing"] = looked[-1]["flip_missing"] if looked else ""
    return found


def _class(score: dict[str, Any], name: str) -> int:
    primary, shadow = score["primary"], score["shadow"]
    if name == "primary_wrong":
        return int(primary["true"] + primary["invalid"])
    if name == "excused":
        return int(primary["near_tie"] + primary["edge"]) + sum(int(s["edge"]) for s in shadow)
    return sum(int(light[name]) for light in shadow)


def usable(made: Sequence[Row]) -> list[Row]:
    """Rows that have both a time and an error."""
    return [r for r in points.measured(made) if r["wrong_per_frame"] is not None]


def mark_frontier(made: Sequence[Row]) -> None:
    """Mark the points of each scene that no other one beats in time and in error at once.

    Only points on the device that most of a scene's points ran on: a CPU's times beside a GPU's are no frontier.
    """
    for r in made:
        r["on_frontier"] = None
    for _, known in scenes(usable(made)):
        device, _ = Counter(r["device"] for r in known).most_common(1)[0]
        for r in known:
            r["on_frontier"] = r["device"] == device and not any(
                _beats(o, r) for o in known if o["device"] == device
            )


def _beats(one: Row, other: Row) -> bool:
    a, b = (one["wrong_per_frame"], one["total_ms"]), (other["wrong_per_frame"], other["total_ms"])
    return a[0] <= b[0] and a[1] <= b[1] and a != b


def families(made: Sequence[Row]) -> dict[str, tuple[str, str]]:
    """Colour and marker of each family of knobs, in the order of the rows."""
    names = list(dict.fromkeys(r["family"] for r in made))
    return {
        name: (style.COLOURS[i % len(style.COLOURS)], points.MARKERS[i % len(points.MARKERS)])
        for i, name in enumerate(names)
    }


def scenes(made: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    """The rows of each scene, scenes in their order."""
    names = dict.fromkeys(r["scene"] for r in made)
    return [(name, [r for r in made if r["scene"] == name]) for name in names]
