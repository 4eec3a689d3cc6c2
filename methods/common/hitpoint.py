"""Float64 distance of a hit, given the triangle that was hit."""

from __future__ import annotations

import warp as wp

from .triangle import to_float64


@wp.func
def plane_distance(o: wp.vec3f, d: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.float64:
    """t of the ray on the triangle's plane, without asking whether it lies inside."""
    a64 = to_float64(a)
    n = wp.cross(to_float64(b) - a64, to_float64(c) - a64)
    return wp.dot(n, a64 - to_float64(o)) / wp.dot(n, to_float64(d))
