"""A second judge, written from the contract alone: closest hits, ties and shadow bits in rational arithmetic.

It shares no code and no formula with ``harness.judge``. That one tests signs of edge functions of integers; this one
cuts the ray with the plane of a triangle, which gives a rational point, and looks in the plane whether the triangle
holds it. What it needs from the contract (docs/accuracy.md, "What exact means here"): float32 inputs have exact values;
triangles are closed and two-sided; one without area, or with a coordinate that is not finite, is never hit; a ray in a
plane does not hit it; t > 0; of equal t the lowest index, all of them are the tie set; a shadow is a triangle that
meets the open segment from the exact hit point to the light, and one whose plane holds either end does not.

A float64 filter with wide bounds (:data:`SLACK`) leaves out what is missed for certain; it can only lose hits, which a
comparison would show.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Point = tuple[Fraction, Fraction, Fraction]

SLACK = 2.0**-40
"""Share of a sum of sizes that the filter grants to rounding: thousands of times what float64 needs."""

PAIRS = 1 << 19
"""Pairs of ray and triangle that the filter looks at together."""


def exactly(values: Sequence[float] | NDArray) -> Point:
    x, y, z = (Fraction(float(one)) for one in values)
    return x, y, z


def minus(p: Point, q: Point) -> Point:
    return p[0] - q[0], p[1] - q[1], p[2] - q[2]


def dot(p: Point, q: Point) -> Fraction:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def along(p: Point, share: Fraction, way: Point) -> Point:
    return p[0] + share * way[0], p[1] + share * way[1], p[2] + share * way[2]


@dataclass(frozen=True)
class Bitmap:
    """Holes of a mesh: ``masked`` [n], texture coordinates [n, 3, 2], ``opaque`` [rows, columns]."""

    masked: NDArray[np.uint8]
    coordinates: NDArray[np.float32]
    opaque: NDArray[np.uint8]

    def counts(self, triangle: int, weights: Sequence[Fraction]) -> bool:
        """Whether any texel that holds the interpolated coordinates, its border included, is opaque."""
        if not self.masked[triangle]:
            return True
        places = []
        for axis, size in ((0, self.opaque.shape[1]), (1, self.opaque.shape[0])):
            at = size * sum(
                weight * Fraction(float(self.coordinates[triangle, corner, axis]))
                for corner, weight in enumerate(weights)
            )
            texel = math.floor(at)
            places.append({texel % size, (texel - 1) % size} if at == texel else {texel % size})
        return any(self.opaque[row, column] for row in places[1] for column in places[0])


@dataclass(frozen=True)
class Flat:
    """A triangle with area: corners, normal, and the two axes onto which it is projected."""

    corners: tuple[Point, Point, Point]
    normal: Point
    axes: tuple[int, int]

    @staticmethod
    def of(corners: NDArray[np.float32]) -> Flat | None:
        """None for a triangle that is never hit."""
        if not np.isfinite(corners).all():
            return None
        a, b, c = (exactly(corner) for corner in corners)
        e, f = minus(b, a), minus(c, a)
        normal = (e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0])
        steepest = max(range(3), key=lambda k: abs(normal[k]))
        if normal[steepest] == 0:
            return None
        return Flat((a, b, c), normal, ((steepest + 1) % 3, (steepest + 2) % 3))

    def side(self, p: Point) -> Fraction:
        """Positive on one side of the plane, 0 on it."""
        return dot(self.normal, minus(p, self.corners[0]))

    def weights(self, p: Point) -> tuple[Fraction, Fraction, Fraction] | None:
        """Weights of the corners at a point of the plane; None outside the closed triangle."""
        x, y = self.axes
        flat = [(q[x] - p[x], q[y] - p[y]) for q in self.corners]
        areas = [
            flat[(k + 1) % 3][0] * flat[(k + 2) % 3][1] - flat[(k + 1) % 3][1] * flat[(k + 2) % 3][0] for k in range(3)
        ]
        whole = sum(areas)
        if any(area * whole < 0 for area in areas):
            return None
        return areas[0] / whole, areas[1] / whole, areas[2] / whole


@dataclass(frozen=True)
class Seen:
    """The closest hit of a ray: t, the ties in ascending order, the point, and the weights of the first's corners."""

    t: Fraction
    ties: tuple[int, ...]
    point: Point
    weights: tuple[Fraction, Fraction, Fraction]


