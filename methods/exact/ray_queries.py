"""The tests of one triangle that every structure's queries share: is it the closest hit, does it occlude the light?

A query is a loop over candidate triangles, in whatever order its structure yields them. Each candidate goes through one
of the functions below, which take what has been found so far and return what has been found with it. The answer does not
depend on the order, nor on how often a triangle is tested: float32 rejects, float64 decides (:mod:`.triangle`,
:mod:`.segment`).

All have the same form, test(mesh, alpha, i, query, found), so that a traversal takes any of them
(:mod:`..rays.kernels`); ``mesh`` is a Mesh or :class:`..common.corner_records.CornerRecords`. Where triangles
have holes, a hit counts unless it lies in one.
"""

from typing import Any

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Ray, value_struct
from ..common.corner_records import corners_in, triangles_in, weld_in
from .holes import opaque_at_hit, opaque_to_light
from .segment import may_occlude, occludes
from .triangle import U32, hit_distance, largest, may_hit, nearer_of, to_float32

SLACK = wp.constant(1.0 + 2.0**-20)
"""A box that begins just behind the closest hit may hold a tie: boxes are searched to this multiple of its distance."""


@value_struct
class RayPart:
    """The part 0 <= t <= end of the ray start + t direction that a structure is walked along; ``own``: the triangle that is
    left out, -1: none.
    """

    start: wp.vec3d
    direction: wp.vec3d
    end: wp.float64
    own: wp.int32


@wp.struct
class Found:
    """What a query has found so far.

    triangle  the closest hit; -1: none
    t         its distance in lengths of the ray's direction
    u, v      its weights of vertices 1 and 2, where the triangle test gives them
    limit     boxes that the ray enters beyond this distance need not be searched
    done      the query is over: an any-hit query has found an occluder
    tests     candidates so far
    """

    triangle: wp.int32
    t: wp.float64
    u: wp.float32
    v: wp.float32
    limit: wp.float32
    done: wp.bool
    tests: wp.int32


@wp.struct
class Segment:
    """A shadow ray: the open segment from a hit point to a light.

    hit     the hit point in float64      start  the same rounded to float32
    light   where it ends                 error  bounds |start - hit| in each coordinate
    own     the triangle that was hit, which does not shadow itself
    origin_size  largest coordinate of the origin of the ray that hit (:func:`.segment.occludes`)
    """

    hit: wp.vec3d
    start: wp.vec3f
    light: wp.vec3f
    error: wp.float32
    own: wp.int32
    origin_size: wp.float64


@wp.func
def nothing_found(limit: wp.float32) -> Found:
    """The start of a query over distances up to ``limit``."""
    found = Found()
    found.triangle = -1
    found.t = wp.float64(wp.INF)
    found.limit = limit
    return found


@wp.func
def shadow_segment(hit: wp.vec3d, light: wp.vec3f, own: wp.int32, origin: wp.vec3f) -> Segment:
    """The shadow ray of the hit point ``hit`` on triangle ``own``, found by a ray from ``origin``."""
    segment = Segment()
    segment.hit = hit
    segment.start = to_float32(hit)
    segment.light = light
    segment.error = U32 * largest(segment.start)
    segment.own = own
    segment.origin_size = wp.float64(largest(origin))
    return segment


@wp.func
def with_hit(found: Found, i: wp.int32, t: wp.float64) -> Found:
    """Triangle i, hit at t, becomes the closest hit."""
    found.triangle = i
    found.t = t
    found.limit = wp.float32(t) * SLACK
    return found


@wp.func
def closest_hit(mesh: Any, alpha: Alpha, i: wp.int32, ray: Ray, found: Found) -> Found:
    """Triangle i if it is hit nearer than what was found: by float64 t, ties to the lowest index."""
    corners = corners_in(mesh, i)
    if may_hit(ray, corners):
        weld = weld_in(mesh, i)
        t = hit_distance(ray, corners, weld)
        if t > wp.float64(0.0) and nearer_of(triangles_in(mesh), t, i, found.t, found.triangle):
            counts = wp.bool(True)
            if wp.static(effects.alpha):
                counts = opaque_at_hit(alpha, i, ray, corners, weld)
            if counts:
                found = with_hit(found, i, t)
    return found


@wp.func
def any_hit(mesh: Any, alpha: Alpha, i: wp.int32, segment: Segment, found: Found) -> Found:
    """Done if triangle i meets the shadow ray."""
    if i == segment.own:
        return found
    corners = corners_in(mesh, i)
    if not may_occlude(segment.start, segment.light, corners, segment.error):
        return found
    weld = weld_in(mesh, i)
    found.done = occludes(segment.hit, segment.light, corners, weld, segment.origin_size)
    if wp.static(effects.alpha):
        if found.done:
            found.done = opaque_to_light(alpha, i, segment.hit, segment.light, corners, weld, segment.origin_size)
    return found
