"""Whether a hit on a triangle with holes counts: the same float64 arithmetic for every method (:mod:`.scene.alpha`).

Called under ``if wp.static(effects.alpha):`` only, for a hit that the triangle test has accepted. Weights come from
edge functions, each known to the bound of :mod:`.triangle`; what that leaves in doubt counts as opaque if anything
there is, so that a hit on the border of two texels is decided alike in whichever order a compiler multiplies.
"""

import warp as wp

from ...harness.frame.alpha import OPAQUE, Alpha, texels_near
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Corners, Ray
from .segment import light_edge_error, light_edge_functions
from .triangle import U64, edge_functions, largest, to_float64, total

BIT = wp.constant(wp.int32(OPAQUE))


@wp.func
def opaque_where(alpha: Alpha, i: wp.int32, e: wp.vec3d, bound: wp.float64) -> wp.bool:
    """Whether triangle i is opaque where its edge functions are e, each known to ``bound``."""
    sum = e[0] + e[1] + e[2]
    # A weight of about 1 at most is off by its own bound and the sum's three.
    return (texels_near(alpha, i, e[1] / sum, e[2] / sum, wp.float64(4.0) * bound / wp.abs(sum)) & BIT) != 0


@wp.func
def opaque_at_hit(alpha: Alpha, i: wp.int32, ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.bool:
    """Whether triangle i is opaque where the ray hits it."""
    if alpha.masked[i] == wp.uint8(0):
        return True
    o64 = to_float64(ray.origin)
    d64 = to_float64(ray.direction)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    edge = wp.max(largest(b64 - a64), wp.max(largest(c64 - b64), largest(a64 - c64)))
    reach = wp.max(largest(a64 - o64), wp.max(largest(b64 - o64), largest(c64 - o64)))
    bound = wp.float64(16.0) * U64 * total(d64) * reach * edge
    e = edge_functions(o64, d64, a64, b64, c64, weld)
    if wp.static(effects.wide):
        bound = wp.float64(4.0) * U64 * total(e)
    return opaque_where(alpha, i, e, bound)


@wp.func
def opaque_to_light(
    alpha: Alpha, i: wp.int32, h: wp.vec3d, light: wp.vec3f, corners: Corners, weld: wp.vec3i, origin_size: wp.float64
) -> wp.bool:
    """Whether triangle i is opaque where the segment from the hit point h to the light crosses it.

    ``origin_size`` as in :func:`.segment.occludes`: h itself was rounded.
    """
    if alpha.masked[i] == wp.uint8(0):
        return True
    l64 = to_float64(light)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    bound = light_edge_error(h, l64, a64, b64, c64, origin_size)
    return opaque_where(alpha, i, light_edge_functions(l64, h, a64, b64, c64, weld), bound)
