"""t, weights and hit point of a closest hit, in float64, in fewer instructions than the functions that methods share.

The numbers are those of :func:`.hit_point.plane_distance` and :func:`.triangle.hit_weights`, bit by bit up
to the sign of a zero: an edge's difference is computed once and not for each order of its ends (negating it only changes
signs), what distance and weights both need is shared, and quotients are those of :mod:`..gpu.division`. That holds
more numbers at once, for which kernels that decide hits in a loop have no registers.
"""

import warp as wp

from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Corners, Ray, value_struct
from ..gpu.division import quotient, reciprocal
from .hit_point import NEAR, STEEP, plane_distance
from .triangle import NOT_ZERO, hit_weights, largest, to_float64, total


@value_struct
class CertainHit:
    """t in lengths of the direction; the weights of vertices 1 and 2; whether the ray is too flat on the triangle for
    :func:`.hit_point.along`, as :func:`.hit_point.is_vague` tells.
    """

    t: wp.float64
    uv: wp.vec2f
    flat: wp.bool


@wp.func
def is_far(origin: wp.vec3f, extent: wp.float32) -> wp.bool:
    """Whether an origin is so far that all hit points are vague (:func:`.hit_point.is_vague`), in a scene whose
    coordinates are at most ``extent``: more than NEAR times that from a corner.
    """
    return not largest(origin) <= (NEAR - 1.0) * extent


@wp.func
def certain_hit(ray: Ray, corners: Corners, weld: wp.vec3i) -> CertainHit:
    """Of a triangle that the ray hits, so that it is not parallel to its plane."""
    if wp.static(effects.wide):
        return CertainHit(plane_distance(ray, corners), hit_weights(ray, corners, weld), True)
    o = to_float64(ray.origin)
    d = to_float64(ray.direction)
    a = to_float64(corners.a)
    b = to_float64(corners.b)
    c = to_float64(corners.c)
    ab = b - a
    ac = c - a
    oa = a - o
    ob = b - o
    oc = c - o
    n = wp.cross(ab, ac)
    det = wp.dot(n, d)
    # Sizes in float32, which are needed only up to a factor. Where one is too small, infinite or undefined, it is flat.
    bound = largest(corners.b - corners.a) * largest(corners.c - corners.a) * total(ray.direction)
    flat = not wp.float32(wp.abs(det)) > STEEP * bound + 1.0e-36
    t = quotient(wp.dot(n, oa), det, reciprocal(det))
    # Ends are selected instead of branching, since a warp would compute both branches.
    e0 = wp.dot(wp.cross(wp.where(weld[1] < weld[2], ob, oc), c - b), d)
    e1 = -wp.dot(wp.cross(wp.where(weld[2] < weld[0], oc, oa), ac), d)
    e2 = wp.dot(wp.cross(wp.where(weld[0] < weld[1], oa, ob), ab), d)
    sum = e0 + e1 + e2 + NOT_ZERO
    inverse = reciprocal(sum)
    # Adding 0 makes a zero positive: its sign is not that of a division.
    u = wp.float32(quotient(e1, sum, inverse)) + 0.0
    v = wp.float32(quotient(e2, sum, inverse)) + 0.0
    return CertainHit(t, wp.vec2f(u, v), flat)
