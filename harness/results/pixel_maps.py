"""Work counts of single pixels, kept as small pictures beside the records: what a heat map is drawn from."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Counts = NDArray[np.int64]


def map_path(folder: Path, key: str, frame: int) -> Path:
    """Where the counts of a point's frame are kept."""
    return folder / "maps" / f"{key}-{frame}.png"


def write_map(path: Path, counts: NDArray[np.integer]) -> None:
    """Keep counts [height, width] as a PNG: red, green and blue are the bytes of a 24-bit number, highest first.

    Written atomically. Raises ValueError for a count that does not fit: none is ever cut.
    """
    wide = np.asarray(counts, dtype=np.int64)
    if wide.size and not 0 <= int(wide.min()) <= int(wide.max()) < 1 << 24:
        raise ValueError(f"counts {int(wide.min())} to {int(wide.max())} do not fit into 24 bits")
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    bytes_ = np.stack([wide >> 16, wide >> 8 & 255, wide & 255], axis=-1).astype(np.uint8)
    Image.fromarray(bytes_).save(temporary, optimize=True)
    temporary.replace(path)


def read_map(path: Path) -> Counts:
    """The counts [height, width] that :func:`write_map` kept."""
    with Image.open(path) as image:
        bytes_ = np.asarray(image.convert("RGB")).astype(np.int64)
    return (bytes_[..., 0] << 16) + (bytes_[..., 1] << 8) + bytes_[..., 2]
