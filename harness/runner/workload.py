"""How much work a scene is, roughly: for the order in which scenes are measured, and for how long the rest will take."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..frame.devices import device_title
from ..scene.names import ANIMATED, TRIANGLES
from ..scene.standins import balls
from .experiment import Preset
from .job import Options

PIXEL = 1.75
"""What a pixel costs, in triangles: about so over the methods of Table 1 on a CPU."""

BYTES = 50
"""Of a mesh file to a triangle, about."""

UNKNOWN = 100_000
"""Triangles of what cannot be told from its name: a declared scene, a folder of frames."""


def expected_work(scene: str, preset: Preset) -> float:
    """The work of one method on a scene under one lighting, in triangles. ``scene`` as it was typed."""
    path = Path(scene)
    triangles = TRIANGLES.get(scene) or balls.count_of(scene)
    if triangles is None:
        triangles = path.stat().st_size // BYTES if path.suffix != ".toml" and path.is_file() else UNKNOWN
    frames = preset.frames if scene in ANIMATED else 1
    return frames * preset.rounds * (triangles + PIXEL * preset.width * preset.height)


def points_of(preset: Preset) -> int:
    """Points of a preset, those that come after it left out."""
    return len(preset.scenes) * len(preset.lightings) * len(preset.methods)


def steps_of(preset: Preset) -> int:
    """Steps of a point: it is prepared, measured in rounds, and judged."""
    return preset.rounds + 2


def announcement(options: Options) -> str:
    """What a run is going to do, in one line."""
    parts = options.preset.parts()
    points = sum(points_of(part) for part in parts)
    scenes = len({scene for part in parts for scene in part.scenes})
    return (
        f"{options.experiment.name}, preset {options.preset_name}, on {device_title(options.device)}: {points} "
        f"point{'s' * (points != 1)} on {scenes} scene{'s' * (scenes != 1)}, results go to {options.out}. "
        f"Kernels that are not in Warp's cache are compiled at the first scene"
    )


class Estimate:
    """How long the scenes that are left will take, from how long those took that were measured."""

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
        """A scene was measured; ``seconds`` without those that come only once (compiling)."""
        self._done += work
        self._seconds += seconds
        self.to_do -= work

    def skipped(self, work: float) -> None:
        """A scene had its records."""
        self.to_do -= work

    def left(self) -> float | None:
        """Seconds, or None before anything was measured."""
        return self._seconds / self._done * self.to_do if self._done else None
