"""Animations from files: numbered frames with the same connectivity, and ``.npz`` archives."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from ...errors import UserError
from .checks import ALL, Loaded, Mesh, Wanted, broken, checked, guarded

FRAME_SUFFIXES = (".ply", ".obj")
_NUMBERED = re.compile(r"^(.*?)[ _.-]?(\d+)$")
_NPZ_GROWTH, _NPZ_FLOOR = 16, 1 << 26
"""An archive may unpack to this many times its size, or to this many bytes, whichever is more; this stops zip bombs."""


def numbered(folder: Path, name: str | None = None) -> list[Path]:
    """The files ``name_001.ply name_002.ply ...`` of a folder, in the order of their numbers; may be empty.

    ``name`` None accepts any prefix. Raises :class:`UserError` if the folder has several prefixes or formats.
    """
    groups: dict[tuple[str, str], list[tuple[int, Path]]] = {}
    for entry in sorted(folder.iterdir()):
        match = _NUMBERED.match(entry.stem)
        suffix = entry.suffix.lower()
        if not match or suffix not in FRAME_SUFFIXES or not entry.is_file():
            continue
        if name is None or match[1].lower() == name.lower():
            groups.setdefault((match[1].lower(), suffix), []).append((int(match[2]), entry))
    if len(groups) > 1:
        found = ", ".join(f"{prefix}*{suffix}" for prefix, suffix in sorted(groups))
        raise UserError(f"{folder}: several numbered sequences ({found}); leave one of them in the folder")
    return [path for _, path in sorted(next(iter(groups.values())))] if groups else []


def load_frames(paths: list[Path], read: Callable[[Path], Mesh]) -> Loaded:
    """One frame per file. Raises :class:`UserError` if the connectivity of a file differs from that of the first."""
    first = read(paths[0])
    frames = [first.points]
    for path in paths[1:]:
        mesh = read(path)
        if mesh.points.shape != first.points.shape or not np.array_equal(mesh.faces, first.faces):
            problem = f"its faces or its number of vertices differ from those of {paths[0].name}"
            raise broken(path, problem, "all frames of a sequence need the same connectivity")
        frames.append(mesh.points)
    return Loaded(first.faces, tuple(frames), tuple(paths), first.up)


def load_npz(path: Path, wanted: Wanted = ALL) -> Loaded:
    """Arrays ``V``: float [frames, vertices, 3] or [vertices, 3], and ``F``: int [triangles, 3]; nothing pickled.

    Raises :class:`UserError` for other names, shapes or types, for indices out of range, and for an archive whose
    declared sizes do not match its contents.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such file; check the path")
    with guarded(path, ".npz"):
        _check_archive(path)
        with np.load(path, allow_pickle=False) as archive:
            missing = {"V", "F"} - set(archive.files)
            if missing:
                names = ", ".join(archive.files) or "nothing"
                raise broken(path, f"has no array {min(missing)!r} (found: {names})", "save V and F")
            vertices, faces = archive["V"], archive["F"]
    if vertices.dtype.kind != "f" or vertices.ndim not in (2, 3) or vertices.shape[-1] != 3:
        problem = f"V has shape {vertices.shape} and type {vertices.dtype}"
        raise broken(path, problem, "save V as floats [frames, vertices, 3]")
    if faces.dtype.kind not in "iu" or faces.ndim != 2 or faces.shape[1] != 3:
        raise broken(
            path, f"F has shape {faces.shape} and type {faces.dtype}", "save F as integers [triangles, 3]"
        )
    stack = vertices if vertices.ndim == 3 else vertices[None]
    if not len(stack):
        raise broken(path, "V has no frames")
    mesh = checked(path, stack[0], faces)
    frames = np.ascontiguousarray(stack, dtype=mesh.points.dtype)
    return Loaded(mesh.faces, tuple(frames[k] for k in wanted.chosen(path, len(frames))), (path,), None)


def _check_archive(path: Path) -> None:
    """Check the declared sizes of the members against each other and against the file, before unpacking anything."""
    limit = max(_NPZ_FLOOR, _NPZ_GROWTH * path.stat().st_size)
    with zipfile.ZipFile(path) as archive:
        if sum(info.file_size for info in archive.infolist()) > limit:
            raise broken(path, f"unpacks to more than {limit} bytes", "save it with np.savez instead")
        for info in archive.infolist():
            if info.filename not in ("V.npy", "F.npy"):
                continue
            with archive.open(info) as member:
                version = npy.read_magic(member)
                read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
                shape, _, dtype = read(member)
            claimed = int(np.prod([int(n) for n in shape], dtype=object)) * dtype.itemsize
            if dtype.hasobject or claimed > info.file_size:
                raise broken(path, f"{info.filename} declares {claimed} bytes, but has {info.file_size}")
