"""Float64 hit points for methods whose own query returns no more than a triangle (Embree, Warp's Mesh)."""

from __future__ import annotations

import warp as wp

from ...harness.frame import Frame
from .triangle import hit_point, to_float64


@wp.func
def plane_distance(o: wp.vec3f, d: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.float64:
    """t of the ray on the triangle's plane, without asking whether it lies inside."""
    a64 = to_float64(a)
    n = wp.cross(to_float64(b) - a64, to_float64(c) - a64)
    return wp.dot(n, a64 - to_float64(o)) / wp.dot(n, to_float64(d))


@wp.kernel(enable_backward=False)
def hit_point_kernel(
    width: wp.int32,
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    triangle: wp.array(dtype=wp.int32),
    hit: wp.array(dtype=wp.vec3d),
):
    pixel = wp.tid()
    best = triangle[pixel]
    if best < 0:
        hit[pixel] = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
        return
    face = triangles[best]
    o = eye[0]
    d = column[pixel % width] + row[pixel // width]
    a = points[face[0]]
    b = points[face[1]]
    c = points[face[2]]
    hit[pixel] = hit_point(o, d, plane_distance(o, d, a, b, c), a, b, c)


def launch_hit_points(frame: Frame, hit: wp.array) -> None:
    """Fill ``hit`` (vec3d [pixels]) from ``frame.answers.triangle``; zero at a miss."""
    wp.launch(
        hit_point_kernel,
        dim=frame.pixels,
        inputs=[
            frame.width, frame.eye, frame.column, frame.row, frame.points, frame.triangles, frame.answers.triangle,
        ],
        outputs=[hit],
        device=frame.device,
    )  # fmt: skip
