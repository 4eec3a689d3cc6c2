"""Staged tracing of shadow rays (paper, section 4.4): the block of a chunk brings its list to shared memory.

Loading and testing alternate as in :mod:`.camera.trace_staged`; the block is done where every ray of it is shadowed or
behind its last slice. The kernel of :mod:`.light.trace` is the equivalent where blocks have one thread, and gives the
same bits.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Hits, Mesh, corners_of, weld_of
from ....harness.frame.specialise import effects
from ...common.alpha import opaque_to_light
from ...common.triangle import largest, to_float32
from ..camera.ray_tests import count_tests
from ..lists.binning import TileLists
from ..lists.chunks import RayChunks
from ..lists.items import ListParts, pairs_of_part, part_of
from ..variants import Variant
from .segment_tests import DOUBT, SEGMENT_DECIDES, SEGMENT_PASSES, USED, YES, SegmentRecord
from .space import LightSpace
from .trace import hit_error, segment_at

SHADOW_REGISTERS = 80
"""A cap, as in :mod:`.camera.trace_staged`."""


@functools.cache
def make_staged_shadow_kernel(variant: Variant, block: int) -> wp.Kernel:
    """``block`` threads take one chunk of rays (round by round if r is larger), or with one part of its list."""
    judge = SEGMENT_PASSES[variant.test]
    used = USED[variant.test]
    decide = SEGMENT_DECIDES[variant.test]
    slots = block

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, cuda_max_registers=SHADOW_REGISTERS)
    def staged_shadow_kernel(
        lanes: wp.int32,
        slices: wp.int32,
        space: LightSpace,
        camera: Camera,
        mesh: Mesh,
        alpha: Alpha,
        hits: Hits,
        hit_points: wp.array(dtype=wp.vec3d),
        last_slice: wp.array(dtype=wp.int32),
        chunks: RayChunks,
        lists: TileLists,
        records: wp.array(dtype=wp.vec4f),
        parts: ListParts,
        visibility: wp.array2d(dtype=wp.uint8),
        tests: wp.array(dtype=wp.int32),
    ):
        thread = wp.tid()
        lane = thread % wp.static(slots)
        work = part_of(parts, thread // wp.static(slots))
        chunk = work[0]
        if chunk < 0 or chunk >= chunks.total[0]:
            return
        light = space.lights[space.index]
        origin_size = wp.float64(largest(camera.eye[0]))
        tile = chunks.tiles[chunks.first[chunk]]
        pairs = pairs_of_part(lists, tile, parts, work[1])
        stop = pairs[1]
        shared0 = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec4f, storage="shared")
        shared1 = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec4f, storage="shared")
        shared2 = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec4f, storage="shared")
        shared3 = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec4f, storage="shared")
        shared4 = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec4f, storage="shared")
        shared5 = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec4f, storage="shared")
        tags = wp.tile_zeros(shape=wp.static(slots), dtype=wp.vec2i, storage="shared")
        base = chunks.first[chunk]
        while base < chunks.first[chunk + 1]:
            at = base + lane
            base += wp.static(slots)
            pixel = wp.int32(0)
            own = wp.int32(-1)
            h64 = wp.vec3d()
            deepest = wp.int32(-1)
            if at < chunks.first[chunk + 1]:
                pixel = chunks.pixels[at]
                h64 = hit_points[pixel]
                own = hits.triangle[pixel]
                deepest = last_slice[pixel]
                if parts.split > 0:
                    if visibility[space.index, pixel] != wp.uint8(0):
                        deepest = -1
            h = to_float32(h64)
            h_error = hit_error(h)
            number = wp.int32(0)
            shadowed = wp.bool(False)
            load = pairs[0]
            active = wp.int32(0)
            if deepest >= 0:
                active = 1
            going = wp.tile_extract(wp.tile_max(wp.tile(active)), 0)
            while going != 0 and load < stop:
                r = SegmentRecord()
                tag = wp.vec2i(0, 0)
                loads = load + lane < stop
                if loads:
                    i = lists.values[load + lane]
                    r = segment_at(records, i)
                    tag = wp.vec2i(i, lists.keys[load + lane] - tile * slices)
                wp.tile_scatter_masked(shared0, lane, r.q0, loads)
                wp.tile_scatter_masked(shared1, lane, r.q1, loads)
                wp.tile_scatter_masked(shared2, lane, r.q2, loads)
                if wp.static(used > 3):
                    wp.tile_scatter_masked(shared3, lane, r.q3, loads)
                if wp.static(used > 4):
                    wp.tile_scatter_masked(shared4, lane, r.q4, loads)
                    wp.tile_scatter_masked(shared5, lane, r.q5, loads)
                wp.tile_scatter_masked(tags, lane, tag, loads)
                j = wp.int32(0)
                held = wp.int32(0)
                if active != 0:
                    held = wp.min(stop - load, wp.static(slots))
                while j < held:
                    i = wp.int32(-1)
                    while j < held and i < 0:
                        s = SegmentRecord()
                        here = wp.tile_extract(tags, j)
                        if here[1] > deepest:
                            active = 0
                            held = 0
                            break
                        if here[0] != own:
                            s.q0 = wp.tile_extract(shared0, j)
                            s.q1 = wp.tile_extract(shared1, j)
                            s.q2 = wp.tile_extract(shared2, j)
                            if wp.static(used > 3):
                                s.q3 = wp.tile_extract(shared3, j)
                            if wp.static(used > 4):
                                s.q4 = wp.tile_extract(shared4, j)
                                s.q5 = wp.tile_extract(shared5, j)
                            number += 1
                            verdict = judge(h, light, h_error, s)
                            if wp.static(effects.alpha):
                                if verdict == YES and alpha.masked[here[0]] != wp.uint8(0):
                                    verdict = DOUBT
                            if verdict == YES:
                                shadowed = wp.bool(True)
                                active = 0
                                held = 0
                            if verdict == DOUBT:
                                i = here[0]
                        j += 1
                    if i >= 0:
                        corners = corners_of(mesh, i)
                        weld = weld_of(mesh, i)
                        shadowed = decide(h64, light, corners, weld, origin_size)
                        if wp.static(effects.alpha):
                            if shadowed:
                                shadowed = opaque_to_light(alpha, i, h64, light, corners, weld, origin_size)
                        if shadowed:
                            active = 0
                            held = 0
                load += wp.static(slots)
                going = wp.tile_extract(wp.tile_max(wp.tile(active)), 0)
            if shadowed:
                visibility[space.index, pixel] = wp.uint8(1)
            if number > 0:
                count_tests(tests, pixel, number)

    return staged_shadow_kernel
