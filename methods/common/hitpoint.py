"""Hit points in float64: where shadow rays start, by one function for every method.

A hit point that is rounded beside its ray by u, and then led back onto a plane that the ray meets at an angle of sine
s, moves by u / s along the ray. Where the ray is flat that is off the planes of the triangle's neighbours by more than
their shadow test allows for one rounding (:func:`.segment.plane_crosses_segment`), and the neighbours would shadow it.
So for flat rays sums and products are carried with what their rounding lost (the error-free transformations of Knuth
and Dekker, the dot product of Ogita, Rump and Oishi 2005), and the point is rounded once, at the end: by tests it is
off by one unit at most, and that of other rays by three.
"""

from __future__ import annotations

import warp as wp

from ...harness.frame.geometry import Corners, Ray
from ...harness.frame.vectors import to_float64, total

LEADING = wp.constant(wp.uint64(0xFFFFFFFFE0000000))
"""Of a float64 the sign, the exponent and 23 bits of the fraction: times a float32 it is exact."""


@wp.func_native("return fma(a, b, c);")
def fused(a: wp.float64, b: wp.float64, c: wp.float64) -> wp.float64: ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __dmul_rn(a, b);
#else
    return a * b;
#endif
""")
def rounded(a: wp.float64, b: wp.float64) -> wp.float64:
    """a b, rounded. A GPU's compiler would fuse the product with a sum that takes it, and the rounding error of that sum
    would not be the one computed here."""


@wp.func
def rounded_product(a: wp.vec3d, b: wp.vec3d) -> wp.vec3d:
    return wp.vec3d(rounded(a[0], b[0]), rounded(a[1], b[1]), rounded(a[2], b[2]))


@wp.func
def lost_in_sum(a: wp.vec3d, b: wp.vec3d, sum: wp.vec3d) -> wp.vec3d:
    """a + b - sum, where sum is a + b rounded."""
    of_b = sum - a
    return (a - (sum - of_b)) + (b - of_b)


@wp.func
def lost_in_product(a: wp.vec3d, b: wp.vec3d, product: wp.vec3d) -> wp.vec3d:
    """a b - product, component by component, where product is :func:`rounded_product`."""
    return wp.vec3d(
        fused(a[0], b[0], -product[0]), fused(a[1], b[1], -product[1]), fused(a[2], b[2], -product[2])
    )


@wp.func
def plane_distance(ray: Ray, corners: Corners) -> wp.float64:
    """t of the ray on the triangle's plane, inside the triangle or not."""
    a64 = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a64, to_float64(corners.c) - a64)
    return wp.dot(n, a64 - to_float64(ray.origin)) / wp.dot(n, to_float64(ray.direction))


@wp.func
def nearest_corner(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.vec3d:
    near = a
    if total(p - b) < total(p - near):
        near = b
    if total(p - c) < total(p - near):
        near = c
    return near


@wp.func
def is_flat(direction: wp.vec3f, corners: Corners) -> wp.bool:
    """Whether a direction is so nearly in the triangle's plane that its hit point takes :func:`flat_hit_point`."""
    d64 = to_float64(direction)
    a64 = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a64, to_float64(corners.c) - a64)
    return wp.abs(wp.dot(n, d64)) < wp.float64(0.125) * total(n) * total(d64)


@wp.func
def steep_hit_point(ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    """:func:`hit_point` where the ray is not flat.

    t is as uncertain as the way from o to the corner that it was computed from is long: of a large triangle that may
    be far more than the hit point's own rounding. One step of Newton's from the corner nearest to the point leaves what
    its distance to that corner accounts for.
    """
    d64 = to_float64(ray.direction)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    p = to_float64(ray.origin) + d64 * t
    near = nearest_corner(p, a64, b64, c64)
    n = wp.cross(b64 - a64, c64 - a64)
    return p - d64 * (wp.dot(n, p - near) / wp.dot(n, d64))


@wp.func
def flat_hit_point(ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    """:func:`hit_point` where the ray is flat: nothing is rounded before the end but what is far too small to matter."""
    o64 = to_float64(ray.origin)
    d64 = to_float64(ray.direction)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    # A shorter t, whose product with d is exact: what it is short of, the step to the plane makes up for.
    way = d64 * wp.cast(wp.cast(t, wp.uint64) & LEADING, wp.float64)
    p = o64 + way
    p_lost = lost_in_sum(o64, way, p)
    near = nearest_corner(p, a64, b64, c64)
    w = p - near
    w_lost = p_lost + lost_in_sum(p, -near, w)
    ab = b64 - a64
    ac = c64 - a64
    # The normal ab x ac, and what it lost.
    ab_yzx = wp.vec3d(ab[1], ab[2], ab[0])
    ab_zxy = wp.vec3d(ab[2], ab[0], ab[1])
    ac_yzx = wp.vec3d(ac[1], ac[2], ac[0])
    ac_zxy = wp.vec3d(ac[2], ac[0], ac[1])
    left = rounded_product(ab_yzx, ac_zxy)
    right = rounded_product(ab_zxy, ac_yzx)
    n = left - right
    n_lost = lost_in_sum(left, -right, n) + (
        lost_in_product(ab_yzx, ac_zxy, left) - lost_in_product(ab_zxy, ac_yzx, right)
    )
    # n . w, likewise.
    products = rounded_product(n, w)
    terms = lost_in_product(n, w, products)
    first = products[0] + products[1]
    height = first + products[2]
    of_first = first - products[0]
    of_height = height - first
    height += (
        (products[0] - (first - of_first)) + (products[1] - of_first)
        + (first - (height - of_height)) + (products[2] - of_height)
        + (terms[0] + terms[1] + terms[2])
        + wp.dot(n_lost, w) + wp.dot(n, w_lost)
    )  # fmt: skip
    return p + (p_lost - d64 * (height / wp.dot(n, d64)))


@wp.func
def hit_point(ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    """o + t d in float64, led back onto the triangle's plane: the shadow origin, by one function for everyone."""
    if is_flat(ray.direction, corners):
        return flat_hit_point(ray, t, corners)
    return steep_hit_point(ray, t, corners)
