"""What a run is asked for, and a point of it under way."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..results.journal import Journal
from ..results.record import Record
from .experiment import Experiment, Preset
from .points import Point


@dataclass(frozen=True)
class Options:
    """One call of ``shadowbench run``, checked."""

    experiment: Experiment
    preset_name: str
    preset: Preset
    device: str
    out: Path
    scene_dir: str | None = None
    seed: int = 0
    save_answers: bool = False
    score: bool = True
    retry: bool = False


@dataclass(eq=False)
class Job:
    """A point under way: ``scene`` as it was named, the generation of the worker that prepared it, steps to come."""

    point: Point
    scene: str
    journal: Journal
    steps: int
    generation: int = 0
    record: Record | None = None

    @property
    def method(self) -> str:
        return self.point.entry.method
