"""The gallery (Figure 9 of the paper): one picture a scene, with shadows, and a sheet of them all.

A stand-in says so in the picture itself, so that it cannot be taken for the original wherever the file goes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont, ImageOps

from ..errors import warn
from ..results.folder import image_name
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from ..scene.scene import Light
from .picture import opened, save_png, shade

if TYPE_CHECKING:
    from pandas import DataFrame

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
    prepared: Prepared, moment: Moment, answers: dict[str, NDArray], lights: Sequence[Light], path: Path | str,
    shows: str = "",
) -> Path:  # fmt: skip
    """Shade a frame's answers, write a caption under it, save it as PNG, and return the path.

    The caption has the scene's title, its triangles, the frame of an animation, the size of the frame, and, for a
    stand-in, what it stands in for. ``shows`` is kept in the file: see :func:`.report.picture.shown_in`.
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
    facts += f", {moment.width}x{moment.height}"
    return save_png(captioned(picture, scene.title, facts, scene.stand_in), path, shows)


def captioned(
    picture: NDArray[np.uint8], title: str, facts: str, stand_in: str | None = None
) -> NDArray[np.uint8]:
    """The picture with a strip of text below it: title and facts, and what a stand-in stands in for.

    A picture too narrow for text gets a margin at its right.
    """
    width = max(NARROWEST, picture.shape[1])
    size = max(13, width // 34)
    line, small = round(size * 1.35), font(round(size * 0.82))
    lines = [(f"{title}: {facts}" if title else facts, font(size), INK)]
    if stand_in:
        lines += [
            (text, small, WARNING) for text in wrapped(stand_in_text(stand_in), small, width - 2 * size)
        ]
    sheet = Image.new("RGB", (width, picture.shape[0] + round(size * 0.8) + line * len(lines)), PAPER)
    sheet.paste(Image.fromarray(picture))
    draw = ImageDraw.Draw(sheet)
    for i, (text, face, ink) in enumerate(lines):
        place = (size // 2, picture.shape[0] + size // 3 + i * line)
        draw.text(place, text, fill=ink, font=fitted(text, face, width - size))
    return np.asarray(sheet)


def contact_sheet(
    pictures: Sequence[Path], path: Path | str, width: int = 352, title: str = ""
) -> Path | None:
    """All pictures on one sheet, captions and all. None where there are none; a damaged one is left out with a message.

    Each is ``width`` pixels wide; or, where that would make it higher, four times as high.
    """
    images = []
    for file in pictures:
        image = opened(file)
        if image is None:
            warn(f"{file}: not a whole picture, left out; the same `shadowbench run` draws it again")
        else:
            images.append(
                ImageOps.contain(image.convert("RGB"), (width, 4 * width), Image.Resampling.LANCZOS)
            )
    if not images:
        return None
    gap = width // 24
    columns = len(images) if len(images) <= 4 else 3 if len(images) in (5, 6, 9) else 4
    rows = [images[i : i + columns] for i in range(0, len(images), columns)]
    top = gap + round(gap * 2.2) * bool(title)
    height = top + sum(max(i.height for i in row) + gap for row in rows)
    sheet = Image.new("RGB", (columns * width + (columns + 1) * gap, height), PAPER)
    face = fitted(title, font(round(gap * 1.1)), sheet.width - 2 * gap)
    ImageDraw.Draw(sheet).text((gap, gap * 0.7), title, fill=FAINT, font=face)
    for row in rows:
        for i, image in enumerate(row):
            sheet.paste(image, (gap + i * (width + gap), top))
        top += max(image.height for image in row) + gap
    return save_png(np.asarray(sheet), path)


def draw(folder: Path, points: DataFrame, title: str = "") -> list[Path]:
    """The pictures of the scenes of ``points`` on a sheet for each size: ``gallery.png``, ``gallery-WxH.png`` of several.

    points  a table with the columns scene, width and height; its order is the sheet's
    """
    sheets, sizes = [], list(points.groupby(["width", "height"], sort=False))
    for (width, height), own in sizes:
        files = [folder / "images" / image_name(scene, "", width, height) for scene in own["scene"].unique()]
        name = "gallery.png" if len(sizes) == 1 else f"gallery-{width}x{height}.png"
        sheets.append(contact_sheet([file for file in files if file.exists()], folder / name, title=title))
    return [sheet for sheet in sheets if sheet]


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
