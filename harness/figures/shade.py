"""A picture of a frame from its answers: diffuse shading, shadow bits, several coloured lights. numpy only.

Never part of anything timed. What is shown is what a method answered: the triangle decides the normal, t the
place, the visibility bits the shadows. A wrong answer is therefore seen as one.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from ..moment import Moment, Prepared
from ..scene import Light

F64 = NDArray[np.float64]

SKY_TOP = np.array([0.80, 0.86, 0.93])
SKY_BOTTOM = np.array([0.96, 0.97, 0.98])
"""The background, in the display's own values: light, so that a picture prints well."""

SURFACES = np.array(
    [
        [0.74, 0.66, 0.54],  # limestone
        [0.56, 0.64, 0.70],  # slate
        [0.74, 0.63, 0.50],  # sand
        [0.58, 0.68, 0.50],  # lichen
        [0.72, 0.60, 0.54],  # brick dust
        [0.66, 0.61, 0.66],  # heather
    ]
)
"""Linear reflectances. A scene always gets the same one; its separate pieces vary around it."""

AMBIENT = 0.22
HEADLIGHT = 0.05
EXPOSURE = 1.1
WHITE = 2.2
"""Radiance that is shown as white; what lies below is compressed as little as possible."""

SHOWS = "shows"
"""The name, in a PNG file, of the text that says what it was made from."""

BLOCK = 1 << 18
"""Pixels shaded at a time, so that a large picture needs little memory."""


def shade(
    prepared: Prepared, moment: Moment, answers: dict[str, NDArray], lights: Sequence[Light]
) -> NDArray[np.uint8]:
    """The picture of a frame, uint8 [height, width, 3].

    answers  as :meth:`..frame.Answers.to_host` gives them: triangle, t, visibility (u and v are not needed)
    lights   colour and intensity of each light of ``moment``, in the same order; places are the moment's
    """
    triangle = np.asarray(answers["triangle"]).reshape(-1)
    t = np.asarray(answers["t"]).reshape(-1)
    visibility = np.asarray(answers["visibility"]).reshape(-1, len(triangle))
    tint = _tints(prepared)
    picture = np.empty((len(triangle), 3), dtype=np.uint8)
    for start in range(0, len(triangle), BLOCK):
        pixels = np.arange(start, min(start + BLOCK, len(triangle)))
        # An answer that names no triangle of this scene is shown as a miss; the score is what reports it.
        hit = (triangle[pixels] >= 0) & (triangle[pixels] < prepared.triangle_count) & np.isfinite(t[pixels])
        picture[pixels] = _background(pixels, moment)
        seen = pixels[hit]
        if len(seen):
            light = _irradiance(prepared, moment, seen, triangle[seen], t[seen], visibility[:, seen], lights)
            picture[seen] = _display(light * tint[triangle[seen]])
    return picture.reshape(moment.height, moment.width, 3)


def _irradiance(
    prepared: Prepared,
    moment: Moment,
    pixels: NDArray[np.integer],
    triangle: NDArray[np.integer],
    t: NDArray[np.floating],
    visibility: NDArray[np.uint8],
    lights: Sequence[Light],
) -> F64:
    """Light that arrives at n hits, [n, 3]; all lights together, seen face on, make 1.

    The geometric normal is turned to the viewer: surfaces are two-sided. A light behind that side gives
    nothing, whatever its visibility bit says.
    """
    direction = moment.directions(pixels).astype(np.float64)
    place = moment.eye.astype(np.float64) + direction * t[:, None].astype(np.float64)
    view = _unit(-direction)
    normal = _normals(moment.points, prepared.faces[triangle])
    facing = np.einsum("ij,ij->i", normal, view)
    normal *= np.where(facing < 0, -1.0, 1.0)[:, None]

    up = np.asarray(prepared.scene.camera.up, dtype=np.float64)
    sky = normal @ (up / (np.linalg.norm(up) or 1.0))
    total = np.repeat(AMBIENT * (0.72 + 0.28 * sky) + HEADLIGHT * np.abs(facing), 3).reshape(-1, 3)
    total *= np.array([0.96, 0.99, 1.04])  # light from the sky is a little blue

    strength = sum(light.intensity * max(light.color) for light in lights) or 1.0
    for i, light in enumerate(lights):
        toward = _unit(moment.lights[i].astype(np.float64) - place)
        cosine = np.maximum(np.einsum("ij,ij->i", normal, toward), 0.0)
        if light.shadows and i < len(visibility):
            cosine[visibility[i] != 0] = 0.0
        total += cosine[:, None] * np.asarray(light.color) * (light.intensity / strength)
    return total


