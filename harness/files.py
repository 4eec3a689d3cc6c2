"""Files written whole or not at all, files read only where they are regular, values as JSON holds them, and hashes."""

import contextlib
import errno
import hashlib
import json
import os
import re
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

PARTIAL = re.compile(r"\..+\.[a-z0-9_]{8}\.partial")
"""Names of the files that :func:`replacing` writes before it puts them in their place: they stay where it is killed."""


@contextlib.contextmanager
def replacing(path: Path, durable: bool = True) -> Iterator[IO[bytes]]:
    """A stream for the new content of a file, which a reader sees whole or not at all, and its folder if there is none.
    ``durable``: on the disk before the file is put in its place, so that a crash of the machine does not lose it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".partial")
    except OSError as error:  # it names a file that nobody asked for
        raise OSError(error.errno, error.strerror, str(path)) from error
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
            if durable:
                os.fsync(stream.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        # A partial file would keep a full disk full.
        Path(temporary).unlink(missing_ok=True)
        raise


def open_regular(path: Path, update: bool = False) -> IO[bytes]:
    """A file opened for reading, or to ``update`` it. Raises OSError for a folder, a pipe, a device or a socket.
    Opening a pipe would wait for its writer, and a device may have no end.
    """
    _require_regular(os.stat(path), path)  # opening alone can act on a device
    handle = os.open(path, (os.O_RDWR if update else os.O_RDONLY) | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        _require_regular(os.fstat(handle), path)  # another file may have taken its place
        return os.fdopen(handle, "r+b" if update else "rb")
    except BaseException:
        os.close(handle)
        raise


def _require_regular(found: os.stat_result, path: Path) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))


@contextlib.contextmanager
def opened_arrays(path: Path, most: int = 16 << 30) -> Iterator[Any]:
    """The arrays that :func:`write_arrays` wrote, each read when it is asked for; nothing pickled. Raises one of
    :data:`DAMAGED` for anything else, and for an archive that unpacks to more than ``most`` bytes.
    """
    with open_regular(path) as stream:
        if not zipfile.is_zipfile(stream):
            raise ValueError("it is no .npz file")
        with zipfile.ZipFile(stream) as archive:
            if sum(info.file_size for info in archive.infolist()) > most:
                raise ValueError(f"it unpacks to more than {most:,} bytes")
        stream.seek(0)
        with np.load(stream, allow_pickle=False) as arrays:
            yield arrays


def read_regular(path: Path, most: int | None = None) -> bytes:
    """The contents of a regular file. Raises OSError as :func:`open_regular` does, and for more than ``most`` bytes."""
    with open_regular(path) as stream:
        if most is not None and os.fstat(stream.fileno()).st_size > most:
            raise OSError(errno.EFBIG, f"longer than {most:,} bytes", str(path))
        return stream.read()


def write_arrays(path: Path, arrays: Mapping[str, NDArray], compressed: bool = True) -> None:
    """Write arrays by name as .npz, atomically. Not synchronised to disk: all such arrays can be computed again."""
    save = np.savez_compressed if compressed else np.savez
    with replacing(path, durable=False) as stream:
        save(stream, **arrays)  # type: ignore[arg-type]


def array_hash(*arrays: NDArray) -> str:
    """SHA-256 of the types, shapes and bytes of arrays."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


DAMAGED = (OSError, ValueError, KeyError, EOFError, NotImplementedError, RuntimeError, zipfile.BadZipFile, zlib.error)
"""Errors of reading a file of arrays that is damaged, or of another kind."""


def canonical(value: Any) -> str:
    """JSON with sorted keys and no spaces, so that equal configurations have equal text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def require_storable(value: Any) -> None:
    """Raise ValueError unless every number in a value is finite and every text is Unicode, as files and terminals need."""
    json.dumps(value, ensure_ascii=False, allow_nan=False).encode()


def digest(value: Any) -> str:
    """Sha256 of the canonical JSON of a value."""
    return hashlib.sha256(canonical(value).encode()).hexdigest()


def write_atomic(path: Path, value: Any) -> None:
    """Write JSON so that a reader sees the old file or the whole new one, whatever happens in between."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file as :func:`write_bytes` does."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically and durably."""
    with replacing(path) as stream:
        stream.write(content)


def plain(value: Any) -> Any:
    """The value as JSON can hold it: numpy numbers as Python's own, tuples as lists, anything else as text."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if hasattr(value, "item") and getattr(value, "ndim", 1) == 0:
        return value.item()
    return str(value)
