"""A prepared scene handed from one process to others, so that its mesh is made once: the same bytes for everyone."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import UserError
from ..files import write_arrays
from .alpha import arrays_of, from_arrays
from .moment import F32
from .prepared import Prepared
from .scene import Geometry, Scene


def store(path: Path, prepared: Prepared, frames: Iterable[int]) -> None:
    """Keep a prepared scene and the positions of some of its frames in one .npz file, written atomically.

    The first frame is always kept: trees that are refitted are built there. Its positions are kept as they are, too:
    rules that choose triangles (:mod:`.scene.surface_rules`) look at it, and must choose alike in every process.
    """
    arrays: dict[str, NDArray] = {
        "faces": prepared.faces,
        "weld": prepared.weld,
        "centre": prepared.centre,
        "middle": prepared.middle,
        "numbers": np.array([prepared.radius, prepared.frame_count]),
        "first": np.asarray(prepared.geometry.positions(0), dtype=np.float64).reshape(-1, 3),
    }
    arrays |= arrays_of(prepared.alpha)
    if prepared.scene.mirror is not None:
        arrays["mirror"] = prepared.mirror
    for frame in sorted({0, *frames}):
        arrays[f"points_{frame}"], arrays[f"valid_{frame}"] = prepared.points(frame)
    write_arrays(path, arrays, compressed=False)


class Stored(Prepared):
    """A prepared scene read back. It has the frames that were stored, and raises :class:`UserError` for others.

    Positions of frames after the first are those of float32.
    """

    def __init__(self, path: Path, scene: Scene):
        with np.load(path) as kept:
            arrays = {name: kept[name] for name in kept.files}
        self.scene = scene
        self.faces = arrays["faces"]
        self.weld = arrays["weld"]
        self.centre = arrays["centre"]
        self.middle = arrays["middle"]
        self.radius = float(arrays["numbers"][0])
        self.alpha = from_arrays(arrays)
        if "mirror" in arrays:
            self.mirror = arrays["mirror"]
        self._frames = {
            int(name.split("_")[1]): (arrays[name], arrays[name.replace("points", "valid")])
            for name in arrays
            if name.startswith("points_")
        }
        self._first = arrays["first"]
        self.geometry = Geometry(self.faces, self._positions, int(arrays["numbers"][1]))
        self._cache = None

    def _positions(self, frame: int) -> NDArray[np.float64]:
        return self._first if frame == 0 else self.points(frame)[0].astype(np.float64) + self.centre

    def points(self, frame: int) -> tuple[F32, NDArray[np.uint8]]:
        """Float32 positions and validity flags, as they were stored."""
        if frame not in self._frames:
            raise UserError(
                f"{self.scene.name}: frame {frame} was not stored; there are {sorted(self._frames)}"
            )
        return self._frames[frame]
