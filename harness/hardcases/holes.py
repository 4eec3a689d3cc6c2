"""Triangles with holes: rays on the borders of texels, holes in duplicate triangles, and light through holes.

The bitmap is a chequerboard over x and y, so that rays through pixel centres meet texels exactly on their borders, or in
their middle.
"""

from collections.abc import Callable

import numpy as np

from ..scene.scene import AlphaMask, Geometry
from .case import Counts, Trial, axes, hard, view
from .shapes import Mesh, ball, joined, plane, quad

Mask = Callable[[Geometry], AlphaMask]

EITHER_SIDE = "the texel of a rounded coordinate lies on either side"


def chequered(mesh: Mesh, side: float, count: int, turned: int = 0) -> Mask:
    """A mask: the first ``count`` triangles get a chequerboard over x and y with fields of length ``side``.

    A corner of the board is at the origin. ``turned``: the last ``turned`` of these triangles have the fields swapped.
    """
    points, faces = mesh[0], np.asarray(mesh[1])
    coordinates = np.zeros((len(faces), 3, 2), dtype=np.float32)
    coordinates[:count] = points[faces[:count]][..., :2] / (2 * side)
    coordinates[count - turned : count, :, 0] += 0.5
    flags = (np.arange(len(faces)) < count).astype(np.uint8)
    return lambda geometry: AlphaMask(flags, coordinates, np.eye(2, dtype=np.uint8))


def square(z: float, half: float) -> Mesh:
    return quad((-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z))


@hard("H01", "rays on the borders of texels", f"{EITHER_SIDE}, and differs from method to method", scale=1.0)
@hard("H01b", "rays within rounding of borders", "coordinates interpolated in float32", scale=1e-3)
def on_borders(scale: float) -> Trial:
    """Every ray meets the common corner of four texels; exactly, if the scale is a power of two."""
    mesh = square(-1, 1.5)
    return view(
        mesh, [], (0, 0, 0), (0, 0, -1), 1.0, scale=scale, alpha=chequered(mesh, 1 / 16, 2),
        stated=Counts(256) if scale == 1.0 else None,
    )  # fmt: skip


@hard("H06", "coordinates along a border", "a rounding bound that is zero here")
def along_a_border() -> Trial:
    """Texture coordinates exactly on the border between a transparent and an opaque row; nothing is rounded."""
    mesh = square(-1, 1.5)
    flags, opaque = np.ones(2, dtype=np.uint8), np.array([[0], [1]], dtype=np.uint8)
    mask = AlphaMask(flags, np.zeros((2, 3, 2), dtype=np.float32), opaque)
    return view(mesh, [], (0, 0, 0), (0, 0, -1), 1.0, alpha=lambda geometry: mask, stated=Counts(256))


@hard("H02", "holes in one of two duplicates", "the tie is decided before the hole: rays pass both")
def in_duplicates() -> Trial:
    """Two squares in one place: where one has a hole, the other is opaque. No light passes from behind."""
    mesh = joined(square(-1, 1.5), square(-1, 1.5), square(-3, 8))
    return view(
        mesh, [(0, 0, -2)], (0, 0, 0), (0, 0, -1), 1.0, alpha=chequered(mesh, 1 / 4, 4, 2), stated=Counts(256, (0,))
    )


@hard(
    "H03{axis}", "a grate before the light", "any-hit traversal that ends at a hole", axes(), side=1 / 8, shadowed=128
)
@hard("H04", "shadow rays on the borders of texels", EITHER_SIDE, side=1 / 16, shadowed=256)
def grate(side: float, shadowed: int, turn: int = 0) -> Trial:
    """A grate between a light and receivers that are seen from behind; shadow rays meet texels in the middle or on
    borders."""
    mesh = joined(square(2, 1), plane(2, 4, 8))
    return view(
        mesh, [(0, 0, 0)], (0, 0, 8), (0, 0, -1), 0.5, turn=turn, alpha=chequered(mesh, side, 2),
        stated=Counts(256, (shadowed,)),
    )  # fmt: skip


@hard("H05", "a light in a cage", "all of the above, from both sides", fields=6)
def caged_light(fields: int) -> Trial:
    """A light inside a perforated ball over a floor, and a light outside that shines through both of its walls."""
    mesh = joined(ball(0.5, (0, 0.6, 0)), quad((-3, 0, -3), (3, 0, -3), (3, 0, 3), (-3, 0, 3)))
    count = len(mesh[1])
    corners = np.array([[0, 0], [fields / 2, 0], [0, fields / 2]], dtype=np.float32)
    coordinates = np.broadcast_to(corners, (count, 3, 2))
    flags = (np.arange(count) < count - 2).astype(np.uint8)
    return view(
        mesh, [(0.1, 0.7, 0.05), (1, 2.5, 0.5)], (0.3, 1.7, 3.1), (-0.1, -0.45, -1), 0.5,
        alpha=lambda geometry: AlphaMask(flags, coordinates, np.eye(2, dtype=np.uint8)),
    )  # fmt: skip
