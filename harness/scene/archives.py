"""Unpack meshes from downloaded archives: no path leaves the folder, and the unpacked size is limited."""

import fnmatch
import gzip
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
GZIP = b"\x1f\x8b"
"""What a gzip file begins with."""
BROKEN = (
    zipfile.BadZipFile, tarfile.TarError, gzip.BadGzipFile, zlib.error, EOFError, NotImplementedError, RuntimeError,
)  # fmt: skip
"""Exceptions of Python for an archive that is damaged, encrypted or of an unknown kind."""


@dataclass(frozen=True)
class Member:
    """A file of an archive: its name there, and whether it is a plain file."""

    name: str
    plain: bool
    handle: zipfile.ZipInfo | tarfile.TarInfo | Path


def unpack(archive: Path, pattern: str, folder: Path, most_bytes: int = MOST_BYTES) -> list[Path]:
    """Write the members whose names match ``pattern``, or one of several that spaces separate, into ``folder``, by their
    last name; the files, sorted. A gzip file of one file is an archive of that file.

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
                if not any(fnmatch.fnmatch(str(path).lower(), one) for one in pattern.split()):
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
    with archive.open("rb") as stream:
        beginning = stream.read(40)
    if beginning.startswith(GZIP) and not tarfile.is_tarfile(archive):
        yield [Member(archive.name.removesuffix(".gz"), True, archive)], lambda member: gzip.GzipFile(member.handle)
        return
    if not (zipfile.is_zipfile(archive) or tarfile.is_tarfile(archive)):
        text = beginning.decode(errors="replace")
        raise UserError(f"{archive}: no archive but {text!r}; the server may have sent a page instead")
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
