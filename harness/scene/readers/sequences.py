"""Animations from files: a sequence with one frame in each, and ``.npz`` archives."""

import glob
import itertools
import math
import re
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import replace
from os.path import exists, isfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ...errors import UserError
from .checks import ALL, Loaded, Wanted, broken, checked, guarded, read_bytes
from .polygons import fixed_topology

_NUMBERED = re.compile(r"^(.*?)[ _.-]?(\d+)$")
_PLACE = re.compile(r"(%0?\d*d|\*|\?)")  # what stands for a number or for other letters in the name of a sequence
_NPZ_GROWTH, _NPZ_FLOOR = 16, 1 << 26  # times its size, or bytes, that an archive may unpack to: stops zip bombs


def is_pattern(text: str) -> bool:
    """Whether a name stands for several files: ``frames/%04d.ply``, ``frames/*.ply``."""
    return _PLACE.search(text) is not None and not exists(text)


def plain_name(pattern: str) -> str:
    """What a pattern is called: its file name without what stands for numbers, else its folder."""
    path = Path(pattern)
    return _PLACE.sub("", path.stem).strip(" _.-") or _PLACE.sub("", path.absolute().parent.name)


def matching(pattern: str, suffixes: Iterable[str]) -> list[Path]:
    """The files that a pattern stands for, in the order of the numbers in their names. ``%d`` is a number, ``%04d`` one
    of at least 4 digits, ``*`` any letters of a name and ``?`` one. Raises :class:`UserError` if there are none, or if
    they have several formats or one that is not among ``suffixes``.
    """
    words = _PLACE.split(pattern)
    rule, shape = re.escape(words[0]), glob.escape(words[0])
    for place, after in zip(words[1::2], words[2::2], strict=True):
        digits = rf"\d{{{int(place.strip('%d*?') or 1) or 1},}}"
        rule += {"*": "[^/]*", "?": "[^/]"}.get(place, digits) + re.escape(after)
        shape += "*" + glob.escape(after)
    found = [Path(name) for name in glob.glob(shape) if re.fullmatch(rule, name) and isfile(name)]
    if not found:
        raise UserError(f"{pattern}: no file matches; check the path")
    files = _in_order(pattern, [(_natural(path), path) for path in found])
    kinds = sorted({path.suffix.lower() for path in files})
    if len(kinds) > 1 or kinds[0] not in suffixes:
        formats = " and ".join(kinds)
        raise UserError(f"{pattern}: matches {formats} files; give a pattern of one format that can be read")
    return files


def _in_order(where: Path | str, files: list[tuple[Any, Path]]) -> list[Path]:
    """Files in the order of their numbers. Raises :class:`UserError` for two of one number."""
    files.sort()
    for (number, first), (other, second) in itertools.pairwise(files):
        if number == other:
            raise UserError(f"{where}: {first.name} and {second.name} have one number; remove one of them")
    return [path for _, path in files]


def _natural(path: Path) -> list[tuple[int, str]]:
    words = re.findall(r"\d+|\D+", path.as_posix())
    return [(int(word), "") if word[0].isdigit() else (-1, word) for word in words]


def numbered(folder: Path, suffixes: Iterable[str], name: str | None = None) -> list[Path]:
    """The files ``name_001.ply name_002.ply ...`` of a folder, in the order of their numbers; may be empty. ``name``
    None accepts any prefix. Raises :class:`UserError` if the folder has several prefixes or formats, or two files of
    one number.
    """
    known = set(suffixes)
    groups: dict[tuple[str, str], list[tuple[int, Path]]] = {}
    for entry in sorted(folder.iterdir()):
        match, suffix = _NUMBERED.match(entry.stem), entry.suffix.lower()
        if match and suffix in known and entry.is_file() and name in (None, match[1].lower()):
            groups.setdefault((match[1].lower(), suffix), []).append((int(match[2]), entry))
    if len(groups) > 1:
        found = ", ".join(f"{prefix}*{suffix}" for prefix, suffix in sorted(groups))
        raise UserError(f"{folder}: several numbered sequences ({found}); leave one of them in the folder")
    return _in_order(folder, next(iter(groups.values()), []))


