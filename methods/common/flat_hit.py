"""Hit points of rays that are nearly in the triangle's plane: what rounding leaves aside would move them far along.

A hit point that is rounded beside its ray by u, and then led back onto a plane that the ray meets at an angle of
sine s, moves by u / s along the ray: off the planes of the triangle's neighbours, further than their shadow test
allows for the rounding of one point (:func:`.segment.stands_between`), and the neighbours would shadow it. So sums
and products are carried with what their rounding lost (Knuth's and Dekker's error-free transformations, Ogita, Rump &
Oishi's dot product), and the point is rounded once, at the end.
"""

from __future__ import annotations

import warp as wp

LEADING = wp.constant(wp.uint64(0xFFFFFFFFE0000000))
"""Of a float64 the sign, the exponent and 23 bits of the fraction: times a float32 it is exact."""


@wp.func_native("return fma(a, b, c);")
def fused(a: wp.float64, b: wp.float64, c: wp.float64) -> wp.float64: ...


@wp.func
def lost_in_sum(a: wp.vec3d, b: wp.vec3d, sum: wp.vec3d) -> wp.vec3d:
    """a + b - sum, where sum is a + b rounded."""
    of_b = sum - a
    return (a - (sum - of_b)) + (b - of_b)


@wp.func
def lost_in_product(a: wp.vec3d, b: wp.vec3d, product: wp.vec3d) -> wp.vec3d:
    """a b - product, component by component, where product is a b rounded."""
    return wp.vec3d(
        fused(a[0], b[0], -product[0]), fused(a[1], b[1], -product[1]), fused(a[2], b[2], -product[2])
    )


@wp.func
def flat_hit_point(
    o: wp.vec3d, d: wp.vec3d, t: wp.float64, near: wp.vec3d, ab: wp.vec3d, ac: wp.vec3d
) -> wp.vec3d:
    """Where the ray o + t d meets the plane through ``near`` with edges ab, ac; o and d are float32, t nearly right."""
    # A shorter t, whose product with d is exact: what it is short of, the step to the plane makes up for.
    way = d * wp.cast(wp.cast(t, wp.uint64) & LEADING, wp.float64)
    p = o + way
    w = p - near
    w_lost = lost_in_sum(o, way, p) + lost_in_sum(p, -near, w)
    # The normal ab x ac, and what it lost.
    ab_yzx = wp.vec3d(ab[1], ab[2], ab[0])
    ab_zxy = wp.vec3d(ab[2], ab[0], ab[1])
    ac_yzx = wp.vec3d(ac[1], ac[2], ac[0])
    ac_zxy = wp.vec3d(ac[2], ac[0], ac[1])
    left = wp.cw_mul(ab_yzx, ac_zxy)
    right = wp.cw_mul(ab_zxy, ac_yzx)
    n = left - right
    n_lost = lost_in_sum(left, -right, n) + (
        lost_in_product(ab_yzx, ac_zxy, left) - lost_in_product(ab_zxy, ac_yzx, right)
    )
    # n . w, likewise.
    products = wp.cw_mul(n, w)
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
    return p + (lost_in_sum(o, way, p) - d * (height / wp.dot(n, d)))
