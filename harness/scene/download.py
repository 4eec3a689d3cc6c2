"""Download a file, checked against its checksum and continued where it was cut off, and unpack the meshes of an archive:
no path leaves the folder, and the unpacked size is limited.
"""

import fnmatch
import gzip
import json
import os
import re
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from ..errors import UserError, one_line
from ..files import read_regular, write_atomic

CHECKSUMS = "checksums.json"  # SHA-256 of each address, recorded at its first use if none is pinned
MOST_CHECKSUMS = 1 << 20  # bytes of that file
LARGEST = 2 << 30  # bytes of a download

ATTEMPTS = 3
TIMEOUT_S = 30.0
BLOCK = 1 << 18

MOST_BYTES = 8 << 30
MOST_MEMBERS = 20_000
GZIP = b"\x1f\x8b"  # what a gzip file begins with
BROKEN = (  # exceptions of Python for an archive that is damaged, encrypted or of an unknown kind
    zipfile.BadZipFile, tarfile.TarError, gzip.BadGzipFile, zlib.error, EOFError, NotImplementedError, RuntimeError,
)  # fmt: skip


class Resumed:
    """A downloader for pooch that keeps a partial download beside the file (``.part``) and requests the rest."""

    def __init__(self, part: Path, most: int = LARGEST):
        self.part = part
        self.most = most

    def __call__(self, url: str, output_file: str, pooch: Any, check_only: bool = False) -> None:
        import requests

        for attempt in range(ATTEMPTS):
            try:
                self._continue(url)
                break
            except (requests.exceptions.ConnectionError, requests.exceptions.ChunkedEncodingError):
                if attempt == ATTEMPTS - 1:
                    raise
        os.replace(self.part, output_file)
        self._tag.unlink(missing_ok=True)

    @property
    def _tag(self) -> Path:
        """The server's identifier of the version of the part."""
        return self.part.with_suffix(".tag")

    def _continue(self, url: str) -> None:
        import requests

        have = self.part.stat().st_size if self.part.exists() and self._tag.exists() else 0
        # McGuire's archive refuses the names of common Python libraries.
        headers = {"Accept-Encoding": "identity", "User-Agent": "shadowbench"}
        if have:
            headers |= {"Range": f"bytes={have}-", "If-Range": self._tag.read_text()}
        with requests.get(url, headers=headers, stream=True, timeout=TIMEOUT_S) as answer:
            if answer.status_code == 416:  # the part was complete, or the file has become shorter
                self.part.unlink()
                raise requests.exceptions.ConnectionError("the part does not fit")
            answer.raise_for_status()
            if url.startswith("https:") and not answer.url.startswith("https:"):
                raise UserError(f"{url}: leads to {answer.url}, which is not encrypted; it is not fetched")
            have = have if answer.status_code == 206 else 0
            tag = answer.headers.get("ETag") or answer.headers.get("Last-Modified") or ""
            self._tag.unlink(missing_ok=True)
            if tag and not tag.startswith("W/"):
                self._tag.write_text(tag)
            with self.part.open("ab" if have else "wb") as target:
                # Not iter_content: if an answer is cut off, it drops the received part of the last block.
                while block := self._read(answer):
                    have += len(block)
                    if have > self.most:
                        raise UserError(f"{url}: longer than {self.most:,} bytes; the download is stopped")
                    target.write(block)

    def _read(self, answer: Any) -> bytes:
        """The received bytes, at most one block; empty at the end. Raises requests' error if the answer is cut off."""
        import requests
        import urllib3

        try:
            return answer.raw.read1(BLOCK)
        except urllib3.exceptions.HTTPError as error:
            raise requests.exceptions.ConnectionError(error) from error


@contextmanager
def downloaded(url: str, folder: Path, pinned: str | None = None) -> Iterator[Path]:
    """The file at an address, stored in ``folder``. ``pinned``: its SHA-256; None: as recorded at first use.

    The checksum of a first use is recorded when the block has used the file without an error; otherwise the file is
    removed, since it may be a page that says what went wrong at the server. Raises :class:`UserError` if the file is not
    available or has another checksum. A partial download is stored and continued.
    """
    import pooch
    import requests

    pooch.get_logger().setLevel("ERROR")  # it announces every download with its checksum
    name = url.rpartition("/")[2]
    expected = pinned or recorded(folder).get(url)
    try:
        path = pooch.retrieve(
            url, f"sha256:{expected}" if expected else None, name, folder, downloader=Resumed(folder / f"{name}.part")
        )
    except requests.exceptions.RequestException as error:
        raise UserError(f"{url}: cannot be fetched ({_reason(error)}); the same command continues it") from error
    except ValueError as error:  # pooch's error for another checksum
        raise UserError(
            f"{url}: its checksum is not {expected}; it has changed or was altered on its way, and is not used"
        ) from error
    try:
        yield Path(path)
    except UserError:
        if expected is None:
            Path(path).unlink(missing_ok=True)
        raise
    if expected is None:
        write_atomic(folder / CHECKSUMS, {**recorded(folder), url: pooch.file_hash(path)})


def _reason(error: Exception) -> str:
    """Why a download failed, without the pools and retries around it: "Failed to resolve 'a.org' ([Errno -2] ...)"."""
    inner = getattr(error.args[0] if error.args else None, "reason", None)
    return re.sub(
        r"^HTTPS?Connection(Pool)?\([^)]*\): ", "", one_line(inner if isinstance(inner, Exception) else error)
    )


def recorded(folder: Path) -> dict[str, str]:
    """The checksums that were recorded in a folder."""
    path = folder / CHECKSUMS
    if not path.exists():
        return {}
    try:
        found = json.loads(read_regular(path, MOST_CHECKSUMS))
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read; correct or remove it") from error
    return {str(key): str(value) for key, value in found.items()} if isinstance(found, dict) else {}


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
