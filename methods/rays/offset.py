"""Origins of shadow rays for queries that take only a float32 ray and cannot skip a triangle (Embree, Warp's Mesh).

The origin is the float64 hit point moved off its triangle's plane, towards the light's side, by a bound on the error of
the query's own float32 arithmetic, then rounded outward. The bound is Pharr, Jakob & Humphreys' (PBRT, 4th edition,
section 6.8): gamma_7 = 7 u / (1 - 7 u) times the coordinates that the query subtracts and multiplies, projected on the
normal; no fixed epsilon, so it scales with the scene. A query that finds its distance from edge functions (Woop's shear)
rounds each of them too, which a small triangle in the query's projection magnifies: their errors, carried through the
same formula, are the larger part of its bound.
"""

from typing import Any

import warp as wp

from ...harness.frame.effects.mirrors import FINE, GAMMA7, outward, spread
from ...harness.frame.effects.specialise import effects, specialised
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Camera, Corners, Hits, Mesh, Ray, Rays, corners_of, mirrored_ray, ray_of
from ...harness.scene.effects import Switches
from ..common.axes import longest_axis
from ..exact.hit_point import hit_point, plane_distance
from ..exact.triangle import largest, to_float32, to_float64

UNIT = wp.constant(wp.float64(2.0**-24))

SHADOW_END = 1.0 - 2.0**-22
"""Where a shadow segment from the surface (0) to the light (1) ends: a surface exactly at the light does not count."""

NEAR_ZERO = wp.constant(1.0 / 32.0)
FLOAT_STEP = wp.constant(1.0 / 65536.0)
INTEGER_STEP = wp.constant(256.0)
"""The constants of Waechter and Binder's rule."""


@wp.func
def edge_error(px: wp.float64, py: wp.float64, qx: wp.float64, qy: wp.float64, p: wp.vec2d, q: wp.vec2d) -> wp.float64:
    """Bound on the error of p x q in float32; ``p``, ``q`` bound the errors of (px, py) and (qx, qy)."""
    return (
        wp.abs(px) * q[1] + p[0] * wp.abs(qy) + wp.abs(py) * q[0] + p[1] * wp.abs(qx)
        + wp.float64(2.0) * UNIT * (wp.abs(px * qy) + wp.abs(py * qx))
    )  # fmt: skip


@wp.func
def shear_axes(way: Any) -> wp.vec3i:
    """The axes x, y and z of Woop's test: z is the one that a ray follows most."""
    z = longest_axis(wp.abs(way))
    return wp.vec3i((z + 1) % 3, (z + 2) % 3, z)


@wp.func
def sheared(p: Any, k: wp.vec3i, sx: Any, sy: Any) -> Any:
    """A corner relative to the ray's origin, along the axes k: x and y sheared, so that the ray goes along z."""
    return type(p)(p[k[0]] - sx * p[k[2]], p[k[1]] - sy * p[k[2]], p[k[2]])


@wp.func
def rounding_of(p: wp.vec3d, at: wp.vec3d, k: wp.vec3i, sx: wp.float64, sy: wp.float64) -> wp.vec2d:
    """Bounds on the errors of x and y of a corner p that is sheared to ``at`` in float32: one rounding of the difference,
    three of shear and product (and of z in the product), one of the sum.
    """
    return UNIT * wp.vec2d(
        wp.abs(p[k[0]]) + wp.float64(4.0) * wp.abs(sx * p[k[2]]) + wp.abs(at[0]),
        wp.abs(p[k[1]]) + wp.float64(4.0) * wp.abs(sy * p[k[2]]) + wp.abs(at[1]),
    )


