"""Where shadow rays start: the hit point, to be rounded to float32.

The answers do not depend on it: what a shadow ray leaves in doubt is decided from the hit point itself
(:func:`..common.hitpoint.hit_point`). So it may be off by what the bound of :mod:`.records` leaves room for.
"""

from __future__ import annotations

import warp as wp

from ...harness.frame.geometry import Corners, Ray
from ..common.hitpoint import STEEP, along
from ..common.triangle import largest, to_float64, total

LEAST_SIZE = wp.constant(1.0e-30)


@wp.func
def is_vague(ray: Ray, corners: Corners) -> wp.bool:
    """:func:`..common.hitpoint.is_vague`, with sizes in float32, which is not trusted with very small ones."""
    d = to_float64(ray.direction)
    a = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a, to_float64(corners.c) - a)
    size = largest(corners.b - corners.a) * largest(corners.c - corners.a) * total(ray.direction)
    return not (wp.abs(wp.dot(n, d)) > STEEP * wp.float64(size) and size > LEAST_SIZE)


@wp.func
def start_point(ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    """:func:`..common.hitpoint.steep_hit_point`, but led back from the first corner, not from the nearest.

    The step is right to 2^-28 of the way to the corner (:func:`is_vague`), which is at most 2 M long where all coordinates
    of the scene are at most M: the point is off by 2^-27 M.
    """
    d = to_float64(ray.direction)
    a = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a, to_float64(corners.c) - a)
    p = along(ray, t)
    return p - d * (wp.dot(n, p - a) / wp.dot(n, d))
