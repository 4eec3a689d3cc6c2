"""Whether a hit on a triangle with holes counts: the same float64 words for every method (:mod:`...harness.alpha`).

Called under ``if wp.static(effects.alpha):`` only, for a hit that the triangle test has accepted.
"""

from __future__ import annotations

import warp as wp

from ...harness.alpha import DOUBT, Alpha, texels_near
from .triangle import edge_functions, light_edge_functions, to_float64

DOUBT64 = wp.constant(wp.float64(DOUBT))


@wp.func
def opaque_at(alpha: Alpha, i: wp.int32, e: wp.vec3d) -> wp.bool:
    """Whether triangle i is opaque where its edge functions are e; their sum is the weights' unit."""
    sum = e[0] + e[1] + e[2]
    return (texels_near(alpha, i, e[1] / sum, e[2] / sum, DOUBT64) & 1) != 0


@wp.func
def hit_counts(
    alpha: Alpha,
    i: wp.int32,
    o: wp.vec3f,
    d: wp.vec3f,
    a: wp.vec3f,
    b: wp.vec3f,
    c: wp.vec3f,
    weld: wp.vec3i,
) -> wp.bool:
    """Whether the hit of ray o + t d on triangle i, corners a, b, c, is opaque."""
    if alpha.masked[i] == wp.uint8(0):
        return True
    return opaque_at(
        alpha,
        i,
        edge_functions(to_float64(o), to_float64(d), to_float64(a), to_float64(b), to_float64(c), weld),
    )


@wp.func
def shadow_counts(
    alpha: Alpha,
    i: wp.int32,
    h: wp.vec3d,
    light: wp.vec3f,
    a: wp.vec3f,
    b: wp.vec3f,
    c: wp.vec3f,
    weld: wp.vec3i,
) -> wp.bool:
    """Whether triangle i is opaque where the segment from the hit point h to the light crosses it."""
    if alpha.masked[i] == wp.uint8(0):
        return True
    return opaque_at(
        alpha,
        i,
        light_edge_functions(to_float64(light), h, to_float64(a), to_float64(b), to_float64(c), weld),
    )
