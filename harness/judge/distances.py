"""Distances of rays and segments from triangles: in float64 where that suffices, exactly elsewhere.

They are compared with :func:`.arithmetic.edge_bound`, 2^-20 of the coordinates near the ray. Float64 knows them to 2^-46 of
the farthest corner, so it suffices unless corners are :data:`FAR` times as far away as what the ray passes. There they are
found in rational numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from .arithmetic import F64

EDGES = ((0, 1), (1, 2), (2, 0))

FAR = 2.0**20
"""Distance of a corner, in units of the largest coordinate near the ray, from which on distances are rational: float64 is
then right to 2^-6 of the bound."""

Point = tuple[Fraction, Fraction, Fraction]
Reached = tuple[Fraction, Fraction]
"""The square of a distance, and the share of the way where it is reached."""


def _dots(p: F64, q: F64) -> F64:
    return np.einsum("ij,ij->i", p, q)


def nearest_on_segment(x: F64, p: F64, q: F64) -> tuple[F64, F64]:
    """Distances [n] of points to closed segments pq, and the shares of pq where they are reached."""
    along = q - p
    length = _dots(along, along)
    share = np.clip(_dots(x - p, along) / np.where(length > 0, length, 1.0), 0.0, 1.0)
    return np.linalg.norm(x - p - share[:, None] * along, axis=1), share


def segment_to_segment(p: F64, q: F64, a: F64, b: F64) -> tuple[F64, F64]:
    """Distances [n] of closed segments pq and ab, and the shares of pq where they are reached.

    The nearest pair holds an end of one of them, or lies inside both.
    """
    zero, one = np.zeros(len(p)), np.ones(len(p))
    choices = [
        (nearest_on_segment(p, a, b)[0], zero),
        (nearest_on_segment(q, a, b)[0], one),
        nearest_on_segment(a, p, q),
        nearest_on_segment(b, p, q),
    ]
    d, e, r = q - p, b - a, a - p
    normal = np.cross(d, e)
    size = _dots(normal, normal)
    safe = np.where(size > 0, size, 1.0)
    s, t = _dots(np.cross(r, e), normal) / safe, _dots(np.cross(r, d), normal) / safe
    inner = (size > 0) & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    choices.append((np.where(inner, np.abs(_dots(r, normal)) / np.sqrt(safe), np.inf), s))
    return _nearest(choices)


def _nearest(choices: Sequence[tuple[F64, F64]]) -> tuple[F64, F64]:
    distances, shares = (np.stack(column) for column in zip(*choices, strict=True))
    row, columns = distances.argmin(axis=0), np.arange(distances.shape[1])
    return distances[row, columns], shares[row, columns]


def edge_distance(p: F64, q: F64, triangles: F64) -> tuple[F64, F64]:
    """Distances [n] of segments pq [n, 3] from the nearest edge of their triangles [n, 3, 3], and the shares."""
    return _settled(p, q, triangles, _edges(p, q, triangles), True)


def _edges(p: F64, q: F64, triangles: F64) -> tuple[F64, F64]:
    return _nearest([segment_to_segment(p, q, triangles[:, i], triangles[:, j]) for i, j in EDGES])


def plane_distance(x: F64, triangles: F64) -> F64:
    """Distances [n] of points [n, 3] from the planes of their triangles [n, 3, 3]; inf where the plane is not defined in
    float64."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(normal, axis=1)
    away = np.abs(_dots(x - triangles[:, 0], normal))
    result = np.where(size > 0, away / np.where(size > 0, size, 1.0), np.inf)
    for i in _far(x, x, triangles):
        result[i] = _root(_to_plane(_exactly(x[i]), [_exactly(corner) for corner in triangles[i]], False))
    return result


