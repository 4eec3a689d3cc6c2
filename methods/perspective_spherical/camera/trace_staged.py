"""Staged tracing of primary rays (paper, section 3): the threads of a block bring triangles to shared memory, then test.

The threads alternate between loading records, one each, and testing what is there, with a synchronisation between
the two. Shared memory is partitioned equally among the sorting tiles of a tracing tile; a round ends the block's
work when no ray of it needs another. The kernels of :mod:`.camera.trace` are its twins where blocks have one thread, and
give the same bits. A record's free fourth components carry its triangle and its depth.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray, corners_of, weld_of
from ....harness.frame.specialise import effects
from ...common.alpha import opaque_at_hit
from ...common.triangle import NO_HIT, nearer, write_hit
from ..variants import Variant
from .ray_tests import RAY_DECIDES, RAY_PASSES, RayRecord
from .tiles import slice_scale
from .trace import indirect_pixel, packed_depth, packed_hit, record_at, slice_start

TRACE_REGISTERS = 64
"""A cap that lets more warps hide each other's waiting than what it spills costs: 0.30 to 0.25 ms on Buddha."""


@wp.func
def tagged(q: wp.vec4f, tag: wp.float32) -> wp.vec4f:
    return wp.vec4f(q[0], q[1], q[2], tag)


@functools.cache
def make_staged_trace_kernel(variant: Variant, block: int) -> wp.Kernel:
    """``block`` threads take one tracing tile, or an equal part of it; of split lists, one part of one tile's."""
    passes = RAY_PASSES[variant.test]
    decide = RAY_DECIDES[variant.test]
    slots = block

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, cuda_max_registers=TRACE_REGISTERS)
    def staged_trace_kernel(
        tile: wp.int32,
        k: wp.int32,
        slices: wp.int32,
        split: wp.int32,
        camera: Camera,
        mesh: Mesh,
        depth_range: wp.array(dtype=wp.float32),
        begin: wp.array(dtype=wp.int32),
        end: wp.array(dtype=wp.int32),
        keys: wp.array(dtype=wp.int32),
        values: wp.array(dtype=wp.int32),
        records: wp.array(dtype=wp.vec4f),
        alpha: Alpha,
        items: wp.array(dtype=wp.vec2i),
        item_scan: wp.array(dtype=wp.int64),
        nearest: wp.array(dtype=wp.uint64),
        hits: Hits,
        hit_points: wp.array(dtype=wp.vec3d),
        tests: wp.array(dtype=wp.int32),
    ):
        thread = wp.tid()
        lane = thread % wp.static(slots)
        area = k * k * tile * tile
        shares = (area + wp.static(slots) - 1) // wp.static(slots)
        source = (thread // wp.static(slots)) // shares
        first = ((thread // wp.static(slots)) % shares) * wp.static(slots)
        part = wp.int32(0)
        if split > 0:
            if wp.int64(source) >= item_scan[item_scan.shape[0] - 1]:
                return
            part = items[source][1]
            source = items[source][0]
        place = indirect_pixel(source, first + lane, camera.width, camera.height, tile, k)
        # The sorting tiles of this block, and how many records of each fit.
        first_sub = first // (tile * tile)
        last_sub = wp.min(first + wp.static(slots), area) - 1
        room = wp.static(slots) // (last_sub // (tile * tile) - first_sub + 1)
        # What this thread loads for, by the first pixel of its sorting tile (outside the image if that is).
        mine = wp.vec3i(-1, -1, -1)
        if first_sub + lane // room <= last_sub // (tile * tile):
            mine = indirect_pixel(
                source, (first_sub + lane // room) * tile * tile, camera.width, camera.height, tile, k
            )
        load = wp.int32(0)
        load_stop = wp.int32(0)
        if mine[0] >= 0:
            load = begin[mine[2]] + part * split
            load_stop = end[mine[2]]
            if split > 0:
                load_stop = wp.min(load_stop, load + split)
            load += lane % room
        ray = Ray(camera.eye[0], wp.vec3f(0.0, 0.0, 0.0))
        pixel = wp.int32(0)
        left = wp.int32(0)
        depth = wp.float32(wp.INF)
        if place[0] >= 0:
            pixel = place[1] * camera.width + place[0]
            ray.direction = camera.column[place[0]] + camera.row[place[1]]
            left = end[place[2]] - begin[place[2]]
            if split > 0:
                left = wp.min(left - part * split, split)
                depth = packed_depth(nearest[pixel])
        d = ray.direction
        size = wp.abs(d[0]) + wp.abs(d[1]) + wp.abs(d[2])
        per_slice = slice_scale(depth_range, slices)
        own = (((first + lane) // (tile * tile)) - first_sub) * room
        best = wp.int32(-1)
        best_t = wp.float64(wp.INF)
        number = wp.int32(0)
        shared0 = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec4f, storage="shared")
        shared1 = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec4f, storage="shared")
        shared2 = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec4f, storage="shared")
        going = wp.tile_extract(wp.tile_max(wp.tile(left)), 0)
        while going > 0:
            r = RayRecord()
            loads = load < load_stop and lane // room * room + room <= wp.static(slots)
            if loads:
                i = values[load]
                r = record_at(records, i)
                r.q1 = tagged(r.q1, slice_start(depth_range, per_slice, keys[load] - mine[2] * slices))
                r.q2 = tagged(r.q2, wp.cast(i, wp.float32))
            load += room
            wp.tile_scatter_masked(shared0, lane, r.q0, loads)
            wp.tile_scatter_masked(shared1, lane, r.q1, loads)
            wp.tile_scatter_masked(shared2, lane, r.q2, loads)
            j = wp.int32(0)
            held = wp.min(left, room)
            while j < held:
                i = wp.int32(-1)
                while j < held and i < 0:
                    s = RayRecord()
                    s.q1 = wp.tile_extract(shared1, own + j)
                    if depth < s.q1[3]:
                        left = 0
                        held = 0
                        break
                    s.q0 = wp.tile_extract(shared0, own + j)
                    s.q2 = wp.tile_extract(shared2, own + j)
                    number += 1
                    if passes(d, size, s):
                        i = wp.cast(s.q2[3], wp.int32)
                    j += 1
                if i >= 0:
                    corners = corners_of(mesh, i)
                    weld = weld_of(mesh, i)
                    t = decide(ray, corners, weld)
                    if wp.static(effects.alpha):
                        if t > wp.float64(0.0) and not opaque_at_hit(alpha, i, ray, corners, weld):
                            t = NO_HIT
                    if t > wp.float64(0.0) and nearer(t, i, best_t, best):
                        best = i
                        best_t = t
                        depth = wp.min(depth, wp.float32(best_t))
            left = wp.max(0, left - room)
            going = wp.tile_extract(wp.tile_max(wp.tile(left)), 0)
        if place[0] >= 0:
            if split > 0:
                if best >= 0:
                    wp.atomic_min(nearest, pixel, packed_hit(best_t, best))
                if tests.shape[0] > 1:
                    wp.atomic_add(tests, pixel, number)
            else:
                write_hit(hits, hit_points, pixel, ray, best, best_t, mesh)
                if tests.shape[0] > 1:
                    tests[pixel] = number

    return staged_trace_kernel
