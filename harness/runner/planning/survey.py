"""Which points of a run are measured already, which are not, and how long the rest may take.

The facts of a scene, which are part of a point's key, come from the worker that makes it; a results folder keeps them.
Where that fails, the points get records all the same, with other keys: these must go when the scene is there, or tables
would show it twice.
"""

import dataclasses
import functools
import glob
import hashlib
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import UserError
from ...files import write_atomic
from ...frame.devices import device_title
from ...frame.schedule.threads import processors
from ...results.folder import ResultsFolder, read_json
from ...results.record import FAILURES, Record, SceneFacts
from ...results.schema import whole_record
from ...results.throttled import CROWDED
from ...scene.catalogue import name_in
from ...scene.chosen_view import ChosenView
from ...scene.names import NAMES, TITLES
from ...scene.overrides import Lighting
from ...scene.readers.load import DECLARATION
from ...texts import numbered
from ...typed_json import WrongFieldError, checked
from ..source.closure import HARNESS, closure_hash
from ..workers.protocol import load_command
from .planned_point import Options, describe_method
from .time_estimate import expected_work, guess

MAKING = tuple(f"{HARNESS}.scene.{name}" for name in ("catalogue", "facts", "overrides", "prepared"))
"""The modules that make scenes and their facts."""


def known_scene(folder: ResultsFolder, load: dict[str, Any]) -> dict[str, Any] | None:
    """The facts of a scene, if it was loaded before with the same options, source files and code; None, too, where its
    files cannot be read: the worker that is to make it says why.
    """
    try:
        return checked(SceneFacts, (read_json(folder.path / "scenes.json") or {}).get(_scene_id(load)))
    except (UserError, WrongFieldError):
        return None


def learn_scene(folder: ResultsFolder, load: dict[str, Any], facts: dict[str, Any]) -> None:
    """Store the facts of a scene, so that a finished run need not make the scene again."""
    path = folder.path / "scenes.json"
    with folder.writing():
        write_atomic(path, {**(read_json(path) or {}), _scene_id(load): facts})


def _scene_id(load: dict[str, Any]) -> str:
    """A hash of everything that a scene's facts depend on: its files, image size, lights, and the code that makes it."""
    name, folder = load["scene"], load["scene_dir"]
    # A declared scene may use the mesh of any stand-in.
    makers = [one for one in NAMES if name == one or Path(name).suffix.lower() == DECLARATION]
    code = closure_hash([*MAKING, *(f"{HARNESS}.scene.standins.{one}" for one in makers)])
    what = {key: load[key] for key in ("scene", "frames", "width", "height", "lighting", "view") if key in load}
    source = ChosenView.read(load.get("view")).resolved(name, folder).source
    return hashlib.sha256(f"{what} {source} {code} {np.__version__}".encode()).hexdigest()[:16]


def unmade_scene(options: Options, name: str, lighting: Lighting) -> dict[str, Any]:
    """The facts of a scene, given as ``name``, that are known though it could not be made."""
    try:
        scene = options.described(name)
        called = {"name": scene.name, "title": scene.title}
    except UserError:
        called = {"name": name_in(Path(name)), "title": TITLES.get(name, Path(name).name)}
    return {**called, "source": {"kind": "", "file": name}, "lighting": lighting.facts()}


def forget_unmade(folder: ResultsFolder, made: Iterable[tuple[str, str | None]]) -> None:
    """Remove failures of scenes that are made by now. ``made``: the keys of their points, their methods' labels."""
    with folder.writing():
        for key, label in made:
            # All but the hash of the configuration, which says whether there was a scene.
            alike = f"{glob.escape(key.rpartition('-')[0])}-*.json"
            for path in (folder.path / "records").glob(alike):
                record = whole_record(path)
                if record is not None and record.method.get("label") == label and is_unmade(record):
                    path.unlink(missing_ok=True)


def is_unmade(record: Record) -> bool:
    return record.status in FAILURES and not record.scene.get("arrays_sha256")


@dataclass(frozen=True)
class Planned:
    """A point: ``status`` of its record, "" where it is to be measured; ``sampling_s`` its record's time of samples;
    ``guess`` its seconds by :func:`.time_estimate.guess`, from a measured rate or None.
    """

    scene: str
    light: str
    method: str
    status: str
    sampling_s: float
    work: float
    guess: Callable[[float | None], float]

    @property
    def to_do(self) -> bool:
        return not self.status


