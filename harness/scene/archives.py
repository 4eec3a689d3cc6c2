"""Unpack meshes from downloaded archives: no path leaves the folder, and the unpacked size is limited."""

import fnmatch
import gzip
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from ..errors import UserError, one_line

MOST_BYTES = 8 << 30
MOST_MEMBERS = 20_000
BLOCK = 1 << 20
GZIP = b"\x1f\x8b"  # what a gzip file begins with
BROKEN = (
    zipfile.BadZipFile, tarfile.TarError, gzip.BadGzipFile, zlib.error, EOFError, NotImplementedError, RuntimeError,
)  # fmt: skip
"""Exceptions of Python for an archive that is damaged, encrypted or of an unknown kind."""


def unpack(archive: Path, pattern: str, folder: Path, most_bytes: int = MOST_BYTES) -> list[Path]:
    """Write the members whose names match ``pattern``, or one of several that spaces separate, into ``folder``, by their
    last name; the files, sorted. A gzip file of one file is an archive of that file.

    Raises :class:`UserError` for an archive that is damaged, has a path that leaves the folder, links, too many members,
    or members that together are longer than ``most_bytes``, whatever the archive declares.
    """
    made: list[Path] = []
    left = most_bytes
    try:
        for count, (name, plain, opened) in enumerate(_members(archive), 1):
            if count > MOST_MEMBERS:
                raise UserError(f"{archive}: more than {MOST_MEMBERS} files; it is not unpacked")
            path = PurePosixPath(name.replace("\\", "/"))
            if path.is_absolute() or ".." in path.parts or ":" in path.parts[0:1]:
                raise UserError(f"{archive}: the path {name!r} leaves its folder; it is not unpacked")
            if not any(fnmatch.fnmatch(str(path).lower(), one) for one in pattern.split()):
                continue
            if not plain:
                raise UserError(f"{archive}: {name!r} is a link or no file; it is not unpacked")
            made.append(folder / path.name)
            with opened() as source, made[-1].open("xb") as target:
                while block := source.read(BLOCK):
                    left -= len(block)
                    if left < 0:
                        raise UserError(f"{archive}: unpacks to more than {most_bytes:,} bytes; it is not unpacked")
                    target.write(block)
    except FileExistsError as error:
        raise UserError(f"{archive}: holds two files {made[-1].name!r}; it is not unpacked") from error
    except BROKEN as error:
        raise UserError(f"{archive}: damaged ({one_line(error)}); remove it and fetch again") from error
    if not made:
        raise UserError(f"{archive}: has no file {pattern!r}; the archive has changed")
    return sorted(made)


def _members(archive: Path) -> Iterator[tuple[str, bool, Callable[[], Any]]]:
    """The files of an archive in order: the name of each there, whether it is a plain file, and what opens it."""
    with archive.open("rb") as stream:
        beginning = stream.read(40)
    if beginning.startswith(GZIP) and not tarfile.is_tarfile(archive):  # first, as a zip file may stand at its end
        yield archive.name.removesuffix(".gz"), True, partial(gzip.open, archive)
    elif zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as packed:
            for info in packed.infolist():
                if not info.filename.endswith("/"):  # ZipInfo.is_dir fails where a name is empty
                    yield info.filename, (info.external_attr >> 28) in (0, 8), partial(packed.open, info)
    elif tarfile.is_tarfile(archive):
        with tarfile.open(archive) as tape:
            for entry in tape:
                if not entry.isdir():
                    yield entry.name, entry.isfile(), partial(tape.extractfile, entry)
    else:
        text = beginning.decode(errors="replace")
        raise UserError(f"{archive}: no archive but {text!r}; the server may have sent a page instead")
