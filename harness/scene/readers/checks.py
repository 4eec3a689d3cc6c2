"""What every reader of scene files shares: one kind of error, limits, fan triangulation, the last check."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import UserError
from ..scene import Geometry, Vector

MAX_LINE = 1 << 20
"""Bytes a line of a text file may have; a longer one is not a mesh and would cost many times its size to
split.
"""

_FAN_BLOCK = 1 << 16
"""Corners that are made into fans at a time."""

MAX_TRIANGLES = 1 << 27
"""Triangles a scene may have: the methods index corners with int32."""


SMALLEST, LARGEST = 1e-38, 1e37
"""What a mesh must extend at least, unless it is one point, and what none of its coordinates may exceed.

Beyond, float32 has too few bits left for what the methods' rounding bounds assume (it rounds what is small to
multiples of 1.4e-45), or rays from a camera beside the mesh overflow.
"""


@dataclass(frozen=True, eq=False)
class Mesh:
    """What a reader returns for one file.

    points  float32 or float64 [vertex_count, 3], as stored: nothing merged, nothing dropped; may hold NaN
    faces   int32 [triangle_count, 3], in the order of the file; polygons as fans (0, i, i + 1)
    up      the direction that the file declares as up, or None where it declares none
    """

    points: NDArray[np.floating]
    faces: NDArray[np.int32]
    up: Vector | None = None


@dataclass(frozen=True, eq=False)
class Loaded:
    """A file, or a sequence of files with the same connectivity.

    frames  one array of positions [vertex_count, 3] a frame
    files   what was read, in frame order (one file for an ``.npz``)
    """

    faces: NDArray[np.int32]
    frames: tuple[NDArray[np.floating], ...]
    files: tuple[Path, ...]
    up: Vector | None = None
    notes: str = field(default="")

    def geometry(self) -> Geometry:
        """The mesh over time."""
        return Geometry(self.faces, lambda k: self.frames[k], len(self.frames))


def broken(path: Path, problem: str, way_out: str = "export the file again") -> UserError:
    """The error for a file that cannot be used: one line that names file, problem and way out."""
    line = " ".join(f"{path}: {problem}; {way_out}".split())
    return UserError(line if len(line) <= 400 else line[:397] + "...")


@contextmanager
def guarded(path: Path, what: str) -> Iterator[None]:
    """Turn whatever another library raises into a :class:`UserError` that names the file; trimesh logs nothing."""
    log = logging.getLogger("trimesh")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    except UserError:
        raise
    except Exception as error:
        detail = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise broken(path, f"not a readable {what} file ({detail[:160]})") from error
    finally:
        log.setLevel(level)


def exists(path: Path) -> bool:
    """Whether something is there; no error for what no file could be called."""
    try:
        return path.exists()
    except (OSError, ValueError):  # too long, or no file name at all
        return False


def is_file(path: Path) -> bool:
    """Whether a file is there; a link that leads back to itself is none."""
    try:
        return path.is_file()
    except (OSError, RuntimeError, ValueError):
        return False


def read_bytes(path: Path) -> bytes:
    """The whole file. Raises :class:`UserError` where it is missing, a folder or unreadable."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise UserError(f"{path}: no such file; check the path") from None
    except OSError as error:
        raise UserError(
            f"{path}: cannot be read ({error.strerror or error}); check the path and its rights"
        ) from None


def within_range(loaded: Loaded) -> None:
    """Raise :class:`UserError` where vertices that faces use lie outside :data:`SMALLEST` to :data:`LARGEST`.

    What float32 holds as infinite, or is not a number, does not count: such triangles are never hit.
    """
    used = np.unique(loaded.faces)
    way_out = f"scale it to coordinates between {SMALLEST:g} and {LARGEST:g}"
    for k, points in enumerate(loaded.frames):
        points = points[used].astype(np.float64)
        finite = points[(np.abs(points) <= np.finfo(np.float32).max).all(axis=1)]
        if not len(finite):
            continue
        path = loaded.files[min(k, len(loaded.files) - 1)]
        most, extent = np.abs(finite).max(), np.ptp(finite, axis=0).max()
        if most > LARGEST:
            raise broken(path, f"has coordinates of {most:.3g}, too large for float32 rays", way_out)
        if 0.0 < extent < SMALLEST:
            raise broken(path, f"extends {extent:.3g} only, too little for float32", way_out)


def fan(counts: NDArray[np.integer], corners: NDArray[np.integer]) -> NDArray[np.int32]:
    """Triangles of polygons, each a fan about its first corner, in order. int32 [sum(counts - 2), 3].

    ``counts``: corners of each polygon, at least 3. ``corners``: their vertex indices one after another, below
    2^31. Works in blocks, so that it needs little more than its result.
    """
    if (counts == 3).all():
        return corners.astype(np.int32, copy=False).reshape(-1, 3)
    result = np.empty((int(counts.sum()) - 2 * len(counts), 3), dtype=np.int32)
    ends = np.cumsum(counts, dtype=np.int64)
    polygon, corner, triangle = 0, 0, 0
    while polygon < len(counts):
        last = max(polygon + 1, int(np.searchsorted(ends, corner + _FAN_BLOCK, side="right")))
        block = corners[corner : ends[last - 1]]
        each = counts[polygon:last].astype(np.int64)
        start = np.repeat(np.cumsum(each) - each, each - 2)
        before = np.repeat(np.cumsum(each - 2) - (each - 2), each - 2)
        second = start + (np.arange(len(start)) - before) + 1
        part = result[triangle : triangle + len(start)]
        part[:, 0], part[:, 1], part[:, 2] = block[start], block[second], block[second + 1]
        polygon, corner, triangle = last, int(ends[last - 1]), triangle + len(start)
    return result


def polygon_sizes(path: Path, counts: NDArray[np.integer]) -> None:
    """Raise :class:`UserError` where a polygon has fewer than 3 corners: dropping it would shift all
    indices.
    """
    small = np.flatnonzero(np.asarray(counts) < 3)
    if len(small):
        raise broken(
            path, f"face {small[0]} has {counts[small[0]]} vertices", "a face needs at least 3: remove it"
        )


def checked(path: Path, points: NDArray, faces: NDArray, up: Vector | None = None) -> Mesh:
    """The mesh, after the last check: shapes, at least one triangle, every index in range."""
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind != "f":
        raise broken(
            path, f"positions have shape {points.shape} and type {points.dtype}, not [vertices, 3] floats"
        )
    if points.dtype.itemsize not in (4, 8):
        points = points.astype(np.float32 if points.dtype.itemsize < 4 else np.float64)
    faces = np.asarray(faces).reshape(-1, 3)
    if not len(faces):
        raise broken(path, "holds no triangles", "give a triangle mesh")
    if len(faces) > MAX_TRIANGLES:
        raise broken(
            path, f"{len(faces)} triangles are more than the {MAX_TRIANGLES} that can be indexed", "split it"
        )
    low, high = int(faces.min()), int(faces.max())
    if low < 0 or high >= len(points):
        bad = high if high >= len(points) else low
        raise broken(
            path, f"a face names vertex {bad} (from 0), but there are {len(points)}", "mend or export again"
        )
    native = points.astype(points.dtype.newbyteorder("="), copy=False)
    return Mesh(np.ascontiguousarray(native), np.ascontiguousarray(faces, dtype=np.int32), up)
