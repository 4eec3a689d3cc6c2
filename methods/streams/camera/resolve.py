"""Answers of the primary rays, from the nearest word of each pixel; and hit points, where a later pass reads them."""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh
from ...common.pixels import tile_pixel
from ...common.reads import corners_at, ray_at, ray_of_pixel, weld_at
from ...exact.certain_hit import certain_hit
from ...exact.hit_point import along, flat_hit_point, is_flat, is_vague, plane_distance, steep_hit_point
from ...exact.triangle import spare_bits, to_float32
from ...gpu.entries import entry, set_entry, set_entry_last
from ..occlusion.closed import refuse, seen_from_back
from .pixels import index_of

REGISTERS = 80
"""Registers per thread, for six blocks of 128 per multiprocessor; with 72 the kernel spills."""

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
def set_point_of(points: wp.array(dtype=wp.vec3d), i: wp.int32, point: wp.vec3d, triangle: wp.int32):
    """Set a pixel's hit point where it hit a triangle (>= 0)."""


@wp.func_native(SET_POINT_OF_HIT.format(kind="f32", size=4, letter="f"))
def set_point_of(points: wp.array(dtype=wp.vec3f), i: wp.int32, point: wp.vec3f, triangle: wp.int32): ...


@functools.cache
def make_resolve_kernel(points: str) -> wp.Kernel:
    """A thread for each pixel, 8 x 4 per warp. Writes the same bits as :func:`...exact.triangle.write_hit`.

    points  the hit points that are kept: "exact", "rounded" to float32, or "none". Nothing is written at a miss
    """

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def resolve_kernel(
        camera: Camera,
        mesh: Mesh,
        nearest: wp.array(dtype=wp.uint64),
        hits: Hits,
        hit_points: wp.array(dtype=wp.vec3d),
        rounded_points: wp.array(dtype=wp.vec3f),
        touched: wp.array(dtype=wp.int32),
    ):
        at = tile_pixel(wp.tid(), camera.width, camera.height)
        if at[0] < 0:
            return
        pixel = at[1] * camera.width + at[0]
        word = entry(nearest, pixel)
        best = wp.int32(-1)
        t = wp.float32(wp.INF)
        uv = wp.vec2f()
        hit = wp.vec3d()
        flat = wp.bool(False)
        # Nothing is written before all is computed: after a store the compiler would read and widen the corners again.
        if word != wp.uint64(0):
            best = index_of(word, spare_bits(mesh.triangles.shape[0]))
            corners = corners_at(mesh, best)
            ray = ray_at(camera, at[0], at[1])
            found = certain_hit(ray, corners, weld_at(mesh, best))
            t = wp.float32(found.t)
            uv = found.uv
            if wp.static(effects.closed):
                if seen_from_back(entry(mesh.valid, best), ray.direction, corners):
                    refuse(mesh, best, touched)
            if wp.static(points == "exact"):
                hit = steep_hit_point(ray, found.t, corners)
                flat = is_flat(ray, found.t, corners)
            if wp.static(points == "rounded"):
                hit = along(ray, found.t)
                flat = is_vague(ray, corners)
        set_entry_last(hits.triangle, pixel, best)
        set_entry_last(hits.t, pixel, t)
        set_entry_last(hits.u, pixel, uv[0])
        set_entry_last(hits.v, pixel, uv[1])
        if wp.static(points == "exact"):
            set_point_of(hit_points, pixel, hit, best)
        if wp.static(points == "rounded"):
            set_point_of(rounded_points, pixel, to_float32(hit), best)
        if wp.static(points != "none"):
            # Flat rays are few and slow to compute. Their input is read again, so that no registers hold it until here.
            if flat:
                corners = corners_at(mesh, best)
                ray = ray_of_pixel(camera, pixel)
                hit = flat_hit_point(ray, plane_distance(ray, corners), corners)
                if wp.static(points == "exact"):
                    set_entry(hit_points, pixel, hit)
                else:
                    set_entry(rounded_points, pixel, to_float32(hit))

    return resolve_kernel