def face_distance(x: F64, triangles: F64) -> F64:
    """Distance [n] of points from the inside of a triangle: inf where the foot of the point lies outside it."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    sides = [_dots(np.cross(q - p, x - p), normal) for p, q in ((a, b), (b, c), (c, a))]
    return np.where(np.min(sides, axis=0) >= 0, plane_distance(x, triangles), np.inf)


def triangle_distance(p: F64, q: F64, triangles: F64) -> tuple[F64, F64]:
    """Distances [n] of segments from triangles that they do not cross, and the shares of pq where reached."""
    ends = [(face_distance(p, triangles), np.zeros(len(p))), (face_distance(q, triangles), np.ones(len(p)))]
    return _settled(p, q, triangles, _nearest([*ends, _edges(p, q, triangles)]), False)


def _settled(p: F64, q: F64, triangles: F64, found: tuple[F64, F64], edges_only: bool) -> tuple[F64, F64]:
    """Distances and shares, exact where float64 does not suffice."""
    distances, shares = found
    for i in _far(p, p + shares[:, None] * (q - p), triangles):
        distances[i], shares[i] = _exact_distance(p[i], q[i], triangles[i], edges_only)
    return distances, shares


# --- exactly ------------------------------------------------------------------------------------------------


def _far(p: F64, passed: F64, triangles: F64) -> NDArray[np.intp]:
    """The rows whose triangles [n, 3, 3] have corners far from what is passed near them."""
    near = np.maximum(np.abs(p), np.abs(passed)).max(axis=1)
    return np.nonzero(np.abs(triangles).max(axis=(1, 2)) > FAR * near)[0]


def _exactly(values: F64) -> Point:
    x, y, z = (Fraction(float(one)) for one in values)
    return x, y, z


def _minus(p: Point, q: Point) -> Point:
    return p[0] - q[0], p[1] - q[1], p[2] - q[2]


def _dot(p: Point, q: Point) -> Fraction:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def _cross(p: Point, q: Point) -> Point:
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


def _along(p: Point, share: Fraction, way: Point) -> Point:
    return p[0] + share * way[0], p[1] + share * way[1], p[2] + share * way[2]


def _to_segment(x: Point, p: Point, q: Point) -> Reached:
    way = _minus(q, p)
    square = _dot(way, way)
    share = min(max(_dot(_minus(x, p), way) / square, Fraction(0)), Fraction(1)) if square else Fraction(0)
    apart = _minus(x, _along(p, share, way))
    return _dot(apart, apart), share


def _to_edge(p: Point, q: Point, a: Point, b: Point) -> Reached:
    """:func:`segment_to_segment`."""
    choices = [
        (_to_segment(p, a, b)[0], Fraction(0)),
        (_to_segment(q, a, b)[0], Fraction(1)),
        _to_segment(a, p, q),
        _to_segment(b, p, q),
    ]
    d, e, r = _minus(q, p), _minus(b, a), _minus(a, p)
    normal = _cross(d, e)
    size = _dot(normal, normal)
    if size:
        s, t = _dot(_cross(r, e), normal) / size, _dot(_cross(r, d), normal) / size
        if 0 < s < 1 and 0 < t < 1:
            choices.append((_dot(r, normal) ** 2 / size, s))
    return min(choices)


def _to_plane(x: Point, triangle: Sequence[Point], inside: bool) -> Fraction | None:
    """The square of a distance from a plane; None where there is no plane, or ``inside`` finds the foot beyond an edge."""
    a, b, c = triangle
    normal = _cross(_minus(b, a), _minus(c, a))
    size = _dot(normal, normal)
    if not size:
        return None
    sides = (_dot(_cross(_minus(q, p), _minus(x, p)), normal) for p, q in ((a, b), (b, c), (c, a)))
    if inside and min(sides) < 0:
        return None
    return _dot(_minus(x, a), normal) ** 2 / size


def _root(square: Fraction | None) -> float:
    """The root of a square that float64 may not hold."""
    if square is None:
        return math.inf
    if not square:
        return 0.0
    shift = (square.numerator.bit_length() - square.denominator.bit_length()) // 2
    return math.ldexp(math.sqrt(square / Fraction(4) ** shift), shift)


def _exact_distance(p: F64, q: F64, triangle: F64, edges_only: bool) -> tuple[float, float]:
    start, end = _exactly(p), _exactly(q)
    corners = [_exactly(corner) for corner in triangle]
    choices = [_to_edge(start, end, corners[i], corners[j]) for i, j in EDGES]
    if not edges_only:
        ends = ((_to_plane(x, corners, True), share) for x, share in ((start, 0), (end, 1)))
        choices += [(square, Fraction(share)) for square, share in ends if square is not None]
    square, share = min(choices)
    return _root(square), float(share)
