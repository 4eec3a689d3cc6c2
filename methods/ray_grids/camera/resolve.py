"""Answers of the primary rays, from the nearest word of each pixel."""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Corners, Ray
from ...common.entries import entry, set_entry
from ...common.hitpoint import flat_hit_point, is_flat, plane_distance, steep_hit_point
from ...common.pixels import tile_pixel
from ...common.triangle import hit_weights

REGISTERS = 72
"""Registers a thread: seven blocks of 128 a multiprocessor; 64 spill."""


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=REGISTERS)
def resolve_kernel(
    width: wp.int32,
    height: wp.int32,
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
    nearest: wp.array(dtype=wp.uint64),
    triangle_out: wp.array(dtype=wp.int32),
    t_out: wp.array(dtype=wp.float32),
    u_out: wp.array(dtype=wp.float32),
    v_out: wp.array(dtype=wp.float32),
    hit_out: wp.array(dtype=wp.vec3d),
):
    """One thread a pixel, 8 x 4 a warp. What :func:`..common.triangle.write_hit` writes, to the bit."""
    at = tile_pixel(wp.tid(), width, height)
    if at[0] < 0:
        return
    pixel = at[1] * width + at[0]
    word = entry(nearest, pixel)
    best = wp.int32(-1)
    t = wp.float32(wp.INF)
    uv = wp.vec2f()
    hit = wp.vec3d()
    flat = wp.bool(False)
    # Nothing is written before all is reckoned: after a store the compiler would read and widen the corners again.
    if word != wp.uint64(0):
        best = 0xFFFFFF - wp.int32(word & wp.uint64(0xFFFFFF))
        face = entry(triangles, best)
        corners = Corners(entry(points, face[0]), entry(points, face[1]), entry(points, face[2]))
        ray = Ray(entry(eye, 0), entry(column, at[0]) + entry(row, at[1]))
        same = wp.vec3i(entry(weld, face[0]), entry(weld, face[1]), entry(weld, face[2]))
        distance = plane_distance(ray, corners)
        t = wp.float32(distance)
        uv = hit_weights(ray, corners, same)
        hit = steep_hit_point(ray, distance, corners)
        flat = is_flat(ray.direction, corners)
    set_entry(triangle_out, pixel, best)
    set_entry(t_out, pixel, t)
    set_entry(u_out, pixel, uv[0])
    set_entry(v_out, pixel, uv[1])
    set_entry(hit_out, pixel, hit)
    # Flat rays are few, and long to reckon: from corners that are read again, so that nothing is held for them till here.
    if flat:
        again = entry(triangles, best)
        corners = Corners(entry(points, again[0]), entry(points, again[1]), entry(points, again[2]))
        ray = Ray(entry(eye, 0), entry(column, at[0]) + entry(row, at[1]))
        set_entry(hit_out, pixel, flat_hit_point(ray, plane_distance(ray, corners), corners))
