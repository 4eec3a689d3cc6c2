"""Triangle tests in float32 to compare with those in float64 that exact methods share; all answer (t, u, v).

A hit has t > 0 in lengths of d; (u, v) are the weights of vertices 1 and 2. A miss is t = -1. Each test is written as its
authors published it, because its errors are to be measured.
"""

import warp as wp

from ...harness.frame.geometry import Corners, Ray
from ..exact.triangle import hit_distance
from ..rays.offset import shear_axes, sheared

MISS3 = wp.constant(wp.vec3d(-1.0, 0.0, 0.0))
TEXTBOOK_EPSILON = wp.constant(1.0e-7)


@wp.func
def found3(t: wp.float32, u: wp.float32, v: wp.float32) -> wp.vec3d:
    return wp.vec3d(wp.float64(t), wp.float64(u), wp.float64(v))


@wp.func
def moller_trumbore_above(ray: Ray, corners: Corners, smallest: wp.float32) -> wp.vec3d:
    """Moeller & Trumbore 1997, two-sided; |det| must exceed ``smallest``."""
    e1 = corners.b - corners.a
    e2 = corners.c - corners.a
    p = wp.cross(ray.direction, e2)
    det = wp.dot(e1, p)
    if not wp.abs(det) > smallest:
        return MISS3
    inverse = 1.0 / det
    s = ray.origin - corners.a
    u = wp.dot(s, p) * inverse
    if u < 0.0 or u > 1.0:
        return MISS3
    q = wp.cross(s, e1)
    v = wp.dot(ray.direction, q) * inverse
    if v < 0.0 or u + v > 1.0:
        return MISS3
    t = wp.dot(e2, q) * inverse
    if not t > 0.0:
        return MISS3
    return found3(t, u, v)


@wp.func
def moller_trumbore(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec3d:
    return moller_trumbore_above(ray, corners, 0.0)


@wp.func
def moller_trumbore_epsilon(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec3d:
    return moller_trumbore_above(ray, corners, TEXTBOOK_EPSILON)


@wp.func
def cross_product(p: wp.vec3f, q: wp.vec3f) -> wp.float32:
    """Of x and y, rounded as Woop's test rounds it."""
    return p[0] * q[1] - p[1] * q[0]


@wp.func
def cross_product64(p: wp.vec3f, q: wp.vec3f) -> wp.float32:
    """The same in float64, rounded at the end."""
    return wp.float32(wp.float64(p[0]) * wp.float64(q[1]) - wp.float64(p[1]) * wp.float64(q[0]))


@wp.func
def sheared_test(ray: Ray, corners: Corners, decide_in_float64: wp.bool) -> wp.vec3d:
    """Woop, Benthin & Wald 2013: the ray's largest axis becomes z, its direction (0, 0, 1) by a shear."""
    d = ray.direction
    k = shear_axes(d)
    sx = d[k[0]] / d[k[2]]
    sy = d[k[1]] / d[k[2]]
    sz = 1.0 / d[k[2]]
    a = sheared(corners.a - ray.origin, k, sx, sy)
    b = sheared(corners.b - ray.origin, k, sx, sy)
    c = sheared(corners.c - ray.origin, k, sx, sy)
    u = cross_product(c, b)
    v = cross_product(a, c)
    w = cross_product(b, a)
    if decide_in_float64 and (u == 0.0 or v == 0.0 or w == 0.0):
        u = cross_product64(c, b)
        v = cross_product64(a, c)
        w = cross_product64(b, a)
    if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
        return MISS3
    det = u + v + w
    if det == 0.0:
        return MISS3
    t = (u * (sz * a[2]) + v * (sz * b[2]) + w * (sz * c[2])) / det
    if not t > 0.0:
        return MISS3
    return found3(t, v / det, w / det)


@wp.func
def woop(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec3d:
    return sheared_test(ray, corners, False)


@wp.func
def woop_float64(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec3d:
    return sheared_test(ray, corners, True)


@wp.func
def edge_plane(ray: Ray, p: wp.vec3f, q: wp.vec3f, weld_p: wp.int32, weld_q: wp.int32) -> wp.float32:
    """d . ((p - o) x (q - p)) in float32, taken from the vertex with the lower weld index."""
    if weld_p < weld_q:
        return wp.dot(wp.cross(p - ray.origin, q - p), ray.direction)
    return -wp.dot(wp.cross(q - ray.origin, p - q), ray.direction)


@wp.func
def edge_planes(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec3d:
    """Edge functions in float32; both triangles at an edge compute the same number with opposite sign."""
    e0 = edge_plane(ray, corners.b, corners.c, weld[1], weld[2])
    e1 = edge_plane(ray, corners.c, corners.a, weld[2], weld[0])
    e2 = edge_plane(ray, corners.a, corners.b, weld[0], weld[1])
    if (e0 < 0.0 or e1 < 0.0 or e2 < 0.0) and (e0 > 0.0 or e1 > 0.0 or e2 > 0.0):
        return MISS3
    n = wp.cross(corners.b - corners.a, corners.c - corners.a)
    det = wp.dot(n, ray.direction)
    if det == 0.0:
        return MISS3
    t = wp.dot(n, corners.a - ray.origin) / det
    if not t > 0.0:
        return MISS3
    sum = e0 + e1 + e2
    return found3(t, e1 / sum, e2 / sum)


@wp.func
def float64(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec3d:
    """The test that exact methods share, of every candidate; its weights are found at the end."""
    return wp.vec3d(hit_distance(ray, corners, weld), wp.float64(0.0), wp.float64(0.0))


TESTS = {
    "moller_trumbore": moller_trumbore,
    "moller_trumbore_epsilon": moller_trumbore_epsilon,
    "woop": woop,
    "woop_float64": woop_float64,
    "edge_planes": edge_planes,
    "float64": float64,
}