def survey(options: Options) -> list[Planned]:
    """The points of a run; nothing is made or written. Those of a scene not known yet are all to be measured."""
    folder, found = ResultsFolder(options.out), []
    for part in options.preset.parts():
        own = dataclasses.replace(options, preset=part)
        methods = [(entry, describe_method(entry, options.device)) for entry in part.methods]
        for scene in part.scenes:
            work = expected_work(scene, part)
            for lighting in part.lightings:
                facts = known_scene(folder, load_command(own, folder, lighting, scene))
                seconds = functools.partial(guess, scene, part, lighting.targets, options.device)
                for entry, method in methods:
                    record = folder.record(own.point(entry, facts, method).key) if facts else None
                    done = record is not None and not (options.retry and record.says_nothing)
                    status = record.status if record is not None and done else ""
                    sampled = sum(one.get("spent_s", 0.0) for one in (record and record.rounds) or ())
                    name = facts["name"] if facts else Path(scene).stem
                    label = entry.label or entry.method
                    found.append(Planned(name, lighting.label, label, status, sampled, work, seconds))
    return found


def seconds_left(points: list[Planned]) -> tuple[float, bool]:
    """Seconds that the points to be measured may take, and whether that follows from the points of this folder: the time of
    their samples is known. All else, most of it on a GPU, is guessed from the sizes of scenes and image.
    """
    known = [p for p in points if not p.to_do and p.sampling_s]
    rate = sum(p.sampling_s for p in known) / sum(p.work for p in known) if known else None
    return sum(p.guess(rate) for p in points if p.to_do), bool(known)


def untimed_s(options: Options) -> float:
    """Seconds of the untimed work after the points, roughly."""
    after_s = options.experiment.after_s
    return after_s(options) if after_s else 0.0


def duration(seconds: float) -> str:
    """A duration as text: "40 s", "5 min", "2.5 h"."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def announcement(options: Options, points: list[Planned]) -> str:
    """The plan of a run, in one line."""
    to_do, scenes = sum(p.to_do for p in points), len({p.scene for p in points})
    name = f"{options.experiment.name}, preset {options.preset_name}, on {device_title(options.device)}"
    there, untimed = len(points) - to_do, untimed_s(options)
    if not to_do and not untimed:
        return f"{name}: nothing to measure, {there} of {len(points)} points are already in {options.out}"
    seconds, known = seconds_left(points)
    text = f"{name}: {numbered(len(points), 'point')} on {numbered(scenes, 'scene')}, results go to {options.out}"
    if there:
        text += f"; {there} of them {'is' if there == 1 else 'are'} already measured"
    text += f". This may take {'about' if known else 'roughly'} {duration(seconds + untimed)}"
    if untimed:
        text += f", {duration(untimed)} of it for untimed counts"
    if not known:
        text += ", and the time to compile kernels that are not in Warp's cache, at the first scene"
    return text + busy(options.device)


def busy(device: str) -> str:
    """A warning if the load of the machine exceeds its cores; else ""."""
    load, cores = os.getloadavg()[0], processors()
    if load <= CROWDED * cores:
        return ""
    what = "CPU times will be too long" if device == "cpu" else "wall-clock times will be too long"
    return f". The machine is busy (load {load:.1f} on {numbered(cores, 'core')}): {what}"


def as_json(options: Options, points: list[Planned]) -> dict[str, Any]:
    seconds, known = seconds_left(points)
    rows = [
        {"scene": p.scene, "light": p.light, "method": p.method, "status": p.status or "to be measured"} for p in points
    ]
    return {"points": rows, "seconds": round(seconds + untimed_s(options), 1), "rough": not known}


def as_text(options: Options, points: list[Planned]) -> str:
    """The output of ``run --dry-run``: one line per point, and the announcement of the run."""
    lines = []
    for p in points:
        where = f"{p.scene}, {p.light}" if p.light else p.scene
        state = "to be measured" if p.to_do else f"already measured ({p.status})"
        lines.append(f"{where}, {p.method}: {state}")
    return "\n".join([*lines, announcement(options, points)])
