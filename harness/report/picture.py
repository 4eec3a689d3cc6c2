"""A picture of a frame from its answers, wrong ones visible: shaded by the kernel that frames use, in display values;
an animation, frames as one looping WebP file; and how visible wrong answers are.

Never part of a timed frame. A caption says what is a stand-in, so that it cannot be mistaken for the original. FLIP
(Andersson et al. 2020) measures how different two pictures look when one flips between them: ten wrong pixels in a
million hardly change it, so it is shown beside the counts and never instead of them.
"""

import importlib.util
import io
import os
import struct
import textwrap
import zlib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageColor, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from ..arrays import F64, U8
from ..errors import UserError
from ..files import open_regular, replacing
from ..frame.effects.shading import shaded
from ..judge.context import Judge
from ..judge.score import Scored, score_answers
from ..results.pixel_maps import OFFSET, write_map, wrong_path
from ..scene.facts import triangles
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from ..scene.scene import Light

EXPOSURE = 1.1
WHITE = 2.2  # radiance that is shown as white; lower values are compressed as little as possible
SHOWS = "shows"  # the name, in a PNG file, of the text that says what it was made from

UNREADABLE = (  # exceptions of Pillow for a file that is not a whole picture
    OSError, ValueError, SyntaxError, EOFError, struct.error, zlib.error, Image.DecompressionBombError,
)  # fmt: skip

BLOCK = 1 << 16  # pixels that are shaded at a time, so that a large picture needs little memory
THREADS = min(8, os.cpu_count() or 1)
GREYS = 40  # number of colours of a picture that has greys and a few inks
SMALLEST, TALLEST = 512, 4096  # narrower pictures are enlarged by a whole factor, up to this height, pixels
LARGEST = 8192  # Pixels per side beyond which only every second, third ... row and column of a picture is used.
NARROWEST = 256  # smallest width of a caption
PAPER = (250, 250, 248)

QUALITY = 60  # quality of the lossy encoding, 0 to 100: a few kB for a frame of 256x256 pixels
LONGEST_SIDE = 16383  # largest width and height of a WebP file, pixels
MOST_PIXELS = 1 << 28  # of all frames together: they are in memory until the file is written, 3 bytes each

FLIP_MISSING = "the package flip-evaluator is not installed"


def shade(prepared: Prepared, moment: Moment, answers: dict[str, NDArray], lights: Sequence[Light]) -> U8:
    """The picture of a frame, uint8 [height, width, 3].

    answers  as :meth:`.frame.frame.Answers.to_host` gives them: triangle, t, shadowed (u and v are not needed), and
             what mirrored rays met, where they are among them
    lights   colour, intensity and fall-off of each light of ``moment``, in the same order; places are the moment's
    """
    pixels = moment.width * moment.height
    picture = np.empty((pixels, 3), dtype=np.uint8)
    colors = shaded(prepared, moment, answers, lights)

    def part(first: int) -> None:
        count = min(BLOCK, pixels - first)
        picture[first : first + count] = display(colors(first, count).astype(np.float64))

    part(0)  # alone: the first launch loads the kernel
    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(part, range(BLOCK, pixels, BLOCK)))
    return picture.reshape(moment.height, moment.width, 3)


def display(radiance: F64) -> U8:
    """Linear radiance [n, 3] as display values: a curve with a white point on the luminance, then sRGB."""
    radiance = radiance * EXPOSURE
    luminance = radiance @ np.array([0.2126, 0.7152, 0.0722])
    shown = luminance * (1 + luminance / WHITE**2) / (1 + 0.35 * luminance)
    mapped = np.clip(radiance * (shown / np.maximum(luminance, 1e-9))[:, None], 0.0, 1.0)
    srgb = np.where(mapped <= 0.0031308, 12.92 * mapped, 1.055 * mapped ** (1 / 2.4) - 0.055)
    return np.round(srgb * 255).astype(np.uint8)


def png_bytes(picture: U8, colours: int = 256, shows: str = "", inks: Sequence[str] = ()) -> bytes:
    """A compact PNG of uint8 [height, width, 3], ``shows`` in it: at most ``colours``, or greys and ``inks`` ("#rrggbb")."""
    image = Image.fromarray(np.ascontiguousarray(picture), "RGB")
    exact = image.getcolors(colours)
    if inks:
        palette = Image.new("P", (1, 1))
        greys = np.round(np.linspace(0, 255, GREYS)).astype(int).repeat(3).tolist()
        palette.putpalette([value for ink in inks for value in ImageColor.getrgb(ink)] + greys)
        small = image.quantize(palette=palette, dither=Image.Dither.NONE)
    elif exact is not None:
        small = image.convert("P", palette=Image.Palette.ADAPTIVE, colors=max(1, len(exact)))
    else:
        small = image.quantize(colours, method=Image.Quantize.MEDIANCUT, kmeans=1, dither=Image.Dither.NONE)
    facts, buffer = PngInfo(), io.BytesIO()
    if shows:
        facts.add_text(SHOWS, shows)
    small.save(buffer, "PNG", optimize=True, pnginfo=facts)
    return buffer.getvalue()


