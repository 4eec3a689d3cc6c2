"""Work counts and classes of single pixels, as small pictures beside the records: what a map is drawn from."""

from pathlib import Path

import numpy as np
from PIL import Image

from ..arrays import I8, I64, Ints
from ..files import open_regular, replacing
from ..judge.verdict import RIGHT

Counts = I64


def map_path(folder: Path, key: str, frame: int) -> Path:
    """Where the counts of a point's frame are stored."""
    return folder / "maps" / f"{key}-{frame}.png"


def write_map(path: Path, counts: Ints) -> None:
    """Keep counts [height, width] as a PNG: red, green and blue are the bytes of a 24-bit number, highest first.
    Written atomically. Raises ValueError for a count that does not fit: none is ever cut.
    """
    wide = np.asarray(counts, dtype=np.int64)
    if wide.size and not 0 <= int(wide.min()) <= int(wide.max()) < 1 << 24:
        raise ValueError(f"counts {int(wide.min())} to {int(wide.max())} do not fit into 24 bits")
    bytes_ = np.stack([wide >> 16, wide >> 8 & 255, wide & 255], axis=-1).astype(np.uint8)
    with replacing(path, durable=False) as stream:
        Image.fromarray(bytes_).save(stream, "PNG", optimize=True)


def read_map(path: Path) -> Counts:
    """The counts [height, width] that :func:`write_map` wrote."""
    with open_regular(path) as stream, Image.open(stream) as image:
        bytes_ = np.asarray(image.convert("RGB")).astype(np.int64)
    return (bytes_[..., 0] << 16) + (bytes_[..., 1] << 8) + bytes_[..., 2]


OFFSET = 1  # added to classes in a map, whose numbers must not be negative: an unjudged pixel is 0


def wrong_path(folder: Path, key: str, frame: int) -> Path:
    """Where the classes of a point's frame are stored."""
    return folder / "maps" / f"{key}-{frame}-wrong.png"


def read_wrong(path: Path) -> I64:
    """Classes of :class:`.judge.referee.Verdict` [height, width]; -1: left unjudged."""
    return read_map(path) - OFFSET


def mark_wrong(path: Path, pixels: Ints, classes: I8) -> None:
    """Set pixels of a map of classes that were counted as right; nothing where there is no map or nothing changes."""
    if not (len(pixels) and path.exists()):
        return
    known = read_wrong(path)
    marked = known.ravel().copy()
    rows = np.isin(marked[pixels], RIGHT)
    marked[pixels[rows][::-1]] = classes[rows][::-1]  # the first one of a pixel counts
    if (marked != known.ravel()).any():
        write_map(path, marked.reshape(known.shape) + OFFSET)
