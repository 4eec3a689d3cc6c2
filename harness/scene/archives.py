"""Unpack meshes from downloaded archives: no path leaves the folder, and the unpacked size is limited."""

from __future__ import annotations

import fnmatch
import tarfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO

from ..errors import UserError, one_line

MOST_BYTES = 8 << 30
MOST_MEMBERS = 20_000
BLOCK = 1 << 20
BROKEN = (zipfile.BadZipFile, tarfile.TarError, zlib.error, EOFError, NotImplementedError, RuntimeError)
"""Exceptions of Python for an archive that is damaged, encrypted or of an unknown kind."""


@dataclass(frozen=True)
class Member:
    """A file of an archive: its name there, and whether it is a plain file."""

    name: str
    plain: bool
    handle: zipfile.ZipInfo | tarfile.TarInfo


def unpack(archive: Path, pattern: str, folder: Path, most_bytes: int = MOST_BYTES) -> list[Path]:
    """Write the members whose names match ``pattern`` into ``folder``, by their last name; the files, sorted.

    Raises :class:`UserError` for an archive that is damaged, has a path that leaves the folder, links, too many members,
    or members that together are longer than ``most_bytes``, whatever the archive declares.
    """
    made: list[Path] = []
    left = most_bytes
    try:
        with _opened(archive) as (members, read):
            for count, member in enumerate(members, 1):
                if count > MOST_MEMBERS:
                    raise UserError(f"{archive}: more than {MOST_MEMBERS} files; it is not unpacked")
                path = PurePosixPath(member.name.replace("\\", "/"))
                if path.is_absolute() or ".." in path.parts or ":" in path.parts[0:1]:
                    raise UserError(f"{archive}: the path {member.name!r} leaves its folder; it is not unpacked")
                if not fnmatch.fnmatch(str(path).lower(), pattern):
                    continue
                if not member.plain:
                    raise UserError(f"{archive}: {member.name!r} is a link or no file; it is not unpacked")
                made.append(folder / path.name)
                with read(member) as source, made[-1].open("xb") as target:
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


@contextmanager
def _opened(archive: Path) -> Iterator:
    """The members of an archive in order, and a function that opens one of them."""
    if not (zipfile.is_zipfile(archive) or tarfile.is_tarfile(archive)):
        raise UserError(f"{archive}: no archive but {_beginning(archive)}; the server may have sent a page instead")
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as packed:
            # ZipInfo.is_dir fails where a name is empty.
            infos = [info for info in packed.infolist() if not info.filename.endswith("/")]
            members = (Member(i.filename, (i.external_attr >> 28) in (0, 8), i) for i in infos)
            yield members, lambda member: packed.open(member.handle)
        return
    with tarfile.open(archive) as tape:

        def read(member: Member) -> IO[bytes]:
            assert isinstance(member.handle, tarfile.TarInfo)
            found = tape.extractfile(member.handle)
            assert found is not None
            return found

        yield (Member(info.name, info.isfile(), info) for info in tape if not info.isdir()), read


def _beginning(path: Path) -> str:
    """The first bytes of a file, as text."""
    with path.open("rb") as stream:
        return repr(stream.read(40).decode("utf-8", errors="replace"))
