"""The least time that stages could take on a device: bytes over bandwidth or tests over rate, and a launch each.

What a stage must at least move and test is an experiment's to say (:class:`Work`); what a device can do is here, as
measured or, where said so, reckoned. A floor is no promise: it leaves out every latency but the launch's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import points

Row = dict[str, Any]


@dataclass(frozen=True)
class Work:
    """What a stage cannot do without: bytes read and written once, ray-triangle tests, kernels one after another.

    stage  what it is a share of, where passes beside each other make up a stage; empty where the pass is all of it
    """

    bytes: float = 0.0
    tests: float = 0.0
    launches: int = 1
    stage: str = ""

    def beside(self, other: Work) -> Work:
        """Both shares of a stage: their kernels run at once."""
        launches = max(self.launches, other.launches)
        return Work(self.bytes + other.bytes, self.tests + other.tests, launches, self.stage)


@dataclass(frozen=True)
class Machine:
    """What a device can do: bytes a second, ray-triangle tests a second, milliseconds from one kernel to the next."""

    bytes_per_s: float
    tests_per_s: float
    launch_ms: float


MACHINES = {
    # A copy counted both ways; 132 multiprocessors of 4 x 32 lanes at 1.98 GHz, 20 instructions a test of edge
    # planes (not measured); a hundred tiny kernels in a graph.
    "NVIDIA H200": Machine(4.3e12, 1.65e12, 0.001),
}
"""Devices whose rates are known, by the name that records give them."""

WorkOf = Callable[[dict[str, Any], dict[str, Any], str], Work | None]
"""(record, frame of it, name of a pass) to the work of that pass; None where it is not known."""

COLUMNS = ["scene", "stage", "part", "ms", "floor_ms", "times", "bytes_mb", "tests_m", "launches"]


def least_ms(work: Work, machine: Machine) -> float:
    """Bytes and tests can overlap, launches cannot."""
    moving, testing = work.bytes / machine.bytes_per_s, work.tests / machine.tests_per_s
    return 1e3 * max(moving, testing) + machine.launch_ms * work.launches


def stages(rows: Sequence[Row], ours: str, work_of: WorkOf) -> list[Row]:
    """A row a stage of our method on each scene of a known device: mean over frames of time, floor and work."""
    result = []
    for r in points.measured(rows):
        machine = MACHINES.get(r["device_name"])
        if r["label"] != ours or machine is None:
            continue
        frames = [f for f in r["record"]["frames"] if f["total_ms"]]
        result += [{"scene": r["scene"], **row} for row in _stages_of(r["record"], frames, machine, work_of)]
    return result


def _stages_of(record: Row, frames: Sequence[Row], machine: Machine, work_of: WorkOf) -> list[Row]:
    works: dict[str, list[Work | None]] = {}
    times: dict[str, list[float | None]] = {}
    parts: dict[str, str] = {}
    for n, frame in enumerate(frames):
        for step in frame["passes"]:
            work = work_of(record, frame, step["name"])
            ms = float(np.median(step["ms"])) if step["ms"] else None
            stage = work.stage if work and work.stage else step["name"]
            parts.setdefault(stage, step["part"])
            if len(works.setdefault(stage, [])) == n:
                works[stage].append(work)
                times.setdefault(stage, []).append(ms)
            else:  # another share of the same stage
                last, known = works[stage][n], times[stage][n]
                works[stage][n] = last.beside(work) if last and work else None
                times[stage][n] = None if known is None or ms is None else known + ms
    rows = []
    for stage, part in parts.items():
        measured = [ms for ms in times[stage] if ms is not None]
        row: Row = {"stage": stage, "part": part, "ms": float(np.mean(measured)) if measured else None}
        known_works = [work for work in works[stage] if work is not None]
        if len(known_works) == len(frames):
            row["floor_ms"] = float(np.mean([least_ms(work, machine) for work in known_works]))
            row["bytes_mb"] = float(np.mean([work.bytes for work in known_works])) / 1e6
            row["tests_m"] = float(np.mean([work.tests for work in known_works])) / 1e6
            row["launches"] = known_works[0].launches
            if row["ms"] is not None:
                row["times"] = row["ms"] / row["floor_ms"]
        rows.append(row)
    return rows


def of_frames(found: Sequence[Row]) -> dict[str, float]:
    """The floor of a whole frame in ms, by scene: of those all of whose stages have one."""
    result: dict[str, float] = {}
    for scene in dict.fromkeys(r["scene"] for r in found):
        own = [r.get("floor_ms") for r in found if r["scene"] == scene]
        if all(x is not None for x in own):
            result[scene] = float(sum(x for x in own if x is not None))
    return result


def write(found: Sequence[Row], path: Path) -> Path:
    """The stages as CSV."""
    return points.write_csv(found, path, COLUMNS)


def sentence(rows: Sequence[Row], found: Sequence[Row], ours: str) -> list[str]:
    """How far whole frames are from their floor, and which stages are farthest in milliseconds."""
    floors = of_frames(found)
    frames = [r for r in points.measured(rows) if r["label"] == ours and r["scene"] in floors]
    if not frames:
        return []
    said = ", ".join(
        f"{r['scene']} {floors[r['scene']]:.3f} ms ({r['total_ms'] / floors[r['scene']]:.1f} times)"
        for r in frames
    )
    lost: dict[str, float] = {}
    for r in found:
        if r["scene"] in floors and r["ms"] is not None:
            lost[r["stage"]] = lost.get(r["stage"], 0.0) + (r["ms"] - r["floor_ms"]) / len(floors)
    worst = sorted(lost.items(), key=lambda item: -item[1])[:3]
    return [
        f"Floor of the frame (bytes over bandwidth or tests over rate, and launches), and how many times the frame "
        f"takes: {said}. Farthest from their floors, mean of the scenes: "
        + ", ".join(f"{name} by {ms:.3f} ms" for name, ms in worst)
        + "."
    ]
