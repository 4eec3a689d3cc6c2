"""Shadow origins for queries that only take a float32 ray and cannot skip a triangle (Embree, Warp's Mesh).

The origin is the float64 hit point moved off its triangle's plane, towards the light's side, by a bound on what
the query's own float32 arithmetic can be wrong by, then rounded outward. The bound is Pharr, Jakob & Humphreys'
(PBRT, 4th edition, section 6.8): gamma_7 = 7 u / (1 - 7 u) times the coordinates that the query subtracts and
multiplies, projected on the normal; no fixed epsilon, so it scales with the scene.
"""

from __future__ import annotations

import warp as wp

from ...harness.frame import Frame
from .hitpoint import plane_distance
from .triangle import hit_point, largest, to_float32, to_float64

GAMMA7 = wp.constant(wp.float64(7.0 * 2.0**-24 / (1.0 - 7.0 * 2.0**-24)))
FINE = wp.constant(wp.float64(2.0**-48))  # the float64 hit point's own rounding, 32 of its units
OUTWARD = wp.constant(wp.float64(2.0**-23))  # a unit in the last place, at least, of any float32

SHADOW_END = 1.0 - 2.0**-22
"""Where a shadow segment from the surface (0) to the light (1) ends: a surface exactly at the light does not count."""


@wp.func
def farthest(a: wp.float64, b: wp.float64, c: wp.float64, x: wp.float64) -> wp.float64:
    """|x| and the largest distance from x to a, b and c, added: what a query subtracts along one axis."""
    return wp.abs(x) + wp.max(wp.abs(a - x), wp.max(wp.abs(b - x), wp.abs(c - x)))


@wp.func
def moved_out(x: wp.float64, step: wp.float64) -> wp.float64:
    """x + step, and a unit in the last place further, so that rounding to float32 never moves it back."""
    y = x + step
    if step > wp.float64(0.0):
        return y + OUTWARD * wp.abs(y)
    if step < wp.float64(0.0):
        return y - OUTWARD * wp.abs(y)
    return y


@wp.func
def shadow_origin(
    o: wp.vec3f, d: wp.vec3f, light: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, sheared: wp.bool
) -> wp.vec3f:
    """Where the shadow ray of the pixel ray o + t d that hit the triangle (a, b, c) starts, in float32.

    ``sheared`` says how the query finds its distance. False: from the plane, n . (v - o) / n . d (Embree), wrong by
    the coordinates projected on n. True: from coordinates along the ray (Woop's shear, Warp's Mesh), wrong along
    the ray by its share of the triangle's extent, which is more where the ray is steep.
    """
    h = hit_point(o, d, plane_distance(o, d, a, b, c))
    a64 = to_float64(a)
    b64 = to_float64(b)
    c64 = to_float64(c)
    n = wp.normalize(wp.cross(b64 - a64, c64 - a64))
    way = to_float64(light) - h
    if wp.dot(n, way) < wp.float64(0.0):
        n = -n
    reach = wp.max(largest(a64 - h), wp.max(largest(b64 - h), largest(c64 - h)))
    step = FINE * (reach + largest(h) + wp.float64(largest(o))) + GAMMA7 * (
        wp.abs(n[0]) * farthest(a64[0], b64[0], c64[0], h[0])
        + wp.abs(n[1]) * farthest(a64[1], b64[1], c64[1], h[1])
        + wp.abs(n[2]) * farthest(a64[2], b64[2], c64[2], h[2])
    )
    if sheared and largest(way) > wp.float64(0.0):
        step += GAMMA7 * reach * wp.dot(n, way) / largest(way)
    return to_float32(
        wp.vec3d(moved_out(h[0], step * n[0]), moved_out(h[1], step * n[1]), moved_out(h[2], step * n[2]))
    )


@wp.kernel(enable_backward=False)
def shadow_origin_kernel(
    width: wp.int32,
    light: wp.int32,
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    lights: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    triangle: wp.array(dtype=wp.int32),
    sheared: wp.bool,
    origin: wp.array(dtype=wp.vec3f),
):
    pixel = wp.tid()
    best = triangle[pixel]
    if best < 0:
        origin[pixel] = lights[light]
        return
    face = triangles[best]
    d = column[pixel % width] + row[pixel // width]
    origin[pixel] = shadow_origin(
        eye[0], d, lights[light], points[face[0]], points[face[1]], points[face[2]], sheared
    )


def launch_shadow_origins(frame: Frame, light: int, origin: wp.array, sheared: bool) -> None:
    """Fill ``origin`` (vec3f [pixels]) for one light from ``frame.answers.triangle``; the light itself at a miss."""
    wp.launch(
        shadow_origin_kernel,
        dim=frame.pixels,
        inputs=[
            frame.width, light, frame.eye, frame.column, frame.row, frame.lights, frame.points, frame.triangles,
            frame.answers.triangle, sheared,
        ],
        outputs=[origin],
        device=frame.device,
    )  # fmt: skip
