"""The options of a run, and a point that is being measured."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ...results.journal import Journal
from ...results.record import Record
from ...scene.chosen_view import ChosenView
from ...scene.overrides import Lighting
from ...scene.scene import Scene
from .experiment import Experiment, Preset
from .planned_point import Point


@dataclass(frozen=True)
class Options:
    """The checked options of one ``shadowbench run``. ``extras``: untimed work that was asked for (``--with``)."""

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
    view: ChosenView = field(default_factory=ChosenView)
    extras: tuple[str, ...] = ()

    def described(self, scene: str) -> Scene:
        """A scene of the run, given by name or file, with the camera and the lights of the command line."""
        return self.view.resolved(scene, self.scene_dir)


@dataclass(eq=False)
class Job:
    """A point being measured: ``scene`` as given, the generation of the worker that prepared it, remaining steps.

    graders_lost  scoring processes that were killed with its answers
    """

    point: Point
    scene: str
    journal: Journal
    steps: int
    lighting: Lighting = field(default_factory=Lighting)
    generation: int = 0
    graders_lost: int = 0
    record: Record | None = None

    @property
    def method(self) -> str:
        return self.point.entry.method
