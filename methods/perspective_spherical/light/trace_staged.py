"""Staged tracing of shadow rays (paper, section 4.4): the block of a chunk brings its list to shared memory.

Loading and testing alternate as in :mod:`.camera.trace_staged`; the block is done where every ray of it is shadowed or
behind its last slice. The kernel of :mod:`.light.trace` is the equivalent where blocks have one thread, and gives the
same bits.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, corners_of, weld_of
from ...exact.holes import opaque_to_light
from ...exact.triangle import largest, to_float32
from ..camera.ray_tests import count_tests
from ..lists.binning import TileLists
from ..lists.chunks import RayChunks
from ..lists.items import ListParts, pairs_of_part, part_of
from ..lists.staging import any_of_block, make_shared, wait_for_block
from ..variants import Variant
from .segment_tests import DOUBT, SEGMENT_DECIDES, SEGMENT_PASSES, USED, YES, SegmentRecord
from .space import LightSpace
from .trace import hit_error, segment_at

SHADOW_REGISTERS = 64
"""The same for shadow rays: 0 to 2 % longer with 80. Blocks of one warp, the default, fill a multiprocessor with 32."""


@wp.func
def tag_row(tag: wp.vec2i) -> wp.vec4f:
    return wp.vec4f(wp.cast(tag[0], wp.float32), wp.cast(tag[1], wp.float32), 0.0, 0.0)


@wp.func
def tag_of(row: wp.vec4f) -> wp.vec2i:
    return wp.vec2i(wp.cast(row[0], wp.int32), wp.cast(row[1], wp.int32))


@functools.cache
def make_staged_shadow_kernel(variant: Variant, block: int) -> wp.Kernel:
    """``block`` threads take one chunk of rays (round by round if r is larger), or with one part of its list."""
    judge = SEGMENT_PASSES[variant.test]
    used = USED[variant.test]
    decide = SEGMENT_DECIDES[variant.test]
    slots = block
    shared = make_shared((1 + used) * slots)

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
        shadowed: wp.array2d(dtype=wp.uint8),
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
        nothing = wp.vec4f()
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
                    if shadowed[space.index, pixel] != wp.uint8(0):
                        deepest = -1
            h = to_float32(h64)
            h_error = hit_error(h)
            number = wp.int32(0)
            occluded = wp.bool(False)
            load = pairs[0]
            active = deepest >= 0
            going = any_of_block(active)
            while going and load < stop:
                if load + lane < stop:
                    i = lists.values[load + lane]
                    r = segment_at(records, i)
                    tag = wp.vec2i(i, lists.keys[load + lane] - tile * slices)
                    shared(True, lane, tag_row(tag))
                    shared(True, wp.static(slots) + lane, r.q0)
                    shared(True, wp.static(2 * slots) + lane, r.q1)
                    shared(True, wp.static(3 * slots) + lane, r.q2)
                    if wp.static(used > 3):
                        shared(True, wp.static(4 * slots) + lane, r.q3)
                    if wp.static(used > 4):
                        shared(True, wp.static(5 * slots) + lane, r.q4)
                        shared(True, wp.static(6 * slots) + lane, r.q5)
                wait_for_block()
                j = wp.int32(0)
                held = wp.int32(0)
                if active:
                    held = wp.min(stop - load, wp.static(slots))
                while j < held:
                    i = wp.int32(-1)
                    while j < held and i < 0:
                        s = SegmentRecord()
                        here = tag_of(shared(False, j, nothing))
                        if here[1] > deepest:
                            active = wp.bool(False)
                            held = 0
                            break
                        if here[0] != own:
                            s.q0 = shared(False, wp.static(slots) + j, nothing)
                            s.q1 = shared(False, wp.static(2 * slots) + j, nothing)
                            s.q2 = shared(False, wp.static(3 * slots) + j, nothing)
                            if wp.static(used > 3):
                                s.q3 = shared(False, wp.static(4 * slots) + j, nothing)
                            if wp.static(used > 4):
                                s.q4 = shared(False, wp.static(5 * slots) + j, nothing)
                                s.q5 = shared(False, wp.static(6 * slots) + j, nothing)
                            number += 1
                            verdict = judge(h, light, h_error, s)
                            if wp.static(effects.alpha):
                                if verdict == YES and alpha.masked[here[0]] != wp.uint8(0):
                                    verdict = DOUBT
                            if verdict == YES:
                                occluded = wp.bool(True)
                                active = wp.bool(False)
                                held = 0
                            if verdict == DOUBT:
                                i = here[0]
                        j += 1
                    if i >= 0:
                        corners = corners_of(mesh, i)
                        weld = weld_of(mesh, i)
                        occluded = decide(h64, light, corners, weld, origin_size)
                        if wp.static(effects.alpha):
                            if occluded:
                                occluded = opaque_to_light(alpha, i, h64, light, corners, weld, origin_size)
                        if occluded:
                            active = wp.bool(False)
                            held = 0
                load += wp.static(slots)
                going = any_of_block(active)
            if occluded:
                shadowed[space.index, pixel] = wp.uint8(1)
            if number > 0:
                count_tests(tests, pixel, number)

    return staged_shadow_kernel