@wp.func
def sheared_error(h: wp.vec3d, way: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.float64:
    """Bound on the distance of h from the plane at which Woop's float32 test along ``way`` may still report a hit, in
    scene units.

    The distance is sum(E_i z_i) / sum(E_i), with E_i the edge functions of the sheared corners. Each rounding of
    corner, shear, product and sum is carried through; divided by the sum and projected on the normal, this is the
    numerator's error over twice the triangle's area.
    """
    k = shear_axes(way)
    sx = way[k[0]] / way[k[2]]
    sy = way[k[1]] / way[k[2]]
    p = sheared(a - h, k, sx, sy)
    q = sheared(b - h, k, sx, sy)
    r = sheared(c - h, k, sx, sy)
    ep = rounding_of(a - h, p, k, sx, sy)
    eq = rounding_of(b - h, q, k, sx, sy)
    er = rounding_of(c - h, r, k, sx, sy)
    u = edge_error(r[0], r[1], q[0], q[1], er, eq)
    v = edge_error(p[0], p[1], r[0], r[1], ep, er)
    w = edge_error(q[0], q[1], p[0], p[1], eq, ep)
    own = wp.float64(7.0) * UNIT  # of z, its product with an edge function and the sum of three
    error = (
        wp.abs(p[2]) * (u + own * wp.abs(r[0] * q[1] - r[1] * q[0]))
        + wp.abs(q[2]) * (v + own * wp.abs(p[0] * r[1] - p[1] * r[0]))
        + wp.abs(r[2]) * (w + own * wp.abs(q[0] * p[1] - q[1] * p[0]))
    )
    area = wp.length(wp.cross(b - a, c - a))
    return error / area


@wp.func
def shadow_origin(ray: Ray, light: wp.vec3f, corners: Corners, sheared: wp.bool) -> wp.vec3f:
    """Where the shadow ray of a pixel whose ray hit the triangle starts, in float32.

    ``sheared``: how the query computes its distance. False: from the plane, n . (v - o) / n . d (Embree), wrong by
    the coordinates projected on n. True: from coordinates along the ray (Woop's shear, Warp's Mesh): see
    :func:`sheared_error`.
    """
    h = hit_point(ray, plane_distance(ray, corners), corners)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    n = wp.normalize(wp.cross(b64 - a64, c64 - a64))
    way = to_float64(light) - h
    if wp.dot(n, way) < wp.float64(0.0):
        n = -n
    distance = wp.max(largest(a64 - h), wp.max(largest(b64 - h), largest(c64 - h)))
    step = FINE * (distance + largest(h) + wp.float64(largest(ray.origin))) + GAMMA7 * (
        wp.abs(n[0]) * spread(a64[0], b64[0], c64[0], h[0])
        + wp.abs(n[1]) * spread(a64[1], b64[1], c64[1], h[1])
        + wp.abs(n[2]) * spread(a64[2], b64[2], c64[2], h[2])
    )
    if sheared and largest(way) > wp.float64(0.0):
        step += sheared_error(h, way, a64, b64, c64)
    return to_float32(wp.vec3d(outward(h[0], step * n[0]), outward(h[1], step * n[1]), outward(h[2], step * n[2])))


@wp.kernel(enable_backward=False, grid_stride=False)
def shadow_origin_kernel(
    first: wp.int32,
    light: wp.int32,
    sheared: wp.bool,
    camera: Camera,
    mesh: Mesh,
    lights: wp.array(dtype=wp.vec3f),
    hits: Hits,
    rays: Rays,
    origin: wp.array(dtype=wp.vec3f),
):
    pixel = first + wp.tid()
    best = hits.triangle[pixel]
    if best < 0:
        origin[pixel] = lights[light]
        return
    ray = ray_of(camera, pixel)
    if wp.static(effects.bounced):
        ray = mirrored_ray(rays, pixel)
    origin[pixel] = shadow_origin(ray, lights[light], corners_of(mesh, best), sheared)


def launch_shadow_origins(
    frame: Frame, light: int, origin: wp.array, sheared: bool, bounce: int = 0, part: tuple[int, int] | None = None
) -> None:
    """Fill ``origin`` (vec3f [pixels]) for one light from the hits of a bounce; the light itself at a miss.

    ``part``: first pixel and number of pixels; None: all.
    """
    first, count = part or (0, frame.pixels)
    inputs = [first, light, sheared, frame.camera, frame.mesh, frame.lights, frame.hits(bounce), frame.rays(bounce)]
    frame.launch(specialised(shadow_origin_kernel, Switches(bounced=frame.tabled(bounce))), count, inputs, [origin])


@wp.func
def stepped_coordinate(p: wp.float32, n: wp.float32) -> wp.float32:
    """This number of floats onward, or a fixed step near zero."""
    if wp.abs(p) < NEAR_ZERO:
        return p + FLOAT_STEP * n
    steps = wp.int32(INTEGER_STEP * n)
    if p < 0.0:
        steps = -steps
    return wp.cast(wp.cast(p, wp.int32) + steps, wp.float32)


@wp.func
def stepped(p: wp.vec3f, n: wp.vec3f) -> wp.vec3f:
    """p moved off its surface along the normal n (Waechter & Binder, Ray Tracing Gems 2019, chapter 6)."""
    return wp.vec3f(stepped_coordinate(p[0], n[0]), stepped_coordinate(p[1], n[1]), stepped_coordinate(p[2], n[2]))
