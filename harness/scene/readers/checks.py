"""Shared by all readers of scene files: what they are asked and return, errors, limits, and the final check."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import I32, Bools, Floats
from ...errors import UserError
from ...files import open_regular
from ...texts import numbered
from ..scene import Camera, Geometry, Light, Moves, Vector

MAX_LINE = 1 << 20  # longest line of a text file, bytes: no mesh has a longer one, and splitting it takes much memory

_LFS = b"version https://git-lfs.github.com/spec/"

MAX_TRIANGLES = 1 << 27  # largest number of triangles: the methods index corners with int32


SMALLEST, LARGEST = 1e-38, 1e37
"""Smallest extent of a mesh (unless it is a single point) and largest coordinate.

Below, the rounding bounds of the methods do not hold, because float32 numbers are multiples of 1.4e-45. Above, rays
from a camera outside the mesh overflow.
"""


@dataclass(frozen=True)
class Wanted:
    """What is asked of a file beyond its triangles.

    frames         first, last and step of its animation's frames, counted from 0, the last included; None: all. Their last
                   None: to the end
    allow_missing  whether a file that it refers to may be absent: what it would have held is left out, with a note
    rate           frames a second at which its animation is sampled; None: as the file says
    """

    frames: tuple[int, int | None, int] | None = None
    allow_missing: bool = False
    rate: float | None = None

    def chosen(self, path: Path, count: int) -> range:
        """The wanted ones of a file's ``count`` frames. Raises :class:`UserError` if one is not there."""
        if self.frames is None:
            return range(count)
        first, last, step = self.frames
        last = count - 1 if last is None else last
        if not 0 <= first <= last < count:
            has = f"frames 0 to {count - 1}" if count > 1 else "one frame, 0"
            raise UserError(f"{path}: has {has}; --frames {self.text()} asks for others")
        return range(first, last + 1, step)

    def rate_of(self, chosen: range) -> float | None:
        """The rate of :meth:`chosen` frames of an animation whose file does not say its rate; None for one frame."""
        return self.rate / chosen.step if self.rate and len(chosen) > 1 else None

    def text(self) -> str:
        """The wanted frames as on the command line; "" for all."""
        if self.frames is None:
            return ""
        first, last, step = self.frames
        return f"{first}:{'' if last is None else last}:{step}"

    def facts(self) -> dict[str, Any]:
        """What is asked for, as JSON types; {} for nothing."""
        given = {"frames": self.text(), "allow_missing": self.allow_missing, "rate": self.rate}
        return {name: value for name, value in given.items() if value}

    @staticmethod
    def read(facts: Mapping[str, Any]) -> Wanted:
        """What has these :meth:`facts`."""
        return Wanted(frames_of(facts.get("frames")), bool(facts.get("allow_missing")), facts.get("rate"))


ALL = Wanted()  # every frame, and every file that is referred to


def frames_of(text: str | None) -> tuple[int, int | None, int] | None:
    """First, last and step of ``A:B:STEP``, of which each may be empty. Raises :class:`UserError` for other texts."""
    if text is None:
        return None
    match = re.fullmatch(r"(\d*):(\d*)(?::(\d*))?", text.strip())
    first, last, step = (int(x) if x else None for x in match.groups()) if match else (None, None, 0)
    if step == 0 or (last is not None and last < (first or 0)):
        way_out = "write A:B:STEP, the first frame, the last and the step, as in 0:90:10 or 5:"
        raise UserError(f"--frames {text!r}: {way_out}")
    return first or 0, last, step or 1


@dataclass(frozen=True, eq=False)
class Loaded:
    """A file, or a sequence of files with the same connectivity.

    faces     int32 [triangle_count, 3], in the order of the file
    frames    positions of each frame, float32 or float64 [vertex_count, 3], as stored, nothing merged or dropped; may hold
              NaN
    files     every file read: those of the frames in their order, then what these refer to: layers, buffers. All count in
              the record's key. A reader of one file leaves out that file
    up        the up direction that the file declares, or None
    rate      how many frames a second has, or None
    notes     what was left out or approximated, a clause each: "2 skins read in their rest pose"
    cameras   the cameras that the file holds, by name
    lights    the lights that the file holds, by name
    sequence  whether each frame has a file of its own
    bodies    which triangles move together, where the file says it (:class:`..scene.Moves`), or None
    """

    faces: I32
    frames: tuple[Floats, ...]
    files: tuple[Path, ...] = ()
    up: Vector | None = None
    rate: float | None = None
    notes: tuple[str, ...] = ()
    cameras: dict[str, Camera] = field(default_factory=dict)
    lights: dict[str, Light] = field(default_factory=dict)
    sequence: bool = False
    bodies: I32 | None = None

    def geometry(self) -> Geometry:
        """The mesh over time."""
        motion = None if self.bodies is None else Moves("rigid", bodies=self.bodies)
        return Geometry(self.faces, lambda k: self.frames[k], len(self.frames), motion)


