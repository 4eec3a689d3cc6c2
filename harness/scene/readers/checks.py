"""Shared by all readers of scene files: errors, limits, triangulation of polygons, and the final check."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import UserError
from ...files import read_regular
from ..scene import Camera, Geometry, Light, Vector

MAX_LINE = 1 << 20
"""Longest line of a text file, bytes. A longer line is not part of a mesh, and splitting it takes much memory."""

_FAN_BLOCK = 1 << 16
"""Corners that are triangulated at a time."""

MAX_TRIANGLES = 1 << 27
"""Largest number of triangles: the methods index corners with int32."""


SMALLEST, LARGEST = 1e-38, 1e37
"""Smallest extent of a mesh (unless it is a single point) and largest coordinate.

Below, the rounding bounds of the methods do not hold, because float32 numbers are multiples of 1.4e-45. Above, rays
from a camera outside the mesh overflow.
"""


@dataclass(frozen=True, eq=False)
class Mesh:
    """What a reader returns for one file.

    points   float32 or float64 [vertex_count, 3], as stored, nothing merged or dropped; may hold NaN
    faces    int32 [triangle_count, 3], in the order of the file
    up       the up direction that the file declares, or None
    later    positions [vertex_count, 3] of each further frame of the file's own animation; ``points`` are the first
    rate     frames a second of that animation, or None
    files    every file that was read beside the one that was named: layers, buffers, images
    notes    what was left out or approximated, a clause each: "2 skins read in their rest pose"
    cameras  the cameras that the file holds, by name
    lights   the lights that the file holds, by name
    """

    points: NDArray[np.floating]
    faces: NDArray[np.int32]
    up: Vector | None = None
    later: tuple[NDArray[np.floating], ...] = ()
    rate: float | None = None
    files: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()
    cameras: dict[str, Camera] = field(default_factory=dict)
    lights: dict[str, Light] = field(default_factory=dict)


@dataclass(frozen=True)
class Wanted:
    """What is asked of a file beyond its triangles.

    frames         first, last and step of its animation's frames, counted from 0; None: all
    allow_missing  whether a file that it refers to may be absent: what it would have held is left out, with a note
    """

    frames: tuple[int, int | None, int] | None = None
    allow_missing: bool = False


@dataclass(frozen=True, eq=False)
class Loaded:
    """A file, or a sequence of files with the same connectivity.

    frames   one array of positions [vertex_count, 3] per frame
    files    every file read: those of the frames in their order, then what these refer to. All count in the record's key
    up, rate, notes, cameras, lights   as in :class:`Mesh`
    """

    faces: NDArray[np.int32]
    frames: tuple[NDArray[np.floating], ...]
    files: tuple[Path, ...]
    up: Vector | None = None
    rate: float | None = None
    notes: tuple[str, ...] = ()
    cameras: dict[str, Camera] = field(default_factory=dict)
    lights: dict[str, Light] = field(default_factory=dict)

    def geometry(self) -> Geometry:
        """The mesh over time."""
        return Geometry(self.faces, lambda k: self.frames[k], len(self.frames))


def broken(path: Path, problem: str, way_out: str = "export the file again") -> UserError:
    """The error for an unusable file: one line with the file, the problem and what to do."""
    line = " ".join(f"{path}: {problem}; {way_out}".split())
    return UserError(line if len(line) <= 400 else line[:397] + "...")


@contextmanager
def guarded(path: Path, what: str) -> Iterator[None]:
    """Turn any error of another library into a :class:`UserError` that names the file; silence trimesh's log."""
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
    """Whether the path exists; False for an invalid file name."""
    try:
        return path.exists()
    except (OSError, ValueError):  # the name is too long or invalid
        return False


def is_file(path: Path) -> bool:
    """Whether the path is a file; False for a cycle of links."""
    try:
        return path.is_file()
    except (OSError, RuntimeError, ValueError):
        return False


def read_bytes(path: Path) -> bytes:
    """The contents of a file. Raises :class:`UserError` if it is missing, no regular file, or unreadable."""
    try:
        return read_regular(path)
    except FileNotFoundError:
        raise UserError(f"{path}: no such file; check the path") from None
    except OSError as error:
        raise UserError(
            f"{path}: cannot be read ({error.strerror or error}); check the path and its permissions"
        ) from None


def within_range(loaded: Loaded) -> None:
    """Raise :class:`UserError` if the used vertices exceed :data:`LARGEST` or extend less than :data:`SMALLEST`.

    Vertices that are NaN or infinite in the file are ignored: their triangles are never hit.
    """
    used = np.unique(loaded.faces)
    way_out = f"scale it to coordinates between {SMALLEST:g} and {LARGEST:g}"
    for k, points in enumerate(loaded.frames):
        points = points[used].astype(np.float64)
        finite = points[np.isfinite(points).all(axis=1)]
        if not len(finite):
            continue
        path = loaded.files[min(k, len(loaded.files) - 1)]
        most = np.abs(finite).max()
        if most > LARGEST:
            raise broken(path, f"has coordinates of {most:.3g}, too large for float32 rays", way_out)
        extent = np.ptp(finite, axis=0).max()
        if 0.0 < extent < SMALLEST:
            raise broken(path, f"has an extent of only {extent:.3g}, too small for float32", way_out)


def fan(counts: NDArray[np.integer], corners: NDArray[np.integer]) -> NDArray[np.int32]:
    """Triangulate polygons as fans about their first corner, in order. int32 [sum(counts - 2), 3].

    ``counts``: number of corners of each polygon, at least 3. ``corners``: the vertex indices of all polygons
    concatenated, below 2^31. It works in blocks and needs little memory beside its result.
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
    """Raise :class:`UserError` if a polygon has fewer than 3 corners. Dropping it would shift the triangle indices."""
    small = np.flatnonzero(np.asarray(counts) < 3)
    if len(small):
        raise broken(
            path, f"face {small[0]} has {counts[small[0]]} vertices", "a face needs at least 3: remove it"
        )


def checked(path: Path, points: NDArray, faces: NDArray, up: Vector | None = None) -> Mesh:
    """The mesh, after checking that shapes and types fit, every index is in range and there is a triangle."""
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
            path,
            f"a face names vertex {bad} (from 0), but there are {len(points)}",
            "correct the file or export it again",
        )
    native = points.astype(points.dtype.newbyteorder("="), copy=False)
    return Mesh(np.ascontiguousarray(native), np.ascontiguousarray(faces, dtype=np.int32), up)
