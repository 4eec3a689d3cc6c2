"""Hit points in float64: where shadow rays start, by one function for every method.

Shadow tests must allow for the error of a hit point (:func:`hit_error`). Therefore it is bounded relative to the point's
own coordinates, whatever the distance of the eye and the size and shape of the triangle:

- o + t d is rounded once (:func:`fused`), so that it lies off its ray by U of its own size. The error of t moves it along
  the ray, and the step back onto the plane removes that.
- The step onto a plane that the ray meets at an angle of sine s moves a point that lies off its ray by x by x / s. The
  step is as accurate as the normal: 16 U e f w / |n . d| lengths of d, with e, f the edges and w the distance to a
  corner.
- Where either would be too much (:func:`is_flat`), sums and products are carried with their rounding errors (the
  error-free transformations of Knuth and Dekker, the dot product of Ogita, Rump and Oishi 2005), and the point is rounded
  once, at the end.
"""

import warp as wp

from ...harness.frame.digits import fused, lost_in_sum, precise_product, wide_hit_point, wide_side, wide_slope
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Corners, Ray
from ...harness.frame.vectors import largest, to_float32, to_float64, total

U64 = wp.constant(wp.float64(1.1102230246251565e-16))  # 2^-53

LEAST_STEP = wp.constant(64.0)
"""A sixteenth of the largest error that the step onto the plane may have, in units of U64 of the hit point's own size.
Beyond it :func:`flat_hit_point` is used.
"""

HIT_UNITS = wp.constant(wp.float64(1040.0))
"""Bound on the error of a hit point, in units of U64 of its own largest coordinate: the step, nine for the point off its
ray that is moved onto the plane at a sine of an eighth or more, one for rounding, and a margin.
"""

WIDE_UNITS = wp.constant(wp.float64(4.0))
"""The same of :func:`flat_hit_point` in twice the digits: one unit for rounding, and a margin."""

ORIGIN_UNITS = wp.constant(wp.float64(2.0**-20))
"""The same in units of the origin's coordinates: :func:`flat_hit_point` rounds a step of 2^-23 of the distance from
there.
"""

STEEP = wp.constant(2.0**-12)
NEAR = wp.constant(512.0)
"""Of a hit point that is rounded without a step onto its plane (:func:`is_vague`): the least slope, as a share of the
product that bounds it, and the largest distance of the origin, in units of the triangle's largest coordinate.
"""

LEADING = wp.constant(wp.uint64(0xFFFFFFFFE0000000))
"""Mask of the sign, the exponent and 23 bits of the fraction of a float64: its product with a float32 is exact."""


@wp.func
def plane_distance(ray: Ray, corners: Corners) -> wp.float64:
    """t of the ray on the triangle's plane, inside the triangle or not."""
    if wp.static(effects.wide):
        height = wide_side(corners.a, corners.b, corners.c, to_float64(ray.origin))
        return -height / wide_slope(corners.a, corners.b, corners.c, to_float64(ray.direction))
    a64 = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a64, to_float64(corners.c) - a64)
    return wp.dot(n, a64 - to_float64(ray.origin)) / wp.dot(n, to_float64(ray.direction))


@wp.func
def hit_error(h: wp.vec3d, origin_size: wp.float64) -> wp.float64:
    """Bound on the error of each coordinate of a hit point h whose ray's origin has coordinates of up to ``origin_size``."""
    return U64 * (HIT_UNITS * largest(h) + ORIGIN_UNITS * origin_size)


@wp.func
def wide_hit_error(n: wp.vec3d, h: wp.vec3d, origin_size: wp.float64) -> wp.float64:
    """Bound on what the error of h does to n . h, where every hit point is that of :func:`flat_hit_point`: each coordinate
    is rounded once, by itself. So it holds for axes of unlike scale too.
    """
    own = wp.abs(n[0] * h[0]) + wp.abs(n[1] * h[1]) + wp.abs(n[2] * h[2])
    return U64 * (WIDE_UNITS * own + ORIGIN_UNITS * total(n) * origin_size)


