"""An animated picture: frames as one looping WebP file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from ..arrays import U8
from ..errors import UserError
from ..files import replacing
from .picture import PAPER

QUALITY = 60
"""Quality of the lossy encoding, 0 to 100: a few kB for a frame of 256x256 pixels."""

LONGEST_SIDE = 16383
"""Largest width and height of a WebP file, pixels."""

MOST_PIXELS = 1 << 28
"""Largest number of pixels of all frames together: they are in memory until the file is written, 3 bytes per pixel."""


def check_animation(width: int, height: int, frames: int) -> None:
    """Raise :class:`UserError` where an animation of this size cannot be written."""
    if max(width, height) > LONGEST_SIDE:
        raise UserError(f"--size {width}x{height}: a WebP file has at most {LONGEST_SIDE} pixels per side")
    if width * height * frames > MOST_PIXELS:
        raise UserError(
            f"{frames} frames of {width}x{height}: too many pixels for one animation; choose a smaller --size or --frames"
        )


def beside(pictures: Sequence[U8]) -> U8:
    """The pictures in a row, tops aligned, on one sheet: uint8 [height, width, 3]."""
    sheet = np.empty((max(p.shape[0] for p in pictures), sum(p.shape[1] for p in pictures), 3), dtype=np.uint8)
    sheet[:] = PAPER
    left = 0
    for picture in pictures:
        sheet[: picture.shape[0], left : left + picture.shape[1]] = picture
        left += picture.shape[1]
    return sheet


def save_webp(frames: Sequence[U8], path: Path, seconds: float) -> Path:
    """Write frames, uint8 [height, width, 3] each, as a looping WebP file that lasts ``seconds``. Whole or not at all.

    Players show a frame for whole milliseconds, at least 10.
    """
    images = [Image.fromarray(np.ascontiguousarray(frame)) for frame in frames]
    length = max(10, round(1000 * seconds / len(images)))
    with replacing(path, durable=False) as stream:
        images[0].save(
            stream, "WEBP", save_all=True, append_images=images[1:], duration=length, loop=0, quality=QUALITY,
            method=4,
        )  # fmt: skip
    return path
