"""Animations from files: a sequence with one frame in each, and ``.npz`` archives."""

import glob
import itertools
import re
import zipfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from ...errors import UserError
from .checks import ALL, Loaded, Wanted, broken, checked, exists, guarded, is_file, read_bytes
from .topology import fixed_topology

_NUMBERED = re.compile(r"^(.*?)[ _.-]?(\d+)$")
_PLACE = re.compile(r"%0?(\d*)d|\*|\?")
"""What stands for a number or for other letters in the name of a sequence."""

_NPZ_GROWTH, _NPZ_FLOOR = 16, 1 << 26
"""An archive may unpack to this many times its size, or to this many bytes, whichever is more; this stops zip bombs."""


def is_pattern(text: str) -> bool:
    """Whether a name stands for several files: ``frames/%04d.ply``, ``frames/*.ply``."""
    return _PLACE.search(text) is not None and not exists(Path(text))


def plain_name(pattern: str) -> str:
    """What a pattern is called: its file name without what stands for numbers, else its folder."""
    path = Path(pattern)
    return _PLACE.sub("", path.stem).strip(" _.-") or _PLACE.sub("", path.absolute().parent.name)


def matching(pattern: str, suffixes: Iterable[str]) -> list[Path]:
    """The files that a pattern stands for, in the order of the numbers in their names.

    ``%d`` is a number, ``%04d`` one of at least 4 digits, ``*`` any letters of a name and ``?`` one. Raises
    :class:`UserError` if there are none, or if they have several formats or one that is not among ``suffixes``.
    """
    rule, shape, at = "", "", 0
    for place in _PLACE.finditer(pattern):
        between = pattern[at : place.start()]
        letters = {"*": "[^/]*", "?": "[^/]"}.get(place[0], rf"\d{{{int(place[1] or 1)},}}")
        rule, shape, at = rule + re.escape(between) + letters, shape + glob.escape(between) + "*", place.end()
    rule, shape = rule + re.escape(pattern[at:]), shape + glob.escape(pattern[at:])
    found = [Path(name) for name in glob.glob(shape) if re.fullmatch(rule, name)]
    files = sorted((path for path in found if is_file(path)), key=_natural)
    if not files:
        raise UserError(f"{pattern}: no file matches; check the path")
    for first, second in itertools.pairwise(files):
        if _natural(first) == _natural(second):
            raise _one_number(pattern, first, second)
    kinds = sorted({path.suffix.lower() for path in files})
    if len(kinds) > 1 or kinds[0] not in suffixes:
        formats = " and ".join(kinds)
        raise UserError(f"{pattern}: matches {formats} files; give a pattern of one format that can be read")
    return files


def _natural(path: Path) -> list[tuple[int, str]]:
    """A key that sorts names by the numbers in them."""
    words = re.findall(r"\d+|\D+", path.as_posix())
    return [(int(word), "") if word[0].isdigit() else (-1, word) for word in words]


def numbered(folder: Path, suffixes: Iterable[str], name: str | None = None) -> list[Path]:
    """The files ``name_001.ply name_002.ply ...`` of a folder, in the order of their numbers; may be empty.

    ``name`` None accepts any prefix. Raises :class:`UserError` if the folder has several prefixes or formats, or two files
    of one number.
    """
    known = set(suffixes)
    groups: dict[tuple[str, str], list[tuple[int, Path]]] = {}
    for entry in sorted(folder.iterdir()):
        match = _NUMBERED.match(entry.stem)
        suffix = entry.suffix.lower()
        if not match or suffix not in known or not entry.is_file():
            continue
        if name is None or match[1].lower() == name.lower():
            groups.setdefault((match[1].lower(), suffix), []).append((int(match[2]), entry))
    if len(groups) > 1:
        found = ", ".join(f"{prefix}*{suffix}" for prefix, suffix in sorted(groups))
        raise UserError(f"{folder}: several numbered sequences ({found}); leave one of them in the folder")
    files = sorted(next(iter(groups.values()))) if groups else []
    for (one, first), (other, second) in itertools.pairwise(files):
        if one == other:
            raise _one_number(folder, first, second)
    return [path for _, path in files]


def _one_number(where: Path | str, first: Path, second: Path) -> UserError:
    return UserError(f"{where}: {first.name} and {second.name} have one number; remove one of them")


def load_frames(paths: list[Path], read: Callable[[Path], Loaded], rate: float | None = None) -> Loaded:
    """One frame per file. Where the connectivity changes, each triangle has vertices of its own, and those that a frame
    has not have NaN positions (:mod:`.topology`); a note says so.
    """
    meshes = [read(path) for path in paths]
    fixed = fixed_topology([[(mesh.frames[0], mesh.faces)] for mesh in meshes])
    notes = [note for mesh in meshes for note in mesh.notes]
    if fixed.padded:
        counts = [len(mesh.faces) for mesh in meshes]
        notes.append(f"the connectivity changes: {min(counts):,} to {max(counts):,} triangles, which vanish and appear")
    notes += _uneven(paths)
    first = meshes[0]
    files = dict.fromkeys([*paths, *(file for mesh in meshes for file in mesh.files)])
    return replace(
        first, faces=fixed.faces, frames=fixed.frames, files=tuple(files), rate=rate, notes=tuple(dict.fromkeys(notes)),
        sequence=True,
    )  # fmt: skip


def _uneven(paths: Sequence[Path]) -> list[str]:
    """A note if numbers are missing from the names of a sequence."""
    found = [re.findall(r"\d+", path.stem) for path in paths]
    if not all(found):
        return []
    numbers = [int(words[-1]) for words in found]
    steps = [after - before for before, after in itertools.pairwise(numbers)]
    if not steps or min(steps) == max(steps):
        return []
    at = steps.index(max(steps))
    return [f"the numbers of its files are not evenly spaced: {numbers[at]} is followed by {numbers[at + 1]}"]


def load_npz(path: Path, wanted: Wanted = ALL) -> Loaded:
    """Arrays ``V``: float [frames, vertices, 3] or [vertices, 3], and ``F``: int [triangles, 3]; nothing pickled.

    Raises :class:`UserError` for other names, shapes or types, for indices out of range, and for an archive whose
    declared sizes do not match its contents.
    """
    read_bytes(path, 1024)  # missing and unreadable files get the same message as in every other format
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
        raise broken(path, f"F has shape {faces.shape} and type {faces.dtype}", "save F as integers [triangles, 3]")
    stack = vertices if vertices.ndim == 3 else vertices[None]
    if not len(stack):
        raise broken(path, "V has no frames")
    mesh = checked(path, stack[0], faces)
    frames = np.ascontiguousarray(stack, dtype=mesh.frames[0].dtype)
    chosen = wanted.chosen(path, len(frames))
    return Loaded(mesh.faces, tuple(frames[k] for k in chosen), (path,), rate=wanted.rate_of(chosen))


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
