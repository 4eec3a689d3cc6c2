"""How much work a scene is, roughly: for the order in which scenes are measured, and for how long the rest will take."""

from __future__ import annotations

from pathlib import Path

from ..scene.names import ANIMATED, TRIANGLES
from ..scene.standins import balls
from .experiment import Preset

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


class Estimate:
    """How long the scenes that are left will take, from how long those took that were measured."""

    def __init__(self, work: float):
        self.to_do = work
        self._done = self._seconds = 0.0

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