@wp.func
def nearest_corner(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.vec3d:
    near = a
    if total(p - b) < total(p - near):
        near = b
    if total(p - c) < total(p - near):
        near = c
    return near


@wp.func
def along(ray: Ray, t: wp.float64) -> wp.vec3d:
    """o + t d, each coordinate rounded once."""
    return wp.vec3d(
        fused(wp.float64(ray.direction[0]), t, wp.float64(ray.origin[0])),
        fused(wp.float64(ray.direction[1]), t, wp.float64(ray.origin[1])),
        fused(wp.float64(ray.direction[2]), t, wp.float64(ray.origin[2])),
    )


@wp.func
def is_flat(ray: Ray, t: wp.float64, corners: Corners) -> wp.bool:
    """Whether the hit point takes :func:`flat_hit_point`: the ray is nearly in the triangle's plane, or the normal is too
    uncertain for the way to a corner (a large triangle, or a sliver).
    """
    if wp.static(effects.wide):
        return True
    a64 = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a64, to_float64(corners.c) - a64)
    # Sizes in float32: they are needed only up to a factor. Where one is zero, infinite or undefined, the point is flat.
    slope = wp.float32(wp.abs(wp.dot(n, to_float64(ray.direction))))
    if not slope > 0.125 * total(to_float32(n)) * total(ray.direction):
        return True
    doubt = largest(corners.b - corners.a) * largest(corners.c - corners.a) * (largest(ray.direction) / slope)
    p = ray.origin + ray.direction * wp.float32(t)
    away = wp.min(total(p - corners.a), wp.min(total(p - corners.b), total(p - corners.c)))
    return not doubt * away <= LEAST_STEP * largest(p)


@wp.func
def is_vague(ray: Ray, corners: Corners) -> wp.bool:
    """Whether a hit point that will be rounded to float32 takes :func:`flat_hit_point`.

    Elsewhere :func:`along` suffices. With e, f the edges, w the way from the origin to a corner and M the scene's largest
    coordinate, the numerator of t is off by 48 U |e| |f| |w| and its denominator by 16 U |e| |f| |d|_1, which is at least
    STEEP |e| |f| |d|_1. So t d is off by (64 |w| + 32 M) U / STEEP: for |w| of up to NEAR M by 2^-26 M, a quarter of what
    rounding the point may lose.
    """
    if wp.static(effects.wide):
        return True
    d64 = to_float64(ray.direction)
    a64 = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a64, to_float64(corners.c) - a64)
    slope = wp.float32(wp.abs(wp.dot(n, d64)))
    # Sizes in float32, which are needed only up to a factor. Where one is too small, infinite or undefined, it is vague.
    bound = largest(corners.b - corners.a) * largest(corners.c - corners.a) * total(ray.direction)
    place = wp.max(largest(corners.a), wp.max(largest(corners.b), largest(corners.c)))
    return not (slope > STEEP * bound + 1.0e-36 and largest(corners.a - ray.origin) <= NEAR * place)


@wp.func
def steep_hit_point(ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    """:func:`hit_point` where the ray is not flat.

    The error of t is proportional to the distance from o to the corner that t was computed from. For a large triangle
    that may be far more than the hit point's own rounding. After one Newton step from the corner nearest to the point,
    the error is proportional to the distance from that corner.
    """
    d64 = to_float64(ray.direction)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    p = along(ray, t)
    near = nearest_corner(p, a64, b64, c64)
    n = wp.cross(b64 - a64, c64 - a64)
    return p - d64 * (wp.dot(n, p - near) / wp.dot(n, d64))


@wp.func
def flat_hit_point(ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    """:func:`hit_point` where the ray is flat: before the end, only terms are rounded that are far too small to
    matter.
    """
    if wp.static(effects.wide):
        return wide_hit_point(ray, corners)
    o64 = to_float64(ray.origin)
    d64 = to_float64(ray.direction)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    # t with fewer bits, so that its product with d is exact. The step to the plane corrects the difference.
    way = d64 * wp.cast(wp.cast(t, wp.uint64) & LEADING, wp.float64)
    p = o64 + way
    p_lost = lost_in_sum(o64, way, p)
    near = nearest_corner(p, a64, b64, c64)
    w = p - near
    w_lost = p_lost + lost_in_sum(p, -near, w)
    ab = b64 - a64
    ac = c64 - a64
    step = precise_product(ab, ac, w, w_lost) / precise_product(ab, ac, d64, wp.vec3d())
    return p + (p_lost - d64 * step)


@wp.func
def hit_point(ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    """o + t d in float64, moved back onto the triangle's plane: the origin of shadow rays, by one function for all
    methods.
    """
    if is_flat(ray, t, corners):
        return flat_hit_point(ray, t, corners)
    return steep_hit_point(ray, t, corners)
