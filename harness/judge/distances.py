"""Distances of rays and segments from triangles, and where rays meet their planes: in float64 where that suffices, in
rational numbers elsewhere.

Distances are compared with :func:`.arithmetic.edge_bound`, 2^-20 of the coordinates near the ray. Float64 knows them to
2^-46 of the farthest corner, so it suffices unless corners are :data:`FAR` times as far away as what the ray passes. The
formulas are the same for both: arrays hold float64 numbers, or fractions as objects. Until the end they are squares.
"""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import F64
from . import arithmetic as exact
from .arithmetic import edge_bound

EDGES = ((0, 1), (1, 2), (2, 0))

FAR = 2.0**20
"""Distance of a corner, in units of the largest coordinate near the ray, from which on distances are rational: float64 is
then right to 2^-6 of the bound.
"""

Numbers = NDArray[Any]
Reached = tuple[Numbers, Numbers]  # squares of distances [n], and the shares of the way where they are reached

ROUNDING = 2.0**-49  # error in float64 of a triple product of differences of float32 numbers, in units of its terms
SURE = 2.0**-30  # float64 suffices up to this error of t (relative), u and v: 2^-12 of what is allowed of an answer


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
    pair holds an end of one of them, or lies inside both.
    """
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
    """Squares of distances of points from planes; inf without a plane, or ``inside`` and the foot beyond an edge."""
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


def plane_numbers(corners: F64, o: F64, d: F64) -> tuple[F64, F64, F64, F64]:
    """t, u, v and the slope n . d (n the unit normal) of rays on the planes of their triangles. corners [n, 3, 3], o
    and d [n, 3], all float32 numbers; results [n], not finite where a ray is coplanar.
    """
    a, e, f = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e, f)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        area = np.linalg.norm(normal, axis=1)
        under, over = np.einsum("ij,ij->i", normal, d), np.einsum("ij,ij->i", normal, a - o)
        slope = under / area
        t = over / under
        p = o + t[:, None] * d - a
        u = np.einsum("ij,ij->i", np.cross(p, f), normal) / area**2
        v = np.einsum("ij,ij->i", np.cross(e, p), normal) / area**2
        edges = np.linalg.norm(e, axis=1) * np.linalg.norm(f, axis=1)
        doubt = np.abs(edges * np.linalg.norm(d, axis=1) / under) + np.abs(edges * np.linalg.norm(a - o, axis=1) / over)
        sure = ROUNDING * np.maximum(doubt, edges / area) <= SURE
    for i in np.nonzero(~sure)[0]:
        t[i], u[i], v[i], slope[i] = _exactly(corners[i], o[i], d[i])
    return t, u, v, slope


def _exactly(corners: F64, o: F64, d: F64) -> tuple[float, float, float, float]:
    """:func:`plane_numbers` of one ray, each exact and rounded once but for the root in the slope."""
    values = np.concatenate([o, d, corners.ravel()]).astype(np.float32)
    if not np.isfinite(values).all():
        return math.nan, math.nan, math.nan, math.nan
    scale, ints = exact.integers(values)
    origin, way, triangle = ints[0:3], ints[3:6], ints[6:15]
    weights = exact.hit_weights(origin, way, triangle)
    normal, height = exact.plane_of(origin, triangle)
    under, longest = exact.dot(normal, way), max(map(abs, normal))
    if not under:
        return math.nan, math.nan, math.nan, 0.0
    unit = math.hypot(*(n / longest for n in normal))
    all_weights = sum(weights)
    slope = under / (longest << max(scale, 0)) * 2.0 ** max(-scale, 0) / unit
    return height / under, weights[1] / all_weights, weights[2] / all_weights, slope


def beside_off_the_eye(o: F64, d: F64, t: float, corners: F64) -> bool:
    """Whether o + t d of a triangle's plane is within its bound, and off the eye. o, d [3], corners [1, 3, 3]."""
    met = (o + t * d)[None]
    limit = edge_bound(o[None], met)[0]
    return bool(triangle_distance(met, met, corners)[0][0] <= limit < t * np.linalg.norm(d))
