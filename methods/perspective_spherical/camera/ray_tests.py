"""Float32 tests of a ray from the eye against a triangle, on a record made once per frame.

Three tests, chosen when the kernels are compiled:

exact            rejects only what its rounding bound makes certain; float64 decides the rest
edge_planes      rejects by the plain signs of d . n, the planes through the eye and each edge, in difference form
                 and weld order: two triangles at an edge share a plane, so no ray is rejected by both; one exactly
                 through a vertex may be rejected by all around it, whose planes do not quite meet there
moller_trumbore  rejects as Moeller & Trumbore do with det != 0; rays at an edge may be rejected by both sides

What one of the last two accepts counts if the ray crosses the triangle's plane within :data:`TOLERANCE` of the
triangle (in barycentric weights), and t is float64. The grids list triangles widened by :data:`WIDENINGS`, so an
answer depends on ray and triangle alone: no tile size, slice, map or chunk can change it.
"""

import warp as wp

from ....harness.frame.geometry import Corners, Ray
from ...exact.planes import edge_normal, farthest_corner, longest_edge
from ...exact.triangle import (
    FLOOR32,
    NO_HIT,
    OVERFLOW,
    U32,
    U64,
    certainly_outside,
    edge_functions,
    hit_distance,
    largest,
    to_float64,
    total,
)

EXACT, EDGE_PLANES, MOLLER_TRUMBORE = wp.constant(0), wp.constant(1), wp.constant(2)

RECORD = wp.constant(3)
"""vec4f of a triangle's record."""

TOLERANCE = wp.constant(wp.float64(2.0**-16))
"""Least barycentric weight that a float32 test may accept, negated."""

WIDENINGS = (4.0 * 2.0**-30, 4.0 * 2.0**-16, 4.0 * 2.0**-16)
"""By test: growth of a triangle about its middle that holds every point it may accept, with a quarter to spare.

Points with weights above -w lie in the triangle grown by 3 w; w is 2^-30 in float64 (``triangle.CLOSED``).
"""


@wp.struct
class RayRecord:
    """Three vec4f: planes n through eye and edges and their rounding bound, or a vertex and two edges."""

    q0: wp.vec4f
    q1: wp.vec4f
    q2: wp.vec4f


@wp.func
def plane_record(eye: wp.vec3f, corners: Corners, weld: wp.vec3i) -> RayRecord:
    """Edge planes through the origin, and the bound of their values (:mod:`...exact.planes`) for |d|_1 = 1, with the
    rounding of corners relative to the eye.

    All zero where a plane may overflow in a product with a direction of up to 1e4: float64 then decides every ray.
    """
    origin = wp.vec3f()
    a = corners.a - eye
    b = corners.b - eye
    c = corners.c - eye
    size = farthest_corner(eye, corners) * longest_edge(corners)
    r = RayRecord()
    if not (1.0e4 * size < OVERFLOW):
        return r
    r.q0 = joined(edge_normal(origin, b, c, weld[1], weld[2]), 20.0 * U32 * size)
    r.q1 = joined(edge_normal(origin, c, a, weld[2], weld[0]), 0.0)
    r.q2 = joined(edge_normal(origin, a, b, weld[0], weld[1]), 0.0)
    return r


@wp.func
def vertex_record(eye: wp.vec3f, corners: Corners, weld: wp.vec3i) -> RayRecord:
    r = RayRecord()
    r.q0 = joined(eye - corners.a, 0.0)
    r.q1 = joined(corners.b - corners.a, 0.0)
    r.q2 = joined(corners.c - corners.a, 0.0)
    return r


@wp.func
def joined(a: wp.vec3f, w: wp.float32) -> wp.vec4f:
    return wp.vec4f(a[0], a[1], a[2], w)


@wp.func
def first3(q: wp.vec4f) -> wp.vec3f:
    return wp.vec3f(q[0], q[1], q[2])


@wp.func
def dot3(q: wp.vec4f, d: wp.vec3f) -> wp.float32:
    return q[0] * d[0] + q[1] * d[1] + q[2] * d[2]


@wp.func
def passes_bounded(d: wp.vec3f, size: wp.float32, r: RayRecord) -> wp.bool:
    """False only if the line certainly misses. ``size`` = |d|_1."""
    return not certainly_outside(dot3(r.q0, d), dot3(r.q1, d), dot3(r.q2, d), size * r.q0[3] + FLOOR32)


@wp.func
def passes_planes(d: wp.vec3f, size: wp.float32, r: RayRecord) -> wp.bool:
    return not certainly_outside(dot3(r.q0, d), dot3(r.q1, d), dot3(r.q2, d), 0.0)


@wp.func
def moller_trumbore(s: wp.vec3f, d: wp.vec3f, e1: wp.vec3f, e2: wp.vec3f) -> tuple[wp.bool, wp.float32, wp.float32]:
    """Whether a line meets the triangle; its determinant, and t times that; s: from vertex 0 to the line's start."""
    p = wp.cross(d, e2)
    det = wp.dot(e1, p)
    if det == 0.0:
        return False, det, det
    inverse = 1.0 / det
    u = wp.dot(s, p) * inverse
    if u < 0.0 or u > 1.0:
        return False, det, det
    q = wp.cross(s, e1)
    v = wp.dot(d, q) * inverse
    if v < 0.0 or u + v > 1.0:
        return False, det, det
    return True, det, wp.dot(e2, q)


@wp.func
def passes_moller_trumbore(d: wp.vec3f, size: wp.float32, r: RayRecord) -> wp.bool:
    inside, det, t = moller_trumbore(first3(r.q0), d, first3(r.q1), first3(r.q2))
    return inside and t * (1.0 / det) > 0.0


@wp.func
def hit_distance_near(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.float64:
    """t > 0 where the ray crosses the plane within TOLERANCE of the triangle, or NO_HIT. Float64."""
    o64 = to_float64(ray.origin)
    d64 = to_float64(ray.direction)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    e1 = b64 - a64
    e2 = c64 - a64
    n = wp.cross(e1, e2)
    det = wp.dot(n, d64)
    if wp.abs(det) <= wp.float64(8.0) * U64 * total(d64) * largest(e1) * largest(e2):
        return NO_HIT
    e = edge_functions(o64, d64, a64, b64, c64, weld)
    if not near_inside(e):
        return NO_HIT
    away = a64 - o64
    height = wp.dot(n, away)
    if wp.abs(height) <= wp.float64(16.0) * U64 * total(away) * largest(e1) * largest(e2):
        return NO_HIT
    t = height / det
    return wp.where(t > wp.float64(0.0), t, NO_HIT)


@wp.func
def near_inside(e: wp.vec3d) -> wp.bool:
    """Whether edge functions of one triangle give weights of at least -TOLERANCE."""
    sum = e[0] + e[1] + e[2]
    least = -TOLERANCE * wp.abs(sum)
    if sum < wp.float64(0.0):
        e = -e
    return sum != wp.float64(0.0) and e[0] >= least and e[1] >= least and e[2] >= least


@wp.func
def count_tests(tests: wp.array(dtype=wp.int32), pixel: wp.int32, number: wp.int32):
    """Add to a pixel's triangle tests, where they are counted; an array of one element is not written."""
    if tests.shape[0] > 1:
        wp.atomic_add(tests, pixel, number)


RAY_PASSES = (passes_bounded, passes_planes, passes_moller_trumbore)
RAY_DECIDES = (hit_distance, hit_distance_near, hit_distance_near)
"""By test: reject in float32, decide the rest in float64."""
