"""Exact hits and decisions in integers: which of a few triangles a ray, or a segment to a light, intersects. Of
triangles with holes, a hit counts if a texel that contains it, border included, is opaque: :mod:`.scene.alpha`'s rule
without rounding.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import F32, F64, I32, U8, Bools, Ints
from ..scene.scene import AlphaMask
from . import arithmetic as exact
from .candidates import Lists
from .distances import plane_numbers

Ratio = tuple[int, int]


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


@dataclass(eq=False)
class Hits:
    """Exact closest hits of n rays.

    triangle  int32 [n]: the lowest index of the tie set, -1 at a miss
    t         float64 [n]: the exact t rounded once, inf at a miss
    ratio     the exact t of each ray as (numerator, denominator), None at a miss
    ties      the whole tie set of each ray in ascending order, () at a miss
    """

    origins: F32
    directions: F32
    triangle: I32
    t: F64
    ratio: list[tuple[int, int] | None]
    ties: list[tuple[int, ...]]

    def __len__(self) -> int:
        return len(self.triangle)

    @cached_property
    def points(self) -> F64:
        """Exact hit points rounded once to float64, shape [n, 3]; NaN at a miss."""
        points = np.full((len(self), 3), np.nan)
        rows = np.nonzero(self.triangle >= 0)[0]
        for i, scale, ints in zip(
            rows, *exact.whole_rows(np.hstack([self.origins[rows], self.directions[rows]])), strict=True
        ):
            ratio = self.ratio[i]
            assert ratio is not None
            over, under = ratio
            shift = under << scale if scale > 0 else under
            grow = 1 if scale > 0 else 1 << -scale
            points[i] = [(ints[j] * under + ints[3 + j] * over) * grow / shift for j in range(3)]
        return points

    def take(self, rows: Ints) -> Hits:
        """The hits of some of the rays."""
        return Hits(
            self.origins[rows], self.directions[rows], self.triangle[rows], self.t[rows],
            [self.ratio[i] for i in rows], [self.ties[i] for i in rows],
        )  # fmt: skip

    def put(self, i: int, found: list[tuple[int, int, int]]) -> None:
        """Set ray ``i`` to the nearest of exact hits, given as (numerator of t, denominator, triangle)."""
        over, under, _ = found[0]
        ties: list[int] = []
        for a, b, k in found:
            order = a * under - over * b
            if order < 0:
                over, under, ties = a, b, [k]
            elif order == 0:
                ties.append(k)
        ties.sort()
        self.triangle[i], self.t[i] = ties[0], over / under
        self.ratio[i], self.ties[i] = (over, under), tuple(ties)


@dataclass(frozen=True, eq=False)
class Exact:
    """The exact answers to n rays. ``occluders`` int32 [lights, n]: -1 if lit, or if the light has no shadow rays."""

    hits: Hits
    occluders: I32

    def take(self, rows: Ints) -> Exact:
        """The answers to some of the rays."""
        return Exact(self.hits.take(rows), self.occluders[:, rows])


class Decisions:
    """Exact decisions on one mesh at one moment. ``points`` float32 [v, 3], ``faces`` int32 [n, 3]."""

    def __init__(self, points: F32, faces: I32, holes: Holes):
        self.points, self.faces, self.holes = points, faces, holes

    def hits(self, origins: F32, directions: F32, candidates: Lists) -> list[list[tuple[int, int, int]]]:
        """For each ray, the exact (numerator, denominator, triangle) of those of its candidates that it hits, holes left
        out.

        origins, directions  [n, 3]
        """
        found: list[list[tuple[int, int, int]]] = [[] for _ in range(len(candidates))]
        ray = candidates.of
        corners = self.points[self.faces[candidates.found]].reshape(-1, 9)
        rows = exact.whole_rows(np.concatenate([origins[ray], directions[ray], corners], axis=1))[1]
        for i, k, ints in zip(ray.tolist(), candidates.found.tolist(), rows, strict=True):
            ratio = exact.hit(ints[0:3], ints[3:6], ints[6:15])
            if ratio is not None and self._seen(k, ints[0:3], ints[3:6], ints[6:15]):
                found[i].append((*ratio, k))
        return found

    def through(self, o: F32, d: F32, triangle: int) -> list[float]:
        """The t at which a ray exactly meets a triangle, through a hole of it or not; empty where it does not."""
        _, ints = exact.integers(o, d, self.points[self.faces[triangle]])
        ratio = exact.hit(ints[0:3], ints[3:6], ints[6:15])
        return [] if ratio is None else [ratio[0] / ratio[1]]

    def on_plane(self, o: F32, d: F32, triangle: int) -> float:
        """The t > 0 at which a ray meets the plane of a triangle; 0 where it does not."""
        _, ints = exact.integers(o, d, self.points[self.faces[triangle]])
        ratio = exact.on_plane(ints[0:3], ints[3:6], ints[6:15])
        return 0.0 if ratio is None else ratio[0] / ratio[1]

    def between(self, o: F32, d: F32, ratio: Ratio | None, light: F32, triangles: I32, holes: bool = True) -> list[int]:
        """The triangles that exactly meet the open segment from o + ratio d to the light; none without ``ratio``.
        ``holes``: whether a segment may pass through a hole; otherwise it meets the triangle there too.
        """
        if ratio is None or not len(triangles):
            return []
        _, ints = exact.integers(o, d, light, self.points[self.faces[triangles]])
        over, under = ratio
        p = [ints[i] * under + ints[3 + i] * over for i in range(3)]
        rest = [x * under for x in ints[6:]]
        place = rest[:3]
        way = [x - y for x, y in zip(place, p, strict=True)]
        met = []
        for j, k in enumerate(triangles.tolist()):
            corners = rest[3 + 9 * j : 12 + 9 * j]
            if exact.between(p, place, corners) and (not holes or self._seen(k, p, way, corners)):
                met.append(k)
        return met

    def _seen(self, k: int, o: exact.Whole, d: exact.Whole, corners: exact.Whole) -> bool:
        return not self.holes.has(k) or self.holes.counts(k, exact.hit_weights(o, d, corners))
