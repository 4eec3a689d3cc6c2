"""Exact answers for single rays and triangles in integers, and the one bound that excuses an edge.

Float32 inputs are dyadic rationals: scaled by a common power of two they are integers, and every sign, every
distance t and every tie is exact. Conventions: closed two-sided triangles, t > 0 (an eye exactly on a triangle
does not see it), a coplanar ray is no hit, shadows are judged on the open segment.
"""

from collections.abc import Sequence

import numpy as np

from ..arrays import F32, F64, Floats

Integers = tuple[int, int, int]
Whole = Sequence[int]

UNIT = 2.0**-24  # rounding of a float32 relative to its size
EDGE_UNITS = 16.0  # distance from an exact edge, in these units, of rays that are excused (a choice; see accuracy.md)


def edge_bound(*points: Floats) -> F64:
    """The one bound that excuses: 16 * 2^-24 of the largest coordinate, in scene units.

    Each argument has shape [n, ..., 3]: the points where rays start, and the points where they pass what they are tested
    against. A float32 test of this ray and this triangle cannot avoid rounding these. The corners of a large triangle do
    not count: a test whose error is the rounding of a distant corner has chosen to start there. Nor does the far end of a
    segment (a light), which would excuse everything where the light is far. Returns [n].
    """
    sizes = [
        np.abs(np.asarray(c, dtype=np.float64)).reshape(len(c), np.size(c[0]) if len(c) else 3).max(axis=1)
        for c in points
    ]
    return EDGE_UNITS * UNIT * np.max(np.stack(sizes), axis=0)


# --- integers -----------------------------------------------------------------------------------------------


def whole_rows(values: F32) -> tuple[list[int], list[list[int]]]:
    """Of each row [n, k] the smallest s (24 bits each) for which all values times 2^s are integers, and these."""
    none = 1 << 16
    exponents = np.where(values != 0, np.frexp(values)[1], none).min(axis=1, initial=none)
    scales = np.where(exponents < none, 24 - exponents, 0)
    scaled = np.ldexp(values.astype(np.float64), scales[:, None])
    return scales.tolist(), [[int(x) for x in row] for row in scaled.tolist()]


def integers(*parts: F32) -> tuple[int, list[int]]:
    """:func:`whole_rows` of all values of some arrays: their scale, and a flat list."""
    scales, rows = whole_rows(np.concatenate([part.ravel() for part in parts])[None])
    return scales[0], rows[0]


def _sub(p: Whole, q: Whole) -> Integers:
    return p[0] - q[0], p[1] - q[1], p[2] - q[2]


def _cross(p: Integers, q: Integers) -> Integers:
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


def dot(p: Whole, q: Whole) -> int:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def weights(d: Whole, a: Integers, b: Integers, c: Integers) -> Integers:
    """Numbers in the ratio of the weights of a, b, c where the line through 0 along ``d`` meets their plane."""
    return dot(d, _cross(c, b)), dot(d, _cross(a, c)), dot(d, _cross(b, a))


def _seen_from(o: Whole, triangle: Whole) -> tuple[Integers, Integers, Integers]:
    """The corners of a triangle of nine integers, seen from a point."""
    return _sub(triangle[0:3], o), _sub(triangle[3:6], o), _sub(triangle[6:9], o)


def hit_weights(o: Whole, d: Whole, triangle: Whole) -> Integers:
    """:func:`weights` of a ray from ``o`` and a triangle of nine integers in one scale."""
    return weights(d, *_seen_from(o, triangle))


def crosses(d: Whole, a: Integers, b: Integers, c: Integers) -> bool:
    """Whether the line through the origin along ``d`` meets the closed triangle (coplanar lines may say yes)."""
    u, v, w = weights(d, a, b, c)
    return not ((u < 0 or v < 0 or w < 0) and (u > 0 or v > 0 or w > 0))


def hit(o: Whole, d: Whole, triangle: Whole) -> tuple[int, int] | None:
    """The exact t of ray o + t d with a triangle (nine integers) as (numerator, denominator) > 0, or None. ``o`` and
    the triangle share one scale; ``d`` may have its own: t is then in the ratio of the two.
    """
    return on_plane(o, d, triangle) if crosses(d, *_seen_from(o, triangle)) else None


def on_plane(o: Whole, d: Whole, triangle: Whole) -> tuple[int, int] | None:
    """As :func:`hit`, on the plane of the triangle, inside it or not."""
    normal, over = plane_of(o, triangle)
    under = dot(normal, d)
    if under < 0:
        over, under = -over, -under
    return (over, under) if under > 0 and over > 0 else None


def plane_of(o: Whole, triangle: Whole) -> tuple[Integers, int]:
    """The normal of a triangle of nine integers, not of unit length, and the height of its plane over ``o`` times that."""
    a, b, c = _seen_from(o, triangle)
    normal = _cross(_sub(b, a), _sub(c, a))
    return normal, dot(normal, a)


def between(p: Whole, light: Whole, triangle: Whole) -> bool:
    """Whether the open segment from ``p`` to ``light`` meets the closed triangle: integers of one scale."""
    normal, near = plane_of(p, triangle)
    far = dot(normal, _sub(light, triangle))
    if near == 0 or far == 0 or (near > 0) != (far > 0):
        return False
    return crosses(_sub(light, p), *_seen_from(p, triangle))
