"""Read scene files of any supported format. Triangles keep the order of the file; nothing is merged or dropped."""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ...errors import UserError
from ...files import open_regular
from ...texts import visible
from ..scene import Source
from .checks import ALL, Loaded, Wanted
from .gltf.read import read_gltf
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .sequences import load_frames, load_npz, numbered
from .stl import read_stl
from .threemf import read_3mf
from .unread import refusal
from .usd import read_usd

READERS: dict[str, Callable[[Path, Wanted], Loaded]] = {
    ".ply": read_ply,
    ".obj": read_obj,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".stl": read_stl,
    ".off": read_off,
    ".3mf": read_3mf,
    ".usd": read_usd,
    ".usda": read_usd,
    ".usdc": read_usd,
    ".usdz": read_usd,
}

STILL = (".ply", ".obj", ".stl", ".off", ".3mf")
"""Formats whose files hold one frame."""

SUFFIXES = (".npz", *READERS)
"""The supported file name endings."""


def load(path: str | Path, wanted: Wanted = ALL) -> Loaded:
    """A mesh file, an ``.npz`` sequence, or a folder of numbered frames; of its frames those ``wanted``.

    Raises :class:`UserError` for everything that is not a valid mesh of at least one triangle. Vertices with NaN are
    allowed: their triangles are never hit.
    """
    path = Path(path)
    if path.is_dir():
        frames = numbered(path, READERS)
        if not frames:
            kinds = ", ".join(READERS)
            raise UserError(f"{path}: this folder has no numbered frames ({kinds}); give a file, or a folder of them")
        return load_sequence(frames, wanted)
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return load_npz(path, wanted)
    if suffix not in READERS:
        if not path.exists():
            raise UserError(f"{path}: no such file; check the path")
        raise refusal(path, SUFFIXES)
    if suffix in STILL:
        wanted.chosen(path, 1)
    mesh = READERS[suffix](path, wanted)
    return replace(mesh, files=(path, *mesh.files))


def load_sequence(paths: list[Path], wanted: Wanted = ALL) -> Loaded:
    """Numbered frames, all of one format, in the order given; of these the ``wanted`` ones. Each file gives one frame."""
    chosen = wanted.chosen(paths[0].parent, len(paths))
    read, first = READERS[paths[0].suffix.lower()], replace(wanted, frames=(0, 0, 1))
    return load_frames([paths[k] for k in chosen], lambda path: read(path, first), wanted.rate_of(chosen))


def source(files: tuple[Path, ...], wanted: Wanted = ALL) -> Source:
    """The names of the files, one SHA-256 of their contents in order, and what was asked of them, for the record."""
    digest = hashlib.sha256()
    for path in files:
        with open_regular(path) as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    first, last = visible(files[0].name), visible(files[-1].name)
    return Source(
        "file",
        first if len(files) == 1 else f"{first}..{last} ({len(files)} files)",
        digest.hexdigest(),
        wanted.facts(),
    )
