"""Staged tracing of primary rays (paper, section 3): the threads of a block bring triangles to shared memory, then test.

The threads alternate between loading records, one each, and testing what is there, with a synchronisation between
the two. Shared memory is partitioned equally among the sorting tiles of a tracing tile; a round ends the block's
work when no ray of it needs another. The kernels of :mod:`.camera.trace` are the equivalents where blocks have one
thread, and give the same bits. A record's free fourth components carry its triangle and its depth.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray, corners_of, direction_through, weld_of
from ...exact.holes import opaque_at_hit
from ...exact.triangle import NO_HIT, nearer, total
from ..lists.binning import TileLists
from ..lists.items import ListParts, pairs_of_part, part_of
from ..lists.staging import any_of_block, make_shared, wait_for_block
from ..variants import Variant
from .ray_tests import RAY_DECIDES, RAY_PASSES, RECORD, RayRecord, count_tests
from .tiles import ImageTiles, slice_scale
from .trace import indirect_pixel, packed_depth, record_at, slice_start, write_nearest

TRACE_REGISTERS = 80
"""Limit of registers: more warps hide latency. On an H200 frames take 0 to 3 % longer with 64, where more is spilled, and 0
to 2 % longer with 96."""


@wp.func
def tagged(q: wp.vec4f, tag: wp.float32) -> wp.vec4f:
    return wp.vec4f(q[0], q[1], q[2], tag)


@functools.cache
def make_staged_trace_kernel(variant: Variant, block: int) -> wp.Kernel:
    """``block`` threads take one tracing tile, or an equal part of it; of split lists, one part of one tile's."""
    passes = RAY_PASSES[variant.test]
    decide = RAY_DECIDES[variant.test]
    slots = block
    shared = make_shared(RECORD * slots)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, cuda_max_registers=TRACE_REGISTERS)
    def staged_trace_kernel(
        k: wp.int32,
        camera: Camera,
        mesh: Mesh,
        alpha: Alpha,
        grid: ImageTiles,
        lists: TileLists,
        records: wp.array(dtype=wp.vec4f),
        parts: ListParts,
        nearest: wp.array(dtype=wp.uint64),
        hits: Hits,
        hit_points: wp.array(dtype=wp.vec3d),
        tests: wp.array(dtype=wp.int32),
    ):
        thread = wp.tid()
        lane = thread % wp.static(slots)
        tile_area = grid.tile * grid.tile
        area = k * k * tile_area
        shares = (area + wp.static(slots) - 1) // wp.static(slots)
        first = ((thread // wp.static(slots)) % shares) * wp.static(slots)
        work = part_of(parts, (thread // wp.static(slots)) // shares)
        if work[0] < 0:
            return
        place = indirect_pixel(camera, grid, k, work[0], first + lane)
        # The sorting tiles of this block, and how many records of each fit.
        first_sub = first // tile_area
        last_sub = (wp.min(first + wp.static(slots), area) - 1) // tile_area
        room = wp.static(slots) // (last_sub - first_sub + 1)
        # The sorting tile that this thread loads for, by its first pixel (outside the image if the tile is).
        mine = wp.vec3i(-1, -1, -1)
        if first_sub + lane // room <= last_sub:
            mine = indirect_pixel(camera, grid, k, work[0], (first_sub + lane // room) * tile_area)
        load = wp.int32(0)
        load_stop = wp.int32(0)
        if mine[0] >= 0:
            pairs = pairs_of_part(lists, mine[2], parts, work[1])
            load = pairs[0] + lane % room
            load_stop = pairs[1]
        direction = wp.vec3f(0.0, 0.0, 0.0)
        pixel = wp.int32(0)
        left = wp.int32(0)
        depth = wp.float32(wp.INF)
        if place[0] >= 0:
            pixel = place[1] * camera.width + place[0]
            direction = direction_through(camera, place[0], place[1])
            pairs = pairs_of_part(lists, place[2], parts, work[1])
            left = pairs[1] - pairs[0]
            if parts.split > 0:
                depth = packed_depth(nearest[pixel])
        ray = Ray(camera.eye[0], direction)
        size = total(ray.direction)
        per_slice = slice_scale(grid)
        own = ((first + lane) // tile_area - first_sub) * room
        best = wp.int32(-1)
        best_t = wp.float64(wp.INF)
        number = wp.int32(0)
        nothing = wp.vec4f()
        going = any_of_block(left > 0)
        while going:
            if load < load_stop and lane // room * room + room <= wp.static(slots):
                i = lists.values[load]
                r = record_at(records, i)
                start = slice_start(grid, per_slice, lists.keys[load] - mine[2] * grid.slices)
                shared(True, lane, r.q0)
                shared(True, wp.static(slots) + lane, tagged(r.q1, start))
                shared(True, wp.static(2 * slots) + lane, tagged(r.q2, wp.cast(i, wp.float32)))
            load += room
            wait_for_block()
            j = wp.int32(0)
            held = wp.min(left, room)
            while j < held:
                i = wp.int32(-1)
                while j < held and i < 0:
                    s = RayRecord()
                    s.q1 = shared(False, wp.static(slots) + own + j, nothing)
                    if depth < s.q1[3]:
                        left = 0
                        held = 0
                        break
                    s.q0 = shared(False, own + j, nothing)
                    s.q2 = shared(False, wp.static(2 * slots) + own + j, nothing)
                    number += 1
                    if passes(ray.direction, size, s):
                        i = wp.cast(s.q2[3], wp.int32)
                    j += 1
                if i >= 0:
                    corners = corners_of(mesh, i)
                    weld = weld_of(mesh, i)
                    t = decide(ray, corners, weld)
                    if wp.static(effects.alpha):
                        if t > wp.float64(0.0) and not opaque_at_hit(alpha, i, ray, corners, weld):
                            t = NO_HIT
                    if t > wp.float64(0.0) and nearer(mesh, t, i, best_t, best):
                        best = i
                        best_t = t
                        depth = wp.min(depth, wp.float32(best_t))
            left = wp.max(0, left - room)
            going = any_of_block(left > 0)
        if place[0] >= 0:
            write_nearest(pixel, ray, best, best_t, mesh, parts, nearest, hits, hit_points)
            count_tests(tests, pixel, number)

    return staged_trace_kernel
