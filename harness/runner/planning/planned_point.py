"""The points of an experiment: what is measured, its configuration and its key; the options of a run."""

import dataclasses
import hashlib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from ...errors import UserError, did_you_mean, one_line
from ...files import digest, plain, require_storable
from ...frame import registry
from ...frame.devices import device_for, device_title
from ...results.journal import Journal
from ...results.record import SCHEMA, MethodFacts, Record, make_record
from ...scene.chosen_view import ChosenView
from ...scene.overrides import Lighting
from ...scene.scene import Scene
from ...typed_json import checked
from ..source.closure import source_hash
from .experiment import Entry, Experiment, Preset


def parse_settings(texts: list[str], entries: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """Entries with ``method.param=value`` added to those of the method. Raises as :func:`describe_method`."""
    result, known = list(entries), {entry.method for entry in entries}
    for text in texts:
        method, key, value = _parsed(text)
        if method not in known:
            raise UserError(f"--set {text!r}: {method!r} is not one of the methods to run{did_you_mean(method, known)}")
        result = [
            dataclasses.replace(e, settings={**e.settings, key: value}) if e.method == method else e for e in result
        ]
    for entry in result:
        describe_method(entry, "cpu")
    return tuple(result)


def refuse_own_settings(experiment: str, texts: list[str], entries: tuple[Entry, ...]) -> None:
    """Raise :class:`UserError` for a setting that an entry of the experiment has itself. The labels of entries name
    such settings, and tables, findings and claims compare entries by label.
    """
    for text in texts:
        method, key, _ = _parsed(text)
        own = [entry.settings.get(key) for entry in entries if entry.method == method]
        if values := list(dict.fromkeys(value for value in own if value is not None)):
            named = ", ".join([*["default"] * (None in own), *values])
            raise UserError(f"--set {method}.{key}: {experiment} sets it itself ({named}); leave it out")


def _parsed(text: str) -> tuple[str, str, str]:
    match = re.fullmatch(r"([\w-]+)\.(\w+)=(.*)", text)
    if not match:
        raise UserError(f"--set {text!r}: write it as method.param=value")
    return match[1], match[2], match[3]


def describe_method(entry: Entry, device: str) -> dict[str, Any]:
    """Facts about a method for its records. ``broken``: why the method cannot be constructed. Raises :class:`UserError`
    for an unknown method or parameter, or a value of a wrong type.
    """
    facts: dict[str, Any] = {"name": entry.method, "title": entry.method, "label": entry.label or entry.method}
    facts |= {"settings": dict(entry.settings), "parameters": {}, "capturable": None, "source_sha256": ""}
    facts |= {"device": device, "asked_device": device}
    try:
        method = registry.make_method(entry.method, dict(entry.settings))
        cls = type(method)
        own = plain(
            {
                **facts, "title": cls.title or entry.method, "label": entry.label or cls.title or entry.method,
                "parameters": {name: dataclasses.asdict(getattr(method, name)) for name in ("build", "trace")},
                "capturable": bool(method.capturable), "known_inexact": getattr(method, "known_inexact", None),
                "device": device_for(cls, device), "source_sha256": source_hash(cls),
            }
        )  # fmt: skip
        require_storable(own)
        facts = checked(MethodFacts, own)
    except UserError:
        raise
    except Exception as error:  # a package may fail in any way; this affects only its own points
        facts["broken"] = f"cannot be constructed: {type(error).__name__}: {one_line(error)}"
    return {**facts, "device_name": device_title(facts["device"])}


@dataclass(frozen=True, eq=False)
class Point:
    """One planned measurement. ``configuration``: everything that its key depends on."""

    key: str
    entry: Entry
    scene: dict[str, Any]
    method: dict[str, Any]
    configuration: dict[str, Any]
    preset: Preset


OF_SCENE = ("arrays_sha256", "moments_sha256", "camera", "lights", "light_path", "effects")
OF_METHOD = ("label", "settings", "parameters", "device", "device_name")
OF_PRESET = ("width", "height", "samples", "most", "deviation", "stage_samples", "rounds", "budget_s")
"""Facts that a key always depends on."""

OF_SOME_SCENES, OF_SOME_PRESETS = ("lighting", "surfaces_sha256"), ("maps", "memory", "wrong_maps", "costs_s")
"""Those that it depends on where there is such a thing."""


def make_point(
    experiment: str, preset: Preset, entry: Entry, scene: dict[str, Any], method: dict[str, Any], seed: int
) -> Point:
    """The point of a method on a scene, whose facts a worker gave (see :func:`.scene.facts.scene_facts`)."""
    source, of_preset = scene.get("source") or {}, vars(preset)
    of_files = {"files_sha256": source.get("sha256"), "asked": source.get("asked")}
    configuration = {
        "schema": SCHEMA, "experiment": experiment, "scene": scene["name"],
        **{name: scene.get(name) for name in OF_SCENE}, "method": entry.method,
        "method_sha256": method["source_sha256"], **{name: method[name] for name in OF_METHOD},
        "warp": wp.__version__, **{name: of_preset[name] for name in OF_PRESET},
        "frames": list(scene.get("frames") or ()), "seed": seed,
        **{name: scene[name] for name in OF_SOME_SCENES if scene.get(name)},
        **{name: value for name, value in of_files.items() if value},
        **{name: of_preset[name] for name in OF_SOME_PRESETS if of_preset[name]},
    }  # fmt: skip
    words = [scene["name"], (scene.get("lighting") or {}).get("label", ""), entry.method, entry.label]
    return Point(key_of(words, preset, configuration), entry, scene, method, configuration, preset)


def key_of(words: Iterable[str], preset: Preset, configuration: dict[str, Any]) -> str:
    """The key of a point: words to read, the size, and a hash of all that it depends on."""
    stem = "-".join(filter(None, words))
    readable = re.sub(r"[^a-z0-9_.-]+", "-", stem.lower()).strip("-.")[:60]
    return f"{readable}-{preset.width}x{preset.height}-{digest(configuration)[:16]}"


def seed_of(text: str) -> int:
    """A number that is the same for the same text, whatever the process."""
    return int.from_bytes(hashlib.sha256(text.encode("utf-8", "surrogatepass")).digest()[:4], "big")


def orders(count: int, rounds: int, seed: int) -> list[list[int]]:
    """A random order of ``count`` points for each round; over the rounds, each point has each place equally often. The
    orders are rows of a cyclic Latin square over a random first order. Every second row is reversed, so that neighbours
    change.
    """
    first = np.random.default_rng(seed).permutation(count)
    return [np.roll(first, -(number // 2))[:: 1 - 2 * (number % 2)].tolist() for number in range(rounds)]


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
        self, point: Point, events: Iterable[dict[str, Any]] = (), environment: str = "", status: str = "ok",
        reason: str = "",
    ) -> Record:  # fmt: skip
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
    reference. Equal answers go to the same process, which scores them once.
    """
    queues: list[list[Job | None]] = [[] if not number else [None] for number in range(graders)]
    groups: dict[str, int] = {}
    for job in jobs:
        number = groups.setdefault(job.answers or job.point.key, len(groups) % graders)
        queues[number].append(job)
    return queues
