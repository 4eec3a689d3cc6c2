"""Triangle tests in float32 to compare with those in float64 that exact methods share; all answer (t, u, v).

A hit has t > 0 in lengths of d; (u, v) are the weights of vertices 1 and 2. A miss is t = -1. Each test is written as its
authors published it, because its errors are to be measured.
"""

from __future__ import annotations

import warp as wp

from ...harness.frame.geometry import Corners, Ray
from ..exact.triangle import hit_distance

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
def sheared(ray: Ray, corners: Corners, decide_in_float64: wp.bool) -> wp.vec3d:
    """Woop, Benthin & Wald 2013: the ray's largest axis becomes z, its direction (0, 0, 1) by a shear."""
    d = ray.direction
    kz = wp.int32(0)
    if wp.abs(d[1]) > wp.abs(d[kz]):
        kz = wp.int32(1)
    if wp.abs(d[2]) > wp.abs(d[kz]):
        kz = wp.int32(2)
    kx = (kz + 1) % 3
    ky = (kx + 1) % 3
    sx = d[kx] / d[kz]
    sy = d[ky] / d[kz]
    sz = 1.0 / d[kz]
    pa = corners.a - ray.origin
    pb = corners.b - ray.origin
    pc = corners.c - ray.origin
    ax = pa[kx] - sx * pa[kz]
    ay = pa[ky] - sy * pa[kz]
    bx = pb[kx] - sx * pb[kz]
    by = pb[ky] - sy * pb[kz]
    cx = pc[kx] - sx * pc[kz]
    cy = pc[ky] - sy * pc[kz]
    u = cx * by - cy * bx
    v = ax * cy - ay * cx
    w = bx * ay - by * ax
    if decide_in_float64 and (u == 0.0 or v == 0.0 or w == 0.0):
        u = wp.float32(wp.float64(cx) * wp.float64(by) - wp.float64(cy) * wp.float64(bx))
        v = wp.float32(wp.float64(ax) * wp.float64(cy) - wp.float64(ay) * wp.float64(cx))
        w = wp.float32(wp.float64(bx) * wp.float64(ay) - wp.float64(by) * wp.float64(ax))
    if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
        return MISS3
    det = u + v + w
    if det == 0.0:
        return MISS3
    t = (u * (sz * pa[kz]) + v * (sz * pb[kz]) + w * (sz * pc[kz])) / det
    if not t > 0.0:
        return MISS3
    return found3(t, v / det, w / det)


@wp.func
def woop(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec3d:
    return sheared(ray, corners, False)


@wp.func
def woop_float64(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec3d:
    return sheared(ray, corners, True)


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
