"""H01-H06: triangles with holes: rays on the borders of texels, holes in duplicate triangles, and light through holes. The
bitmap is a chequerboard over x and y, so that rays through pixel centres meet texels exactly on their borders, or in their
middle.

M01-M06: mirrors: rays that start on surfaces, edges and corners, and shadows on surfaces that are only visible in a mirror.
The harness makes the rays (:mod:`..frame.effects.mirrors`); the cases test whether a method finds their closest hits.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..arrays import U8
from ..scene.scene import AlphaMask, Geometry
from .case import BESIDE, ORIGIN, Counts, Trial, axes, hard, rows, view
from .shapes import FLOOR, Mesh, ball, box, joined, plane, quad, soup

EITHER_SIDE = "the texel of a rounded coordinate lies on either side"


def chequered(mesh: Mesh, side: float, count: int, turned: int = 0) -> Callable[[Geometry], AlphaMask]:
    """A mask: the first ``count`` triangles get a chequerboard over x and y with fields of length ``side``. A corner of
    the board is at the origin. ``turned``: the last ``turned`` of these triangles have the fields swapped.
    """
    points, faces = mesh[0], np.asarray(mesh[1])
    coordinates = np.zeros((len(faces), 3, 2), dtype=np.float32)
    coordinates[:count] = points[faces[:count]][..., :2] / (2 * side)
    coordinates[count - turned : count, :, 0] += 0.5
    return lambda geometry: AlphaMask(first(count)(geometry), coordinates, np.eye(2, dtype=np.uint8))


def first(count: int) -> Callable[[Geometry], U8]:
    """The rule that chooses the first triangles."""
    return lambda geometry: (np.arange(len(geometry.faces)) < count).astype(np.uint8)


@hard("H01", "rays on the borders of texels", f"{EITHER_SIDE}, and differs from method to method")
@hard("H01b", "rays within rounding of borders", "coordinates interpolated in float32", scale=1e-3)
def on_borders(scale: float = 1.0) -> Trial:
    """Every ray meets the common corner of four texels; exactly, if the scale is a power of two."""
    mesh, stated = plane(2, -1, 1.5), Counts(256) if scale == 1.0 else None
    return view(mesh, [], ORIGIN, (0, 0, -1), scale=scale, alpha=chequered(mesh, 1 / 16, 2), stated=stated)


@hard("H06", "coordinates along a border", "a rounding bound that is zero here")
def along_a_border() -> Trial:
    """Texture coordinates exactly on the border between a transparent and an opaque row; nothing is rounded."""
    flags, opaque = np.ones(2, dtype=np.uint8), np.array([[0], [1]], dtype=np.uint8)
    mask = AlphaMask(flags, np.zeros((2, 3, 2), dtype=np.float32), opaque)
    return view(plane(2, -1, 1.5), [], ORIGIN, (0, 0, -1), alpha=lambda geometry: mask, stated=Counts(256))


@hard("H02", "holes in one of two duplicates", "the tie is decided before the hole: rays pass both")
def in_duplicates() -> Trial:
    """Two squares in one place: where one has a hole, the other is opaque. No light passes from behind."""
    mesh = joined(plane(2, -1, 1.5), plane(2, -1, 1.5), plane(2, -3, 8))
    alpha = chequered(mesh, 1 / 4, 4, 2)
    return view(mesh, [(0, 0, -2)], ORIGIN, (0, 0, -1), alpha=alpha, stated=Counts(256, (0,)))


@hard(
    "H03{axis}", "a grate before the light", "any-hit traversal that ends at a hole", axes(), side=1 / 8, shadowed=128
)
@hard("H04", "shadow rays on the borders of texels", EITHER_SIDE, side=1 / 16, shadowed=256)
def grate(side: float, shadowed: int, **place: Any) -> Trial:
    """A grate between light and receivers seen from behind; shadow rays meet texels in the middle or on borders."""
    mesh, stated = joined(plane(2, 2, 1), plane(2, 4, 8)), Counts(256, (shadowed,))
    return view(mesh, [ORIGIN], (0, 0, 8), (0, 0, -1), 0.5, alpha=chequered(mesh, side, 2), stated=stated, **place)


@hard("H05", "a light in a cage", "all of the above, from both sides")
def caged_light() -> Trial:
    """A light inside a perforated ball over a floor, and a light outside that shines through both of its walls."""
    mesh = joined(ball(0.5, (0, 0.6, 0)), FLOOR)
    count = len(mesh[1])
    coordinates = np.broadcast_to(np.array([[0, 0], [3, 0], [0, 3]], dtype=np.float32), (count, 3, 2))

    def mask(geometry: Geometry) -> AlphaMask:
        return AlphaMask(first(count - 2)(geometry), coordinates, np.eye(2, dtype=np.uint8))

    return view(mesh, [(0.1, 0.7, 0.05), (1, 2.5, 0.5)], *BESIDE, alpha=mask)


@hard(
    "M01{axis}", "a hall of mirrors: rays at its edges and corners",
    "a mirrored ray hits its own mirror again, or escapes where two mirrors meet", axes(), half=16.0, lit=72,
)  # fmt: skip
@hard(
    "M02{end}", "a hall of mirrors, {what}",
    "a start moved by a fixed epsilon: too little far from the origin, too much in a small scene",
    rows("end what scale offset", ("", "small", 1e-4, 0.0), ("b", "large", 1e4, 0.0),
         ("c", "far from the origin", 1.0, (1e3, -1e3, 2e3))),
    half=1.0, lit=0,
)  # fmt: skip
def hall(half: float, lit: int, **place: Any) -> Trial:
    """A closed box of mirrors seen from its centre; with ``half`` = 16, rays meet its edges and corners exactly. A
    light outside lights the wall next to it through that wall's plane: 72 of 256 rays meet this wall.
    """
    lights, stated = [(0.5, 0.25, 0.75), (0, 4, 0)], Counts(256, (0, 256 - lit))
    return view(box(-1, 1), lights, ORIGIN, (0, 0, -1), half, mirror=first(12), bounces=3, stated=stated, **place)


@hard(
    "M03{end}", "a mirror at a slant, scaled by {scale:g}",
    "the start lies in the mirror's plane as float32 has it, and its ray runs along it",
    rows("end scale", ("", 1.0), ("b", 1e-3)),
)  # fmt: skip
def at_a_slant(**place: Any) -> Trial:
    """A wide mirror just below the eye, and balls on it that touch their reflections."""
    back = quad((-8, -1, -16), (8, -1, -16), (8, 3, -16), (-8, 3, -16))
    mesh = joined(plane(1, 0, 64), ball(0.5, (0, 0.5, -4)), ball(0.25, (1.25, 0.25, -3)), back)
    return view(mesh, [(2, 3, -1)], (0, 1 / 64, 0), (0, 0, -1), 0.5, mirror=first(2), bounces=2, **place)


@hard("M04", "two mirrors in one place", "only the mirror that was hit is excluded, and the ray hits its duplicate")
def duplicates() -> Trial:
    """Two mirrors in one place with opposite orientation: a ray that starts on one starts on both."""
    square = plane(2, -1, 3)
    mesh = joined(square, quad(*square[0][::-1]), plane(2, 3, 16))
    return view(mesh, [(0, 0, 2)], ORIGIN, (0, 0, -1), mirror=first(4), bounces=2, stated=Counts(256, (0,)))


@hard("M05", "a shadow that only a mirror shows", "shadow rays that start at primary hits, not at mirrored ones")
def behind_the_eye() -> Trial:
    """A square and its shadow on a wall, both visible only in a mirror."""
    mesh = joined(plane(2, -1, 4), plane(2, 2, 1), plane(2, 4, 16))
    return view(mesh, [(0, 0, 1)], ORIGIN, (0, 0, -1), 0.5, mirror=first(2), bounces=1, stated=Counts(256, (0,)))


@hard("M06", "splinters of mirrors", "surfaces that cross where a ray starts")
def splinters() -> Trial:
    """Intersecting triangles of all sizes, all mirrors: rays start next to the triangles that cross them."""
    return view(soup(4, 200, 0.5), [(2, 3, 1)], (0, 0, 3), (0, 0, -1), 0.5, mirror=first(200), bounces=3)
