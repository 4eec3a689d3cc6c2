"""Distances of rays and segments from triangles: in float64 where that suffices, in rational numbers elsewhere.

They are compared with :func:`.arithmetic.edge_bound`, 2^-20 of the coordinates near the ray. Float64 knows them to 2^-46 of
the farthest corner, so it suffices unless corners are :data:`FAR` times as far away as what the ray passes. The formulas
are the same for both: arrays hold float64 numbers, or fractions as objects. Until the end distances are squares.
"""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import F64

EDGES = ((0, 1), (1, 2), (2, 0))

FAR = 2.0**20
"""Distance of a corner, in units of the largest coordinate near the ray, from which on distances are rational: float64 is
then right to 2^-6 of the bound."""

Numbers = NDArray[Any]
Reached = tuple[Numbers, Numbers]  # squares of distances [n], and the shares of the way where they are reached


def plane_distance(x: F64, triangles: F64) -> F64:
    """Distances [n] of points [n, 3] from the planes of their triangles [n, 3, 3]; inf where there is no plane."""
    return _settled(lambda p, q, t: (_to_plane(p, t, False), np.zeros(len(p))), x, x, triangles)[0]


def edge_distance(p: F64, q: F64, triangles: F64) -> tuple[F64, F64]:
    """Distances [n] of segments pq [n, 3] from the nearest edge of their triangles [n, 3, 3], and the shares."""
    return _settled(_to_edges, p, q, triangles)


def triangle_distance(p: F64, q: F64, triangles: F64) -> tuple[F64, F64]:
    """Distances [n] of segments from triangles that they do not cross, and the shares of pq where reached."""
    return _settled(_to_triangles, p, q, triangles)


def _settled(
    measure: Callable[[Numbers, Numbers, Numbers], Reached], p: F64, q: F64, triangles: F64
) -> tuple[F64, F64]:
    """Distances and shares by ``measure``, in fractions where corners are far from what is passed near them."""
    squares, shares = measure(p, q, triangles)
    distances = np.sqrt(squares)
    near = np.maximum(np.abs(p), np.abs(p + shares[:, None] * (q - p))).max(axis=1)
    far = np.nonzero(np.abs(triangles).max(axis=(1, 2)) > FAR * near)[0]
    if len(far):
        exact_squares, exact_shares = measure(*(_fractions(part[far]) for part in (p, q, triangles)))
        distances[far], shares[far] = ([_root(square) for square in exact_squares], exact_shares.astype(np.float64))
    return distances, shares


_fractions = np.vectorize(Fraction, otypes=[object])


def _root(square: Fraction | float) -> float:
    """The root of a square that float64 may not hold."""
    if not square or square == math.inf:
        return float(square)
    exact = Fraction(square)
    shift = (exact.numerator.bit_length() - exact.denominator.bit_length()) // 2
    return math.ldexp(math.sqrt(exact / Fraction(4) ** shift), shift)


def _dots(p: Numbers, q: Numbers) -> Numbers:
    return p[:, 0] * q[:, 0] + p[:, 1] * q[:, 1] + p[:, 2] * q[:, 2]


def _over(numbers: Numbers, by: Numbers) -> Numbers:
    """Quotients; of 0 the number itself."""
    return numbers / np.where(by > 0, by, 1)


def _nearest(choices: Sequence[Reached]) -> Reached:
    squares, shares = (np.stack(column) for column in zip(*choices, strict=True))
    row, columns = squares.argmin(axis=0), np.arange(squares.shape[1])
    return squares[row, columns], shares[row, columns]


def point_to_segment(x: Numbers, p: Numbers, q: Numbers) -> Reached:
    """Squares of the distances of points from closed segments pq, and the shares of pq where they are reached."""
    along = q - p
    share = np.minimum(np.maximum(_over(_dots(x - p, along), _dots(along, along)), 0), 1)
    apart = x - p - share[:, None] * along
    return _dots(apart, apart), share


def segment_to_segment(p: Numbers, q: Numbers, a: Numbers, b: Numbers) -> Reached:
    """Squares of the distances of closed segments pq and ab, and the shares of pq where they are reached. The nearest
    pair holds an end of one of them, or lies inside both."""
    zero = np.zeros(len(p), dtype=p.dtype)
    ends = [(point_to_segment(p, a, b)[0], zero), (point_to_segment(q, a, b)[0], zero + 1)]
    d, e, r = q - p, b - a, a - p
    normal = np.cross(d, e)
    size = _dots(normal, normal)
    s, t = (_over(_dots(np.cross(r, way), normal), size) for way in (e, d))
    inner = (size > 0) & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    inside = np.where(inner, _over(_dots(r, normal) ** 2, size), math.inf), s
    return _nearest([*ends, point_to_segment(a, p, q), point_to_segment(b, p, q), inside])


def _to_edges(p: Numbers, q: Numbers, triangles: Numbers) -> Reached:
    return _nearest([segment_to_segment(p, q, triangles[:, i], triangles[:, j]) for i, j in EDGES])


def _to_plane(x: Numbers, triangles: Numbers, inside: bool) -> Numbers:
    """Squares of the distances of points from planes; inf where there is no plane, or ``inside`` and the foot of the point
    lies beyond an edge."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    size = _dots(normal, normal)
    known = size > 0
    if inside:
        sides = [_dots(np.cross(q - p, x - p), normal) for p, q in ((a, b), (b, c), (c, a))]
        known &= np.min(sides, axis=0) >= 0
    return np.where(known, _over(_dots(x - a, normal) ** 2, size), math.inf)


def _to_triangles(p: Numbers, q: Numbers, triangles: Numbers) -> Reached:
    zero = np.zeros(len(p), dtype=p.dtype)
    ends = [(_to_plane(p, triangles, True), zero), (_to_plane(q, triangles, True), zero + 1)]
    return _nearest([*ends, _to_edges(p, q, triangles)])
