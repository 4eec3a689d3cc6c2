"""Facts of scenes kept in a results folder, by what they were made from."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from ..files import write_atomic
from ..results.folder import ResultsFolder, read_json
from ..scene.catalogue import resolve


def known_scene(folder: ResultsFolder, load: dict[str, Any]) -> dict[str, Any] | None:
    """The facts of a scene loaded before with the same command, source files and code, or None."""
    return (read_json(folder.path / "scenes.json") or {}).get(_scene_id(load))


def learn_scene(folder: ResultsFolder, load: dict[str, Any], facts: dict[str, Any]) -> None:
    """Keep the facts of a scene, so that a finished run need not make it again."""
    path = folder.path / "scenes.json"
    with folder.writing():
        write_atomic(path, {**(read_json(path) or {}), _scene_id(load): facts})


def _scene_id(load: dict[str, Any]) -> str:
    here = Path(__file__).parents[1]
    code = hashlib.sha256(np.__version__.encode())
    for path in sorted((here / "scene").rglob("*.py")):
        code.update(path.read_bytes())
    source = resolve(load["scene"], load["scene_dir"]).source
    what = {key: load[key] for key in ("scene", "frames", "width", "height", "lighting")}
    return hashlib.sha256(f"{what} {source} {code.hexdigest()}".encode()).hexdigest()[:16]
