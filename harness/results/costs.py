"""What a frame and its structure cost besides time, from a record: the columns of :func:`.results.table.tidy` for it.

The harness reads these counters of methods, each of a whole frame or, with "a hundred rays" at its end, a mean: "primary
tests", "shadow tests" (of triangles), and of a tree "expected tests" and "expected nodes": what a ray that meets the box
of the scene meets in the mean, by the areas of boxes (MacDonald and Booth 1990).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from .record import Frame

if TYPE_CHECKING:
    from .record import Costs

NODE_COST = 1.2
"""What a node costs a ray, in triangle tests (Aila, Karras and Laine 2013, "On Quality Metrics of Bounding Volume
Hierarchies").
"""

NUMBERS = (  # columns of a frame, NaN where not known
    "energy_mj idle_w alone_ms pair_ms primary_tests shadow_tests expected_tests expected_nodes sah_cost bytes_per_ray"
).split()

LATENCIES = {"p50_ms": 50.0, "p95_ms": 95.0, "p99_ms": 99.0}  # percentile of a point's frames by column
MISSING = {"energy_missing": "energy", "flight_missing": "in flight"}  # columns that say why, and the record's name


def costs_of(frame: Frame, pixels: int, shadow_rays: int | None) -> dict[str, float | str]:
    """The columns :data:`NUMBERS` and :data:`MISSING` of a frame, as far as they are known."""
    known = frame.costs or []
    row: dict[str, float | str] = {
        "energy_mj": 1e3 * _median(one.energy_j for one in known),
        "idle_w": _median(one.idle_w for one in known),
        "alone_ms": _median(one.alone_ms for one in known),
        "pair_ms": _median(one.pair_ms for one in known),
        "primary_tests": _per_ray(frame, "primary tests", pixels),
        "shadow_tests": _per_ray(frame, "shadow tests", shadow_rays or 0),
        "expected_tests": _per_ray(frame, "expected tests", 0),
        "expected_nodes": _per_ray(frame, "expected nodes", 0),
    }
    row["sah_cost"] = NODE_COST * float(row["expected_nodes"]) + float(row["expected_tests"])
    rays = pixels + (shadow_rays or 0)
    row["bytes_per_ray"] = math.nan if frame.memory_bytes is None or not rays else frame.memory_bytes / rays
    return row | {column: _reason(known, what) for column, what in MISSING.items()}


def _reason(known: Iterable[Costs], what: str) -> str:
    return next((one.missing[what] for one in known if what in one.missing), "")


def _median(values: Iterable[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else math.nan


def _per_ray(frame: Frame, name: str, rays: int) -> float:
    counters = frame.counters or {}
    if name in counters:
        return counters[name] / rays if rays else math.nan
    return counters.get(f"{name} a hundred rays", math.nan) / 100


def latencies(frames: Iterable[Frame]) -> dict[str, float]:
    """The columns :data:`LATENCIES` of the samples of several frames, of which each counts equally; NaN for one frame."""
    times = [frame.total_ms for frame in frames]
    if len(times) < 2:
        return dict.fromkeys(LATENCIES, math.nan)
    weights = np.repeat([1.0 / len(own) for own in times], [len(own) for own in times])
    found = np.percentile(np.concatenate(times), [*LATENCIES.values()], weights=weights, method="inverted_cdf")
    return dict(zip(LATENCIES, found.tolist(), strict=True))
