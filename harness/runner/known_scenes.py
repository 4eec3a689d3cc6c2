"""What a results folder knows of scenes: the facts of those that were made, and the failures to make others.

The facts of a scene, which are part of a point's key, come from the worker that makes it. Where that fails, the points get
records all the same, with other keys: these must go when the scene is there, or tables would show it twice.
"""

import glob
import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError
from ..files import write_atomic
from ..results.folder import ResultsFolder, read_json
from ..results.record import FAILURES, Record, SceneFacts
from ..results.schema import whole_record
from ..scene.catalogue import name_in
from ..scene.chosen_view import ChosenView
from ..scene.names import NAMES, TITLES
from ..scene.overrides import Lighting
from ..scene.readers.load import DECLARATION
from ..typed_json import WrongFieldError, checked
from .planning.planned_point import Options
from .source.closure import HARNESS, closure_hash

MAKING = tuple(f"{HARNESS}.scene.{name}" for name in ("catalogue", "facts", "overrides", "prepared"))
"""The modules that make scenes and their facts."""


def known_scene(folder: ResultsFolder, load: dict[str, Any]) -> dict[str, Any] | None:
    """The facts of a scene, if it was loaded before with the same options, source files and code; None, too, where its
    files cannot be read: the worker that is to make it says why."""
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
    """Remove the failures to make the scene of points whose scene has been made. ``made``: the keys of these points,
    and the labels of their methods."""
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
