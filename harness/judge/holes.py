"""Triangles with holes in the referee: opacity in integers, and how near a hit lies to the border of a hole.

The rule is :mod:`.scene.alpha`'s, without rounding: a hit counts if a texel that contains it, border included, is opaque.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from ..arrays import F64, U8, Bools, Ints
from ..scene.scene import AlphaMask
from .planes import plane_numbers


class Holes:
    """Opacity of a checked mask; without one every triangle is opaque."""

    def __init__(self, mask: AlphaMask | None):
        self.mask = mask

    def masked(self, triangles: Ints) -> Bools:
        """Which of the triangles [n] have a mask."""
        if self.mask is None:
            return np.zeros(len(triangles), dtype=bool)
        return self.mask.triangles[triangles] != 0

    def has(self, triangle: int) -> bool:
        return self.mask is not None and bool(self.mask.triangles[triangle])

    def counts(self, triangle: int, weights: Sequence[int]) -> bool:
        """Whether a hit counts, exactly: ``weights`` are integers in the ratio of the barycentric ones, sum not 0."""
        if self.mask is None or not self.has(triangle):
            return True
        total = sum(weights)
        rows, columns = self.mask.opaque.shape
        texels = []
        for axis, size in ((1, rows), (0, columns)):
            over, under = 0, 1
            for weight, coordinate in zip(weights, self.mask.coordinates[triangle, :, axis].tolist(), strict=True):
                n, d = coordinate.as_integer_ratio()
                over, under = over * d + weight * n * under, under * d
            texel, rest = divmod(over * size, under * total)
            texels.append((texel % size,) if rest else (texel % size, (texel - 1) % size))
        return any(self.mask.opaque[row, column] for row, column in itertools.product(*texels))

    def within(self, triangles: Ints, corners: F64, o: F64, d: F64, bound: F64) -> tuple[Bools, Bools]:
        """Whether an opaque and whether a transparent texel lies within ``bound`` of the points where rays meet the
        planes.

        triangles [n], corners [n, 3, 3], o and d [n, 3]; bound [n] in scene units, across the ray. A triangle
        without a mask is opaque everywhere.
        """
        opaque, clear = np.ones(len(triangles), dtype=bool), np.zeros(len(triangles), dtype=bool)
        rows = np.nonzero(self.masked(triangles))[0]
        if self.mask is None or not len(rows):
            return opaque, clear
        corners, o, d = corners[rows], o[rows], d[rows]
        _, u, v, slope = plane_numbers(corners, o, d)
        e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = np.linalg.norm(np.cross(e, f), axis=1)
        coordinates = self.mask.coordinates[triangles[rows]].astype(np.float64)
        size = np.array(self.mask.opaque.shape[::-1], dtype=np.float64)
        along = (coordinates[:, 1] - coordinates[:, 0]) * size, (coordinates[:, 2] - coordinates[:, 0]) * size
        place = coordinates[:, 0] * size + u[:, None] * along[0] + v[:, None] * along[1]
        # A weight changes by an edge over twice the area for each unit of length in the plane.
        steep = np.abs(along[0]) * np.linalg.norm(f, axis=1)[:, None]
        steep += np.abs(along[1]) * np.linalg.norm(e, axis=1)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            moved = bound[rows] * np.linalg.norm(d, axis=1) / np.abs(slope)
            reach = steep / area[:, None] * moved[:, None]
        for row, here, far in zip(rows, place, reach, strict=True):
            texels = self._block(here, far)
            opaque[row], clear[row] = bool(texels.any()), not texels.all()
        return opaque, clear

    def _block(self, place: F64, reach: F64) -> U8:
        """The texels that touch the box ``place`` +- ``reach`` (x, y, in texels); all of them where it is not known."""
        assert self.mask is not None
        bitmap = self.mask.opaque
        if not (np.isfinite(place).all() and np.isfinite(reach).all() and (reach < max(bitmap.shape)).all()):
            return bitmap
        first = np.ceil(place - reach - 1.0).astype(np.int64)
        last = np.floor(place + reach).astype(np.int64)
        chosen = [
            np.unique(np.arange(a, b + 1) % size) for a, b, size in zip(first, last, bitmap.shape[::-1], strict=True)
        ]
        return bitmap[np.ix_(chosen[1], chosen[0])]
