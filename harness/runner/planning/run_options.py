"""The options of a run, and a point that is being measured."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...results.journal import Journal
from ...results.record import Record, make_record
from ...scene.chosen_view import ChosenView
from ...scene.overrides import Lighting
from ...scene.scene import Scene
from .experiment import Entry, Experiment, Preset
from .planned_point import Point, make_point


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

    def point(self, entry: Entry, scene: dict[str, Any], method: dict[str, Any]) -> Point:
        """The point of a method on a scene, from the facts of both (:func:`.planned_point.make_point`)."""
        return make_point(self.experiment.name, self.preset, entry, scene, method, self.seed)

    def record(
        self,
        point: Point,
        events: Iterable[dict[str, Any]] = (),
        environment: str = "",
        status: str = "ok",
        reason: str = "",
    ) -> Record:
        """The record of a point from the events of its journal (:func:`.results.record.make_record`)."""
        asked = {**point.configuration, "preset": self.preset_name}
        return make_record(point.key, asked, point.scene, point.method, environment, events, status, reason)


@dataclass(eq=False)
class Job:
    """A point being measured: ``scene`` as given, the generation of the worker that prepared it, remaining steps.

    graders_lost  scoring processes that were killed with its answers
    answers       a hash of its answers to all frames, once it is prepared
    """

    point: Point
    scene: str
    journal: Journal
    steps: int
    lighting: Lighting = field(default_factory=Lighting)
    generation: int = 0
    graders_lost: int = 0
    answers: str = ""
    record: Record | None = None

    @property
    def method(self) -> str:
        return self.point.entry.method


def dealt(jobs: Sequence[Job], graders: int) -> list[list[Job | None]]:
    """What each scoring process scores in turn; None: nothing. The first job is scored alone, because that computes the
    exact reference. Equal answers go to the same process, which scores them once."""
    queues: list[list[Job | None]] = [[] if not number else [None] for number in range(graders)]
    groups: dict[str, int] = {}
    for job in jobs:
        number = groups.setdefault(job.answers or job.point.key, len(groups) % graders)
        queues[number].append(job)
    return queues
