"""A cache of scene facts in a results folder."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from ..files import write_atomic
from ..results.folder import ResultsFolder, read_json
from ..results.record import SceneFacts
from ..scene.chosen_view import ChosenView
from ..scene.declaration import SUFFIX
from ..scene.names import NAMES
from ..typed_json import WrongFieldError, checked
from .source.closure import HARNESS, closure_hash

MAKING = tuple(f"{HARNESS}.scene.{name}" for name in ("catalogue", "facts", "overrides", "prepared"))
"""The modules that make scenes and their facts."""


def known_scene(folder: ResultsFolder, load: dict[str, Any]) -> dict[str, Any] | None:
    """The cached facts of a scene, if it was loaded before with the same options, source files and code; else None."""
    facts = (read_json(folder.path / "scenes.json") or {}).get(_scene_id(load))
    try:
        return checked(SceneFacts, facts)
    except WrongFieldError:  # none, or not what a worker told
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
    makers = [one for one in NAMES if name == one or Path(name).suffix.lower() == SUFFIX]
    code = closure_hash([*MAKING, *(f"{HARNESS}.scene.standins.{one}" for one in makers)])
    what = {key: load[key] for key in ("scene", "frames", "width", "height", "lighting", "view") if key in load}
    source = ChosenView.read(load.get("view")).resolved(name, folder).source
    text = f"{what} {source} {code} {np.__version__}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]
