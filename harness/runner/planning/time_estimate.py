"""A rough estimate of the work of a scene, for the order of the scenes and the remaining time."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...scene.names import ANIMATED, TRIANGLES
from ...scene.standins import balls
from .experiment import Preset

PIXEL = 1.75
"""Cost of a pixel relative to a triangle, roughly, for the methods of Table 1 on a CPU."""

BYTES = 50
"""Bytes of a mesh file per triangle, roughly."""

UNKNOWN = 100_000
"""Assumed number of triangles if the name does not tell: a declared scene, a folder of frames."""

# All that follows are rough seconds, measured on two cores and an H200.

OVERHEAD = 2.0
"""The total time of a point over that of its samples: loading, warming up, checking the answers."""

ONCE_S = 1.0
"""Of a point whatever its size: it is prepared, and its answers are written and read."""

SCENE_S = 2.0
"""Of a scene with one lighting, shared by its points: it is made, and its exact reference computed."""

CPU_S = 7.5e-7
"""Of one frame per unit of work on two CPU cores; a median over methods."""

REFERENCE_S = 8.0
"""Of the exact reference per frame and 2^20 pixels on the host of a GPU. It is computed once for all methods of a scene
with one lighting, so it is most of the time of an experiment with a single method."""

ANSWERS_S = 1.0
"""Per point, frame and 2^20 pixels of a run on a GPU: answers are copied, written, read and compared."""

ROUND_S = 0.1
"""Of the samples of a point per frame and round on a GPU; they do not depend on the scene."""

COSTS = 2.2
"""For each second that a preset asks for its costs: idle, replayed, alone and together in flight."""


def expected_triangles(scene: str) -> int:
    """Triangles of a scene, given as on the command line; of a file as a PLY's header says, else as its size tells."""
    path = Path(scene)
    triangles = TRIANGLES.get(scene) or balls.count_of(scene)
    if triangles is not None:
        return triangles
    if path.suffix == ".toml" or not path.is_file():
        return UNKNOWN
    with path.open("rb") as stream:
        told = re.search(rb"^ply\b.*?^element face (\d{1,9})\s", stream.read(4096), re.DOTALL | re.MULTILINE)
    return int(told[1]) if told else path.stat().st_size // BYTES


def frames_of(scene: str, preset: Preset) -> int:
    return preset.frames if scene in ANIMATED else 1


def expected_work(scene: str, preset: Preset) -> float:
    """The work of one method on a scene with one lighting, in triangles. ``scene`` as on the command line."""
    pixels = preset.width * preset.height
    return frames_of(scene, preset) * preset.rounds * (expected_triangles(scene) + PIXEL * pixels)


def guess(scene: str, preset: Preset, lights: int, device: str, rate: float | None = None) -> float:
    """Seconds of one point with its part of what the points of a scene share, from sizes.

    Right within a factor of two for the quick presets of the experiments on two cores, and for most paper presets on a
    GPU. ``lights``: how many lights or targets replace the scene's own; 0: none. ``rate``: measured seconds of samples per
    unit of work.
    """
    frames, work = frames_of(scene, preset), expected_work(scene, preset)
    more = (1 + max(1, lights)) / 2
    if device.startswith("cuda"):
        pixels = more * frames * preset.width * preset.height / 2**20
        shared = SCENE_S + REFERENCE_S * pixels
        sampling = (ROUND_S + COSTS * preset.costs_s) * frames * preset.rounds if rate is None else rate * work
        own = ANSWERS_S * pixels + min(sampling, preset.budget_s)
    else:
        runs = 1 + preset.samples + preset.stage_samples + 1
        shared, seconds = SCENE_S, CPU_S * runs * work * more if rate is None else OVERHEAD * rate * work
        own = min(seconds, OVERHEAD * preset.budget_s)
    return ONCE_S + shared / max(1, len(preset.methods)) + own


def points_of(preset: Preset) -> int:
    """Points of a preset, without the presets that follow it."""
    return len(preset.scenes) * len(preset.lightings) * len(preset.methods)


def steps_of(preset: Preset) -> int:
    """Steps of a point: it is prepared, measured in rounds, and judged."""
    return preset.rounds + 2


@dataclass(frozen=True)
class Unit:
    """The points of a scene, of all methods with all lightings: work of each (:func:`expected_work`), how many there are,
    and the most seconds that the samples of one may take, from its budget."""

    work: float
    points: int
    most_s: float = math.inf

    @classmethod
    def of(cls, scene: str, part: Preset) -> Unit:
        points = len(part.methods) * len(part.lightings)
        return cls(expected_work(scene, part), points, OVERHEAD * part.budget_s)


class Estimate:
    """Estimates the time of the remaining units from the times of those already measured.

    A point takes a fixed time (its scene is made, it is prepared, its answers are checked) and a time in proportion to
    its work, which its budget limits. Both are fitted to what was measured.

    to_do  the units to be measured, in any order
    clock  seconds, in which waiting for other runs does not count
    once   seconds of the unit under way that are spent once for all: starting processes, compiling; they do not count
    """

    def __init__(self, units: Sequence[Unit], clock: Callable[[], float] = time.monotonic):
        self.to_do, self.clock, self.once = list(units), clock, 0.0
        self._measured: list[tuple[Unit, float]] = []

    def begin(self, unit: Unit) -> None:
        self.to_do.remove(unit)
        self._unit, self._began, self.once = unit, self.clock(), 0.0

    def spent(self) -> float:
        """Seconds that the unit under way has taken."""
        seconds = self.clock() - self._began
        return max(seconds - self.once, 0.1 * seconds)

    def finish(self, measured: int) -> None:
        """``measured`` points of the unit under way were measured; its others had their records."""
        if measured:
            self._measured.append((replace(self._unit, points=measured), self.spent()))

    def left(self) -> float | None:
        """Seconds of the units to be measured, or None before anything was measured."""
        return self._total(self._measured) if self._measured else None

    def left_within(self, measured: int, rest: float) -> float:
        """Seconds, while ``measured`` points of the unit under way are measured, expected to take ``rest`` more."""
        return rest + self._total([*self._measured, (replace(self._unit, points=measured), self.spent() + rest)])

    def _total(self, known: Sequence[tuple[Unit, float]]) -> float:
        seconds = fitted([(unit.work, seconds / unit.points) for unit, seconds in known])
        return sum(unit.points * seconds(unit.work, unit.most_s) for unit in self.to_do)


def fitted(known: Sequence[tuple[float, float]]) -> Callable[[float, float], float]:
    """The seconds of a point from its work and the most seconds of its samples, from pairs of work and seconds: a fixed
    time and one in proportion to the work, neither negative, with the least sum of squares of relative errors.

    Points of one work do not tell the two apart: then the time grows with the square root of the work.
    """
    work, seconds = (np.array(column, dtype=np.float64) for column in zip(*known, strict=True))
    seconds = np.maximum(seconds, 1e-3)
    if np.ptp(work) < 0.01 * work.max():
        return lambda one, most: float(seconds.mean() * (one / work.mean()) ** 0.5)
    from scipy.optimize import nnls  # imported here because it takes a third of a second

    fixed, rate = nnls(np.stack([1.0 / seconds, work / seconds], axis=1), np.ones(len(work)))[0].tolist()
    return lambda one, most: fixed + min(rate * one, most)
