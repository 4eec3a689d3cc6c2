"""Facts of scenes kept in a results folder, by what they were made from."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from ..files import write_atomic
from ..results.folder import ResultsFolder, read_json
from ..scene.catalogue import resolve
from ..scene.declaration import SUFFIX
from ..scene.names import NAMES
from .source_closure import HARNESS, closure_hash

MAKING = tuple(f"{HARNESS}.scene.{name}" for name in ("catalogue", "facts", "overrides", "prepared"))
"""What makes any scene and says what it is."""


def known_scene(folder: ResultsFolder, load: dict[str, Any]) -> dict[str, Any] | None:
    """The facts of a scene loaded before with the same command, source files and code, or None."""
    return (read_json(folder.path / "scenes.json") or {}).get(_scene_id(load))


def learn_scene(folder: ResultsFolder, load: dict[str, Any], facts: dict[str, Any]) -> None:
    """Keep the facts of a scene, so that a finished run need not make it again."""
    path = folder.path / "scenes.json"
    with folder.writing():
        write_atomic(path, {**(read_json(path) or {}), _scene_id(load): facts})


def _scene_id(load: dict[str, Any]) -> str:
    """A hash of what a scene's facts follow from: its files, the size and lights asked for, and the code that makes it."""
    name, folder = load["scene"], load["scene_dir"]
    # A declared scene may take any stand-in's mesh.
    makers = [one for one in NAMES if name == one or Path(name).suffix.lower() == SUFFIX]
    code = closure_hash([*MAKING, *(f"{HARNESS}.scene.standins.{one}" for one in makers)])
    what = {key: load[key] for key in ("scene", "frames", "width", "height", "lighting")}
    text = f"{what} {resolve(name, folder).source} {code} {np.__version__}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]
