"""What comes of reading any file: a mesh that is one, or one line that names the file."""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers.checks import Loaded
from shadowbench.harness.scene.readers.load import load
from shadowbench.harness.scene.scene import Scene
from shadowbench.harness.scene.views import view

from .fuzzed_inputs import READ, refusal
from .mesh_files import shape_of, traced_memory

ROOM = 1 << 19
"""What a reader may hold beside ten times the file: its own tables and buffers, whatever the file."""


def within_memory(path: Path) -> Loaded:
    """Load a file in this process, where warnings are errors and memory is counted."""
    limit = 10 * path.stat().st_size + ROOM
    for _ in range(2):  # again: what a first call imports for damage of this kind is not the file's
        with traced_memory() as most, warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            try:
                found = load(path)
            except UserError as error:
                found = error
            peak = most()
        if peak <= limit:
            break
    assert peak <= limit, f"{peak} bytes for a file of {path.stat().st_size}"
    if isinstance(found, UserError):
        raise found
    return found


def outcome(path: Path, read: Callable[[Path], Loaded]) -> str:
    """What comes of reading a file; a mesh must be valid, and a camera must find it.

    Raises whatever is no :class:`UserError`, and AssertionError for a line or a mesh that is none.
    """
    try:
        loaded = read(path)
    except UserError as error:
        if path.name not in str(error) or "pxrInternal" in str(error):
            raise AssertionError(str(error)) from error
        return refusal(error)
    assert len(loaded.faces)
    for frame in loaded.frames:
        assert frame.shape == loaded.frames[0].shape
        assert 0 <= loaded.faces.min() <= loaded.faces.max() < len(frame)
    camera, lights = view(shape_of(loaded))
    moment = prepare(Scene("fuzz", "Fuzz", loaded.geometry, camera, lights)).moment(0, 2, 2)
    assert np.isfinite(moment.eye).all()
    assert np.isfinite(moment.lights).all()
    return READ
