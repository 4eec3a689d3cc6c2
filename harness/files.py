"""Arrays in a file, whole or not at all; and the hash of arrays."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def write_arrays(path: Path, arrays: Mapping[str, NDArray], compressed: bool = True) -> None:
    """Write arrays by name as .npz, atomically, and the folder if there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    save = np.savez_compressed if compressed else np.savez
    try:
        with temporary.open("wb") as stream:
            save(stream, **arrays)  # type: ignore[arg-type]
        temporary.replace(path)
    except BaseException:
        # What a full disk left of it would fill the disk.
        temporary.unlink(missing_ok=True)
        raise


def array_hash(*arrays: NDArray) -> str:
    """SHA-256 of the types, shapes and bytes of arrays."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