def broken(path: Path, problem: str, way_out: str = "export the file again") -> UserError:
    """The error for an unusable file: one line with the file, the problem and what to do."""
    line = " ".join(f"{path}: {problem}; {way_out}".split())
    return UserError(line if len(line) <= 400 else line[:397] + "...")


def some(names: Sequence[str], most: int = 3) -> str:
    """The first ``most`` names and how many more there are: "a, b, c and 2 more"."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


@contextmanager
def guarded(path: Path, what: str) -> Iterator[None]:
    """Turn any error of another library into a :class:`UserError` that names the file."""
    try:
        yield
    except UserError:
        raise
    except Exception as error:
        detail = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise broken(path, f"not a readable {what} file ({detail[:160]})") from error


def read_bytes(path: Path, most: int = -1) -> bytes:
    """The contents of a file, or ``most`` of its first bytes. Raises :class:`UserError` if it is missing, no regular
    file, unreadable or a Git LFS pointer.
    """
    try:
        with open_regular(path) as stream:
            blob = stream.read(most)
    except FileNotFoundError:
        raise UserError(f"{path}: no such file; check the path") from None
    except OSError as error:
        raise UserError(
            f"{path}: cannot be read ({error.strerror or error}); check the path and its permissions"
        ) from None
    refuse_pointer(path, blob)
    return blob


def refuse_pointer(path: Path, blob: bytes) -> None:
    """Raise :class:`UserError` for the contents of a Git LFS pointer."""
    if blob.startswith(_LFS):
        raise broken(path, "is a Git LFS pointer, not the file that it stands for", "fetch that with git lfs pull")


def within_range(loaded: Loaded) -> None:
    """Raise :class:`UserError` if the used vertices exceed :data:`LARGEST` or extend less than :data:`SMALLEST`. It
    names the file of the frame where each has one. Vertices that are NaN or infinite in the file are ignored: their
    triangles are never hit.
    """
    used = np.unique(loaded.faces)
    way_out = f"scale it to coordinates between {SMALLEST:g} and {LARGEST:g}"
    for k, points in enumerate(loaded.frames):
        points = points[used].astype(np.float64)
        finite = points[np.isfinite(points).all(axis=1)]
        if not len(finite):
            continue
        path = loaded.files[k if loaded.sequence else 0]
        most = np.abs(finite).max()
        if most > LARGEST:
            raise broken(path, f"has coordinates of {most:.3g}, too large for float32 rays", way_out)
        extent = np.ptp(finite, axis=0).max()
        if 0.0 < extent < SMALLEST:
            raise broken(path, f"has an extent of only {extent:.3g}, too small for float32", way_out)


def not_finite(loaded: Loaded) -> tuple[str, ...]:
    """A note on the first frame in which corners of triangles are NaN or infinite, with the number of these triangles."""
    for k, points in enumerate(loaded.frames):
        finite: Bools = np.all(np.isfinite(points), axis=1)
        if not finite.all() and (count := int((~finite[loaded.faces]).any(axis=1).sum())):
            where = f"frame {k}: " if len(loaded.frames) > 1 else ""
            return (f"{where}{numbered(count, 'triangle')} with a corner that is NaN or infinite, which no ray hits",)
    return ()


def checked(
    path: Path, points: NDArray, faces: NDArray, up: Vector | None = None, notes: tuple[str, ...] = ()
) -> Loaded:
    """The mesh of one frame, after checking that every index is in range and there is a triangle.

    points, faces  floats [vertex_count, 3] and whole numbers [triangle_count, 3], of any size
    """
    if not len(faces):
        raise broken(path, "holds no triangles", "give a triangle mesh")
    if len(faces) > MAX_TRIANGLES:
        raise broken(path, f"{len(faces)} triangles are more than the {MAX_TRIANGLES} that can be indexed", "split it")
    low, high = int(faces.min()), int(faces.max())
    if low < 0 or high >= len(points):
        problem = f"a face names vertex {high if high >= len(points) else low} (from 0), but there are {len(points)}"
        raise broken(path, problem, "correct the file or export it again")
    kind = {2: np.float32, 4: np.float32}.get(points.dtype.itemsize, np.float64)
    return Loaded(np.ascontiguousarray(faces, np.int32), (np.ascontiguousarray(points, kind),), up=up, notes=notes)
