"""Answers of the primary rays, from the nearest word of each pixel."""

from __future__ import annotations

from typing import Any

import warp as wp

from ....harness.frame.geometry import Camera, Corners, Hits, Mesh, Ray
from ...common.pixels import tile_pixel
from ...exact.certain_hit import certain_hit
from ...exact.hit_point import along, flat_hit_point, is_flat, is_vague, plane_distance, steep_hit_point
from ...exact.triangle import spare_bits, to_float32
from ...gpu.entries import entry, set_entry, set_entry_last
from ..reads import corners_at, direction_at, weld_at
from .pixels import index_of

REGISTERS = 80
"""Registers per thread, for six blocks of 128 per multiprocessor; with 72 the kernel spills."""


NO_POINT = wp.uint8
"""The type of hit points that are not kept."""


@wp.func
def set_point(points: wp.array(dtype=wp.vec3d), i: wp.int32, point: wp.vec3d):
    set_entry(points, i, point)


# A predicated store: with a branch the compiler computes a hit and a miss apart, and needs more registers for the hit.
SET_POINT_OF_HIT = """
#if defined(__CUDA_ARCH__)
asm volatile("{{ .reg .pred hit; setp.ge.s32 hit, %4, 0; @hit st.global.{kind} [%0], %1;"
    " @hit st.global.{kind} [%0 + {size}], %2; @hit st.global.{kind} [%0 + 2 * {size}], %3; }}"
    :: "l"((unsigned long long)(points.data + i)), "{letter}"(point[0]), "{letter}"(point[1]), "{letter}"(point[2]),
    "r"(triangle) : "memory");
#else
if (triangle >= 0) points.data[i] = point;
#endif
"""


@wp.func_native(SET_POINT_OF_HIT.format(kind="f64", size=8, letter="d"))
def set_point_of(points: wp.array(dtype=wp.vec3d), i: wp.int32, point: wp.vec3d, triangle: wp.int32): ...


@wp.func_native(SET_POINT_OF_HIT.format(kind="f32", size=4, letter="f"))
def set_point_of(points: wp.array(dtype=wp.vec3f), i: wp.int32, point: wp.vec3f, triangle: wp.int32): ...


@wp.func
def set_point_of_hit(points: wp.array(dtype=wp.vec3d), i: wp.int32, point: wp.vec3d, triangle: wp.int32):
    """Set a pixel's hit point where it hit a triangle (>= 0)."""
    set_point_of(points, i, point, triangle)


@wp.func
def set_point_of_hit(points: wp.array(dtype=wp.vec3f), i: wp.int32, point: wp.vec3d, triangle: wp.int32):
    set_point_of(points, i, to_float32(point), triangle)


@wp.func
def quick_point(points: wp.array(dtype=wp.vec3d), ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    """The hit point where :func:`takes_exact_path` says no."""
    return steep_hit_point(ray, t, corners)


@wp.func
def quick_point(points: wp.array(dtype=wp.vec3f), ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    return along(ray, t)


@wp.func
def takes_exact_path(points: wp.array(dtype=wp.vec3d), ray: Ray, t: wp.float64, corners: Corners) -> wp.bool:
    """Whether the hit point is one that :func:`...exact.hit_point.flat_hit_point` computes."""
    return is_flat(ray, t, corners)


@wp.func
def takes_exact_path(points: wp.array(dtype=wp.vec3f), ray: Ray, t: wp.float64, corners: Corners) -> wp.bool:
    return is_vague(ray, corners)


@wp.func
def set_point(points: wp.array(dtype=wp.vec3f), i: wp.int32, point: wp.vec3d):
    set_entry(points, i, to_float32(point))


@wp.func
def set_point_of_hit(points: wp.array(dtype=NO_POINT), i: wp.int32, point: wp.vec3d, triangle: wp.int32):
    """No hit points are kept."""
    return


@wp.func
def quick_point(points: wp.array(dtype=NO_POINT), ray: Ray, t: wp.float64, corners: Corners) -> wp.vec3d:
    return wp.vec3d()


@wp.func
def takes_exact_path(points: wp.array(dtype=NO_POINT), ray: Ray, t: wp.float64, corners: Corners) -> wp.bool:
    return False


@wp.func
def set_point(points: wp.array(dtype=NO_POINT), i: wp.int32, point: wp.vec3d):
    return


@wp.func
def resolve_pixel(
    at: wp.vec2i,
    word: wp.uint64,
    camera: Camera,
    mesh: Mesh,
    hits: Hits,
    hit_points: wp.array(dtype=Any),
):
    pixel = at[1] * camera.width + at[0]
    best = wp.int32(-1)
    t = wp.float32(wp.INF)
    uv = wp.vec2f()
    hit = wp.vec3d()
    flat = wp.bool(False)
    # Nothing is written before all is computed: after a store the compiler would read and widen the corners again.
    if word != wp.uint64(0):
        best = index_of(word, spare_bits(mesh.triangles.shape[0]))
        corners = corners_at(mesh, best)
        ray = Ray(entry(camera.eye, 0), direction_at(camera, at[0], at[1]))
        found = certain_hit(ray, corners, weld_at(mesh, best))
        t = wp.float32(found.t)
        uv = found.uv
        hit = quick_point(hit_points, ray, found.t, corners)
        flat = takes_exact_path(hit_points, ray, found.t, corners)
    set_entry_last(hits.triangle, pixel, best)
    set_entry_last(hits.t, pixel, t)
    set_entry_last(hits.u, pixel, uv[0])
    set_entry_last(hits.v, pixel, uv[1])
    set_point_of_hit(hit_points, pixel, hit, best)
    # Flat rays are few and slow to compute. Their input is read again, so that no registers hold it until here.
    if flat:
        corners = corners_at(mesh, best)
        y = wp.int32(wp.uint32(pixel) // wp.uint32(camera.width))
        ray = Ray(entry(camera.eye, 0), direction_at(camera, pixel - y * camera.width, y))
        set_point(hit_points, pixel, flat_hit_point(ray, plane_distance(ray, corners), corners))


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=REGISTERS)
def resolve_kernel(
    camera: Camera,
    mesh: Mesh,
    nearest: wp.array(dtype=wp.uint64),
    hits: Hits,
    hit_points: wp.array(dtype=Any),
):
    """A thread for each pixel, 8 x 4 per warp. Writes the same bits as :func:`...exact.triangle.write_hit`.

    hit_points: vec3d, or vec3f where they are needed rounded, or empty and :data:`NO_POINT`; nothing is written at a miss.
    """
    at = tile_pixel(wp.tid(), camera.width, camera.height)
    if at[0] >= 0:
        word = entry(nearest, at[1] * camera.width + at[0])
        resolve_pixel(at, word, camera, mesh, hits, hit_points)


for kind in (wp.vec3d, wp.vec3f, NO_POINT):
    wp.overload(resolve_kernel, {"hit_points": wp.array(dtype=kind)})