class SecondJudge:
    """Judges rays against float32 ``points`` [v, 3] and ``faces`` [n, 3]; which triangles are hit, it finds itself."""

    def __init__(self, points: NDArray[np.float32], faces: NDArray[np.integer], holes: Bitmap | None = None):
        self.corners = np.asarray(points, dtype=np.float32)[np.asarray(faces).reshape(-1, 3)]
        self.finite = np.nonzero(np.isfinite(self.corners).all(axis=(1, 2)))[0]
        self.holes = holes
        self._flats: dict[int, Flat | None] = {}

    def flat(self, k: int) -> Flat | None:
        """Triangle ``k``, or None where it is never hit."""
        if k not in self._flats:
            self._flats[k] = Flat.of(self.corners[k])
        return self._flats[k]

    def hit(self, o: Point, d: Point, k: int) -> tuple[Fraction, Point, tuple[Fraction, ...]] | None:
        """t, point and weights where the ray meets triangle ``k``, through a hole of it or not; t > 0."""
        flat = self.flat(k)
        slope = dot(flat.normal, d) if flat is not None else 0
        if flat is None or slope == 0:
            return None
        t = -flat.side(o) / slope
        if t <= 0:
            return None
        point = along(o, t, d)
        weights = flat.weights(point)
        return None if weights is None else (t, point, weights)

    def closest(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> list[Seen | None]:
        """The closest hit of each ray; None: it meets nothing. ``origins`` and ``directions`` float32 [n, 3]."""
        seen: list[Seen | None] = []
        for i, candidates in self._near_rays(origins.astype(np.float64), directions.astype(np.float64)):
            o, d = exactly(origins[i]), exactly(directions[i])
            best: Seen | None = None
            for k in candidates.tolist():
                found = self.hit(o, d, k)
                if found is None or not self._counts(k, found[2]):
                    continue
                t, point, weights = found
                if best is None or t < best.t:
                    best = Seen(t, (k,), point, (weights[0], weights[1], weights[2]))
                elif t == best.t:
                    best = Seen(t, (*best.ties, k), point, best.weights)
            seen.append(best)
        return seen

    def shadowed(self, seen: Sequence[Seen | None], light: NDArray[np.float32]) -> list[bool]:
        """Whether each hit point lies in shadow of a point light; False at a miss."""
        bits = [False] * len(seen)
        hits = [i for i, one in enumerate(seen) if one is not None]
        points = np.array([[float(x) for x in seen[i].point] for i in hits]).reshape(-1, 3)  # type: ignore[union-attr]
        place = exactly(light)
        for row, candidates in self._near_segments(points, light.astype(np.float64)):
            one = seen[hits[row]]
            assert one is not None
            bits[hits[row]] = any(self.blocks(one.point, place, k) for k in candidates.tolist())
        return bits

    def blocks(self, point: Point, light: Point, k: int) -> bool:
        """Whether triangle ``k`` meets the open segment from ``point`` to ``light``."""
        flat = self.flat(k)
        if flat is None:
            return False
        here, there = flat.side(point), flat.side(light)
        if here * there >= 0:  # an end in the plane, both in it, or both on one side
            return False
        weights = flat.weights(along(point, here / (here - there), minus(light, point)))
        return weights is not None and self._counts(k, weights)

    def _counts(self, k: int, weights: Sequence[Fraction]) -> bool:
        return self.holes is None or self.holes.counts(k, weights)

    # --- what float64 can leave out for certain ---

    def _near_rays(self, o: F64, d: F64) -> Iterator[tuple[int, NDArray[np.int64]]]:
        corners = self.corners[self.finite].astype(np.float64)
        normal, total = _normals(corners)
        step = max(1, PAIRS // max(1, len(corners)))
        for first in range(0, len(o), step):
            some = slice(first, first + step)
            from_eye = corners[None] - o[some, None, None]
            size = np.abs(corners)[None] + np.abs(o[some, None, None])
            way = np.broadcast_to(d[some, None], from_eye[:, :, 0].shape)
            missed = _crossed(from_eye, size, way, np.abs(way))
            height = np.einsum("nj,mnj->mn", normal, from_eye[:, :, 0])
            slope = d[some] @ normal.T
            doubt = np.einsum("nj,mnj->mn", total, size[:, :, 0]), np.abs(d[some]) @ total.T
            missed |= (height * slope < 0) & (np.abs(height) > doubt[0]) & (np.abs(slope) > doubt[1])
            for row, out in enumerate(missed):
                yield first + row, self.finite[~out]

    def _near_segments(self, p: F64, light: F64) -> Iterator[tuple[int, NDArray[np.int64]]]:
        corners = self.corners[self.finite].astype(np.float64)
        normal, total = _normals(corners)
        there = np.einsum("nj,nj->n", normal, corners[:, 0] - light)
        doubt_there = np.einsum("nj,nj->n", total, np.abs(corners[:, 0]) + np.abs(light))
        step = max(1, PAIRS // max(1, len(corners)))
        for first in range(0, len(p), step):
            some = slice(first, first + step)
            from_point = corners[None] - p[some, None, None]
            size = np.abs(corners)[None] + np.abs(p[some, None, None])
            way = np.broadcast_to((light - p[some])[:, None], from_point[:, :, 0].shape)
            wide = np.broadcast_to((np.abs(light) + np.abs(p[some]))[:, None], way.shape)
            missed = _crossed(from_point, size, way, wide)
            here = np.einsum("nj,mnj->mn", normal, from_point[:, :, 0])
            doubt = np.einsum("nj,mnj->mn", total, size[:, :, 0])
            missed |= (here * there > 0) & (np.abs(here) > doubt) & (np.abs(there) > doubt_there)
            for row, out in enumerate(missed):
                yield first + row, self.finite[~out]


def _normals(corners: F64) -> tuple[F64, F64]:
    """Normals [n, 3] and what they are in doubt by, per component and with the factor of :data:`SLACK`."""
    e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    wide_e, wide_f = (np.abs(corners[:, k]) + np.abs(corners[:, 0]) for k in (1, 2))
    total = np.roll(wide_e, -1, 1) * np.roll(wide_f, 1, 1) + np.roll(wide_e, 1, 1) * np.roll(wide_f, -1, 1)
    return np.cross(e, f), SLACK * total


def _crossed(corners: F64, size: F64, way: F64, wide: F64) -> NDArray[np.bool_]:
    """Lines [m, n] that pass a triangle for certain: two edges have them on opposite sides. Corners are relative."""
    most, least = np.full(way.shape[:2], -1, dtype=np.int8), np.full(way.shape[:2], 1, dtype=np.int8)
    for k in range(3):
        p, q = corners[:, :, k], corners[:, :, (k + 1) % 3]
        value = np.einsum("mnj,mnj->mn", way, np.cross(p, q))
        wide_p, wide_q = size[:, :, k], size[:, :, (k + 1) % 3]
        doubt = np.einsum(
            "mnj,mnj->mn",
            wide,
            np.roll(wide_p, -1, 2) * np.roll(wide_q, 1, 2) + np.roll(wide_p, 1, 2) * np.roll(wide_q, -1, 2),
        )
        sign = np.where(np.abs(value) > SLACK * doubt, np.sign(value), 0).astype(np.int8)
        most, least = np.maximum(most, sign), np.minimum(least, sign)
    return (most > 0) & (least < 0)