def joined(paths: list[Path], meshes: list[Loaded], rate: float | None = None) -> Loaded:
    """One mesh of the meshes of files, each of which is a frame. Where the connectivity changes, each triangle has vertices
    of its own, and those that a frame has not have NaN positions (:mod:`.polygons`); a note says so.
    """
    fixed = fixed_topology([[(mesh.frames[0], mesh.faces)] for mesh in meshes])
    notes = [note for mesh in meshes for note in mesh.notes]
    if fixed.padded:
        counts = [len(mesh.faces) for mesh in meshes]
        notes.append(f"the connectivity changes: {min(counts):,} to {max(counts):,} triangles, which vanish and appear")
    notes += _uneven(paths)
    files = dict.fromkeys([*paths, *(file for mesh in meshes for file in mesh.files)])
    return replace(
        meshes[0], faces=fixed.faces, frames=fixed.frames, files=tuple(files), rate=rate,
        notes=tuple(dict.fromkeys(notes)), sequence=True,
    )  # fmt: skip


def _uneven(paths: Sequence[Path]) -> list[str]:
    """A note if numbers are missing from the names of a sequence."""
    found = [re.findall(r"\d+", path.stem) for path in paths]
    numbers = [int(words[-1]) for words in found if words]
    steps = np.diff(numbers)
    if len(numbers) < len(found) or not len(steps) or steps.min() == steps.max():
        return []
    at = int(steps.argmax())
    return [f"the numbers of its files are not evenly spaced: {numbers[at]} is followed by {numbers[at + 1]}"]


def load_npz(path: Path, wanted: Wanted = ALL) -> Loaded:
    """Arrays ``V``: float [frames, vertices, 3] or [vertices, 3], and ``F``: int [triangles, 3]; nothing pickled.
    Raises :class:`UserError` for other names, shapes or types, for indices out of range, and for an archive whose
    declared sizes do not match its contents.
    """
    read_bytes(path, 1024)  # missing and unreadable files get the same message as in every other format
    limit = max(_NPZ_FLOOR, _NPZ_GROWTH * path.stat().st_size)
    with guarded(path, ".npz"), zipfile.ZipFile(path) as archive:
        if sum(info.file_size for info in archive.infolist()) > limit:
            raise broken(path, f"unpacks to more than {limit} bytes", "save it with np.savez instead")
        names = [name.removesuffix(".npy") for name in archive.namelist()]
        missing = {"V", "F"}.difference(names)
        if missing:
            found = ", ".join(names) or "nothing"
            raise broken(path, f"has no array {min(missing)!r} (found: {found})", "save V and F")
        stack, faces = (_array(path, archive, f"{name}.npy") for name in "VF")
    if stack.dtype.kind != "f" or stack.ndim not in (2, 3) or stack.shape[-1] != 3:
        problem = f"V has shape {stack.shape} and type {stack.dtype}"
        raise broken(path, problem, "save V as floats [frames, vertices, 3]")
    if faces.dtype.kind not in "iu" or faces.ndim != 2 or faces.shape[1] != 3:
        raise broken(path, f"F has shape {faces.shape} and type {faces.dtype}", "save F as integers [triangles, 3]")
    stack = stack if stack.ndim == 3 else stack[None]
    if not len(stack):
        raise broken(path, "V has no frames")
    mesh = checked(path, stack[0], faces)
    frames = np.ascontiguousarray(stack, dtype=mesh.frames[0].dtype)
    chosen = wanted.chosen(path, len(frames))
    return Loaded(mesh.faces, tuple(frames[k] for k in chosen), (path,), rate=wanted.rate_of(chosen))


def _array(path: Path, archive: zipfile.ZipFile, name: str) -> NDArray:
    """An array of an archive, after checking that its declared size is in it."""
    with archive.open(name) as member:
        read_header = npy.read_array_header_1_0 if npy.read_magic(member) == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read_header(member)
    claimed, there = math.prod(shape) * dtype.itemsize, archive.getinfo(name).file_size
    if dtype.hasobject or claimed > there:
        raise broken(path, f"{name} declares {claimed} bytes, but has {there}")
    with archive.open(name) as member:
        return npy.read_array(member, allow_pickle=False)
