"""A rough estimate of the work of a scene, for the order of the scenes and the remaining time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..scene.names import ANIMATED, TRIANGLES
from ..scene.standins import balls
from .experiment import Preset

PIXEL = 1.75
"""Cost of a pixel relative to a triangle, roughly, for the methods of Table 1 on a CPU."""

BYTES = 50
"""Bytes of a mesh file per triangle, roughly."""

UNKNOWN = 100_000
"""Assumed number of triangles if the name does not tell: a declared scene, a folder of frames."""


def expected_work(scene: str, preset: Preset) -> float:
    """The work of one method on a scene with one lighting, in triangles. ``scene`` as on the command line."""
    path = Path(scene)
    triangles = TRIANGLES.get(scene) or balls.count_of(scene)
    if triangles is None:
        triangles = path.stat().st_size // BYTES if path.suffix != ".toml" and path.is_file() else UNKNOWN
    frames = preset.frames if scene in ANIMATED else 1
    return frames * preset.rounds * (triangles + PIXEL * preset.width * preset.height)


def points_of(preset: Preset) -> int:
    """Points of a preset, without the presets that follow it."""
    return len(preset.scenes) * len(preset.lightings) * len(preset.methods)


def steps_of(preset: Preset) -> int:
    """Steps of a point: it is prepared, measured in rounds, and judged."""
    return preset.rounds + 2


class Estimate:
    """Estimates the time of the remaining scenes from the times of those already measured."""

    def __init__(self, work: float):
        self.to_do = work
        self._done = self._seconds = 0.0

    @classmethod
    def of(cls, parts: Sequence[Preset]) -> Estimate:
        """For all scenes of some presets."""
        each = (
            expected_work(scene, part) * points_of(part) / len(part.scenes)
            for part in parts
            for scene in part.scenes
        )
        return cls(sum(each))

    def measured(self, work: float, seconds: float) -> None:
        """A scene was measured; ``seconds`` excludes one-time costs (compiling)."""
        self._done += work
        self._seconds += seconds
        self.to_do -= work

    def skipped(self, work: float) -> None:
        """A scene already had all of its records."""
        self.to_do -= work

    def left(self) -> float | None:
        """Seconds, or None before anything was measured."""
        return self._seconds / self._done * self.to_do if self._done else None