def _normals(points: NDArray[np.float32], corners: NDArray[np.integer]) -> F64:
    """Unit geometric normals [n, 3]; zero where a triangle has none."""
    a, b, c = (points[corners[:, i]].astype(np.float64) for i in range(3))
    with np.errstate(invalid="ignore", over="ignore"):
        return _unit(np.nan_to_num(np.cross(b - a, c - a), posinf=0.0, neginf=0.0))


def _unit(vectors: F64) -> F64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


def _display(radiance: F64) -> NDArray[np.uint8]:
    """Linear radiance [n, 3] as display values: a curve with a white point on the luminance, then sRGB."""
    radiance = radiance * EXPOSURE
    luminance = radiance @ np.array([0.2126, 0.7152, 0.0722])
    shown = luminance * (1 + luminance / WHITE**2) / (1 + 0.35 * luminance)
    mapped = np.clip(radiance * (shown / np.maximum(luminance, 1e-9))[:, None], 0.0, 1.0)
    srgb = np.where(mapped <= 0.0031308, 12.92 * mapped, 1.055 * mapped ** (1 / 2.4) - 0.055)
    return np.round(srgb * 255).astype(np.uint8)


def _background(pixels: NDArray[np.integer], moment: Moment) -> NDArray[np.uint8]:
    share = (pixels // moment.width / max(1, moment.height - 1))[:, None]
    return np.round(255 * (SKY_TOP * (1 - share) + SKY_BOTTOM * share)).astype(np.uint8)


def _tints(prepared: Prepared) -> F64:
    """Reflectance of each triangle, [triangle_count, 3]: one for the scene, varied from piece to piece."""
    digest = hashlib.sha256(prepared.scene.name.encode()).digest()
    base = SURFACES[digest[0] % len(SURFACES)]
    piece = pieces(prepared)
    # A multiplicative hash spreads neighbouring piece numbers; two of its bytes vary value and warmth.
    mixed = (piece.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    value = (mixed & np.uint64(255)).astype(np.float64) / 255 - 0.5
    warmth = ((mixed >> np.uint64(8)) & np.uint64(255)).astype(np.float64) / 255 - 0.5
    warm = np.array([1.0, 0.0, -1.0])
    return np.clip(base * (1 + 0.26 * value[:, None] + 0.16 * warmth[:, None] * warm), 0.05, 0.95)


def pieces(prepared: Prepared) -> NDArray[np.int64]:
    """For each triangle the lowest vertex of the connected piece that it belongs to, int64 [triangle_count].

    Connected means sharing a vertex of the welded mesh. Lowest labels are handed across triangles, with
    pointer jumping, until nothing changes.
    """
    corners = prepared.weld[prepared.faces].astype(np.int64)
    label = np.arange(prepared.vertex_count, dtype=np.int64)
    while len(corners):
        lowest = label[corners].min(axis=1)
        before = label.copy()
        for i in range(3):
            np.minimum.at(label, corners[:, i], lowest)
            np.minimum.at(label, before[corners[:, i]], lowest)
        label = label[label]
        if np.array_equal(label, before):
            break
    return label[corners[:, 0]]


def png_bytes(picture: NDArray[np.uint8], colours: int = 256, shows: str = "") -> bytes:
    """A compact PNG of uint8 [height, width, 3]: a palette of at most ``colours``, made for this picture.

    ``shows`` is kept in the file for :func:`shown_in`: what the picture was made from.
    """
    image = Image.fromarray(np.ascontiguousarray(picture), "RGB")
    exact = image.getcolors(colours)
    small = image.quantize(colours, method=Image.Quantize.MEDIANCUT, kmeans=1, dither=Image.Dither.NONE)
    if exact is not None:
        small = image.convert("P", palette=Image.Palette.ADAPTIVE, colors=max(1, len(exact)))
    buffer = io.BytesIO()
    facts = PngInfo()
    if shows:
        facts.add_text(SHOWS, shows)
    small.save(buffer, "PNG", optimize=True, pnginfo=facts)
    return buffer.getvalue()


def shown_in(path: Path | str) -> str | None:
    """What a picture says that it was made from; None where there is no such picture, or it does not say."""
    try:
        with Image.open(path) as image:
            return image.info.get(SHOWS)
    except (OSError, ValueError, SyntaxError):  # missing, or not a whole PNG
        return None


def save_png(picture: NDArray[np.uint8], path: Path | str, shows: str = "") -> Path:
    """Write a picture compactly (a 512x512 frame stays well below 300 kB) and return its path."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # Whole or not at all: a run that is killed here makes the picture again, not half of it.
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_bytes(png_bytes(picture, shows=shows))
    temporary.replace(path)
    return path