def opened(path: Path | str) -> Image.Image | None:
    """The picture in a file, read to its end; None where there is none, or not a whole one."""
    try:
        with open_regular(Path(path)) as stream, Image.open(stream) as image:
            image.load()
            return image
    except UNREADABLE:
        return None


def shown_in(path: Path | str) -> str | None:
    """The text in a picture file about the data it was made from; None if there is no whole picture or no text."""
    image = opened(path)
    return None if image is None else image.info.get(SHOWS)


def save_png(picture: U8, path: Path | str, shows: str = "", colours: int = 256) -> Path:
    """Write a picture compactly (a 512x512 frame stays well below 300 kB) and return its path."""
    path = Path(path)
    # Whole or not at all: a run that is killed here makes the picture again, not half of it.
    with replacing(path, durable=False) as stream:
        stream.write(png_bytes(picture, colours, shows))
    return path


def scene_picture(
    prepared: Prepared, moment: Moment, answers: dict[str, NDArray], lights: Sequence[Light], path: Path | str,
    shows: str = "",
) -> Path:  # fmt: skip
    """Shade a frame's answers, write a caption under it, save it as PNG with ``shows`` (:func:`shown_in`) in the file."""
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


def captioned(picture: U8, title: str, facts: str, stand_in: str | None = None) -> U8:
    """The picture with a strip of text below it: title and facts, and what a stand-in stands in for."""
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


def stand_in_text(stand_in: str) -> str:
    """What a stand-in stands in for, as a line that says "stand-in" once."""
    return stand_in[:1].upper() + stand_in[1:] if "stand-in" in stand_in else f"Stand-in: {stand_in}"


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
    """Write frames, uint8 [height, width, 3], as a looping WebP of ``seconds`` (at least 10 ms a frame), or nothing."""
    images = [Image.fromarray(np.ascontiguousarray(frame)) for frame in frames]
    length = max(10, round(1000 * seconds / len(images)))
    with replacing(path, durable=False) as stream:
        images[0].save(
            stream, "WEBP", save_all=True, append_images=images[1:], duration=length, loop=0, quality=QUALITY,
            method=4,
        )  # fmt: skip
    return path


def reference_path(folder: Path, scene: str, frame: int) -> Path:
    """The file of the reference's picture of a scene's frame, on which errors are drawn."""
    return folder / "images" / f"{scene}-{frame}-reference.png"


def answered_path(folder: Path, key: str, frame: int) -> Path:
    """The file of the picture of a point's own answers, if it differs from the reference's."""
    return folder / "images" / f"{key}-{frame}-answered.png"


def keep_wrong(
    folder: Path, key: str, frame: int, judge: Judge, answers: dict[str, NDArray]
) -> tuple[Scored, dict[str, Any]]:
    """The score of a frame's answers, its map of classes written; and its FLIP, or the reason why there is none. The
    picture of the reference is saved, and that of the answers if it differs.
    """
    scored = score_answers(judge, answers)
    shape = (judge.moment.height, judge.moment.width)
    write_map(wrong_path(folder, key, frame), scored.classes.reshape(shape).astype(np.int64) + OFFSET)
    right, given = (picture(judge, one) for one in (judge.reference.answers(), answers))
    path = reference_path(folder, judge.prepared.scene.name, frame)
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(right).save(path)
    if (given != right).any():
        Image.fromarray(given).save(answered_path(folder, key, frame))
    return scored, flip(right, given)


def picture(judge: Judge, answers: dict[str, NDArray]) -> U8:
    """Answers as a picture, uint8 [height, width, 3]."""
    return shade(judge.prepared, judge.moment, answers, judge.prepared.lights(judge.moment.index))


def flip(reference: U8, given: U8) -> dict[str, Any]:
    """Mean FLIP of a picture against the reference's, 0 (same) to 1; None with the reason where it is absent."""
    if importlib.util.find_spec("flip_evaluator") is None:
        return {"flip": None, "flip_missing": FLIP_MISSING}
    import flip_evaluator

    pair = [np.ascontiguousarray(one.astype(np.float32) / 255) for one in (reference, given)]
    _, mean, _ = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
    return {"flip": float(mean), "flip_missing": ""}
