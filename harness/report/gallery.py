"""The gallery (Figure 9 of the paper): one picture a scene, with shadows, and a sheet of them all.

A stand-in says so in the picture itself, so that it cannot be taken for the original wherever the file goes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ..errors import warn
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from ..scene.scene import Light
from .picture import opened, save_png, shade

SMALLEST = 512
"""Pictures below this width are enlarged by a whole factor: one ray stays one square."""

TALLEST = 4096
"""Pixels beyond which no picture is enlarged."""

LARGEST = 8192
"""Pixels a side beyond which only every second, third ... row and column of a picture is kept."""

NARROWEST = 256
"""A caption's width at least."""

INK, FAINT, PAPER = (32, 36, 42), (96, 102, 110), (250, 250, 248)
WARNING = (160, 70, 0)


def scene_picture(
    prepared: Prepared,
    moment: Moment,
    answers: dict[str, NDArray],
    lights: Sequence[Light],
    path: Path | str,
    shows: str = "",
) -> Path:
    """Shade a frame's answers, write a caption under it, save it as PNG, and return the path.

    The caption has the scene's title, its triangles, the frame of an animation, and, for a stand-in, what it
    stands in for. ``shows`` is kept in the file: see :func:`.report.picture.shown_in`.
    """
    scene = prepared.scene
    picture = shade(prepared, moment, answers, lights)
    skip = -(-max(picture.shape) // LARGEST)
    picture = picture[::skip, ::skip]
    factor = max(1, min(-(-SMALLEST // picture.shape[1]), TALLEST // picture.shape[0]))
    picture = picture.repeat(factor, axis=0).repeat(factor, axis=1)
    facts = f"{prepared.triangle_count:,} triangles"
    if prepared.frame_count > 1:
        facts += f", frame {moment.index + 1} of {prepared.frame_count}"
    return save_png(captioned(picture, scene.title, facts, scene.stand_in), path, shows)


def captioned(
    picture: NDArray[np.uint8], title: str, facts: str, stand_in: str | None = None
) -> NDArray[np.uint8]:
    """The picture with a strip of text below it: title and facts, and what a stand-in stands in for.

    A picture too narrow for text gets a margin at its right.
    """
    margin = max(0, NARROWEST - picture.shape[1])
    sheet = Image.new("RGB", (margin, picture.shape[0]), PAPER)
    if margin:
        picture = np.concatenate([picture, np.asarray(sheet)], axis=1)
    width = picture.shape[1]
    size = max(13, width // 34)
    line = round(size * 1.35)
    small = font(round(size * 0.82))
    lines = [(f"{title}: {facts}" if title else facts, font(size), INK)]
    if stand_in:
        lines += [
            (text, small, WARNING) for text in wrapped(stand_in_text(stand_in), small, width - 2 * size)
        ]
    strip = Image.new("RGB", (width, round(size * 0.8) + line * len(lines)), PAPER)
    draw = ImageDraw.Draw(strip)
    for i, (text, face, ink) in enumerate(lines):
        draw.text((size // 2, size // 3 + i * line), text, fill=ink, font=fitted(text, face, width - size))
    return np.concatenate([picture, np.asarray(strip)])


def contact_sheet(
    pictures: Sequence[Path], path: Path | str, columns: int | None = None, width: int = 352, title: str = ""
) -> Path | None:
    """All pictures on one sheet, captions and all. None where there are none; a damaged one is left out with a message.

    Each is ``width`` pixels wide; or, where that would make it higher, four times as high.
    """
    images: list[Image.Image] = []
    for file in pictures:
        image = opened(file)
        if image is None:
            warn(f"{file}: not a whole picture, left out; the same `shadowbench run` draws it again")
        else:
            images.append(image.convert("RGB"))
    if not images:
        return None
    gap = width // 24
    images = [
        i.resize((max(1, round(i.width * scale)), max(1, round(i.height * scale))), Image.Resampling.LANCZOS)
        for i in images
        for scale in [min(width / i.width, 4 * width / i.height)]
    ]
    columns = columns or (len(images) if len(images) <= 4 else 3 if len(images) in (5, 6, 9) else 4)
    rows = [images[i : i + columns] for i in range(0, len(images), columns)]
    head = round(gap * 2.2) if title else 0
    height = head + gap + sum(max(i.height for i in row) + gap for row in rows)
    sheet = Image.new("RGB", (columns * width + (columns + 1) * gap, height), PAPER)
    if title:
        ImageDraw.Draw(sheet).text((gap, gap * 0.7), title, fill=FAINT, font=font(round(gap * 1.1)))
    top = head + gap
    for row in rows:
        for i, image in enumerate(row):
            sheet.paste(image, (gap + i * (width + gap), top))
        top += max(image.height for image in row) + gap
    return save_png(np.asarray(sheet), path)


def draw(folder: Path | str, names: Sequence[str] = (), title: str = "") -> list[Path]:
    """Make ``gallery.png`` from the pictures in ``folder/images``: those of ``names`` first, in order."""
    folder = Path(folder)
    found = {file.stem: file for file in sorted((folder / "images").glob("*.png"))}
    order = [name for name in names if name in found] + [name for name in found if name not in names]
    sheet = contact_sheet([found[name] for name in order], folder / "gallery.png", title=title)
    return [sheet] if sheet else []


def stand_in_text(stand_in: str) -> str:
    """What a stand-in stands in for, as a line that says "stand-in" once."""
    return stand_in[:1].upper() + stand_in[1:] if "stand-in" in stand_in else f"Stand-in: {stand_in}"


def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own typeface at a size in pixels: the same on every machine."""
    return ImageFont.load_default(max(6, size))


def fitted(text: str, face, width: int):
    """The face, made smaller until ``text`` fits in ``width`` pixels."""
    size = getattr(face, "size", 10)
    while face.getlength(text) > width and size > 7:
        size -= 1
        face = font(size)
    return face


def wrapped(text: str, face, width: int) -> list[str]:
    """``text`` broken between words into lines of at most ``width`` pixels."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and face.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines
