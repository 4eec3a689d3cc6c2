"""What comes of reading any file: a mesh that is one, or one line that names the file."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers.checks import Loaded
from shadowbench.harness.scene.scene import Scene
from shadowbench.harness.scene.views import view

from .fuzzed_inputs import READ, refusal
from .loaded_shapes import shape_of


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
