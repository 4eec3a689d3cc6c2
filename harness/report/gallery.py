"""The gallery (Figure 9 of the paper): one picture per scene, with shadows, and a sheet of all. Captions name stand-ins."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ..errors import warn
from ..results.folder import image_name
from ..scene.facts import triangles
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from ..scene.scene import Light
from . import panels
from .picture import opened, save_png, shade

if TYPE_CHECKING:
    from pandas import DataFrame

SMALLEST, TALLEST = 512, 4096
"""Pictures below this width are enlarged by a whole factor (one ray stays one square), up to this height, pixels."""
LARGEST = 8192
"""Pixels per side beyond which only every second, third ... row and column of a picture is used."""
NARROWEST = 256
"""Smallest width of a caption."""
PAPER = (250, 250, 248)


def scene_picture(
    prepared: Prepared, moment: Moment, answers: dict[str, NDArray], lights: Sequence[Light], path: Path | str,
    shows: str = "",
) -> Path:  # fmt: skip
    """Shade a frame's answers, write a caption under it, save it as PNG, and return the path.

    The caption has the scene's title, its triangles, the frame of an animation, the size of the frame, and, for a
    stand-in, what it stands in for. ``shows`` is stored in the file: see :func:`.report.picture.shown_in`.
    """
    scene = prepared.scene
    picture = shade(prepared, moment, answers, lights)
    skip = -(-max(picture.shape) // LARGEST)
    picture = picture[::skip, ::skip]
    factor = max(1, min(-(-SMALLEST // picture.shape[1]), TALLEST // picture.shape[0]))
    picture = picture.repeat(factor, axis=0).repeat(factor, axis=1)
    facts = triangles(prepared.triangle_count)
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
    high, width = picture.shape[0], max(NARROWEST, picture.shape[1])
    size = max(13, width // 34)
    texts = [(f"{title}: {facts}" if title else facts, size, "#20242a")]
    texts += [(stand_in_text(stand_in), round(size * 0.82), "#a04600")] if stand_in else []
    lines = []
    for text, points, ink in texts:
        face = ImageFont.load_default(points)  # Pillow's own: the same on every machine
        letters = int(len(text) * (width - size) / max(1.0, face.getlength(text)))
        lines += [(line, face, ink) for line in textwrap.wrap(text, max(1, letters - 2))]
    sheet = Image.new("RGB", (width, high + round(size * (0.8 + 1.35 * len(lines)))), PAPER)
    sheet.paste(Image.fromarray(picture))
    draw = ImageDraw.Draw(sheet)
    for i, (line, face, ink) in enumerate(lines):
        draw.text((size // 2, high + size // 3 + round(i * 1.35 * size)), line, fill=ink, font=face)
    return np.asarray(sheet)


def draw(folder: Path, points: DataFrame, title: str = "") -> list[Path]:
    """The pictures of the scenes of ``points`` on a sheet for each size: ``gallery.png``, ``gallery-WxH.png`` of several.

    points  a table with the columns scene, width and height; its order is the sheet's. A damaged picture is left out with
            a message.
    """
    sheets, sizes = [], list(points.groupby(["width", "height"], sort=False))
    for (width, height), own in sizes:
        shown = []
        for scene in own["scene"].unique():
            file = folder / "images" / image_name(scene, "", width, height)
            if image := opened(file):
                image.thumbnail((704, 4 * 704))
                shown.append(("", np.asarray(image.convert("RGB"))))
            elif file.exists():
                warn(f"{file}: not a whole picture, left out; the same `shadowbench run` draws it again")
        name = "gallery.png" if len(sizes) == 1 else f"gallery-{width}x{height}.png"
        if shown:
            sheets.append(panels.images(folder / name, shown, across=3, below=title, wide=2, colours=256))
    return sheets


def stand_in_text(stand_in: str) -> str:
    """What a stand-in stands in for, as a line that says "stand-in" once."""
    return stand_in[:1].upper() + stand_in[1:] if "stand-in" in stand_in else f"Stand-in: {stand_in}"
