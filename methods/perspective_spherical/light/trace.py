"""Tracing shadow rays through a light grid (paper, section 4.4): any hit, one thread block per chunk.

The block brings its list to shared memory; loading and testing alternate as in :mod:`.camera.trace`. It is done where
every ray of it is shadowed or behind its last slice. The bit is set in primary-ray order, so that blocks need no
synchronisation. With split lists (:mod:`.variants.split_lists`) a block takes one part of a chunk's list, and skips rays
whose bit another part has set.
"""

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, corners_of, weld_of
from ...exact.holes import opaque_to_light
from ...exact.triangle import U32, largest, to_float32
from ...gpu.entries import entry
from ..camera.ray_tests import count_tests
from ..lists.chunks import RayChunks
from ..lists.staging import any_of_block, make_shared, wait_for_block
from ..variants.split_lists import ListParts, pairs_of_part, part_of
from .mapping import LightSpace
from .rays import LightRays
from .segment_tests import SEGMENT_DECIDES, SEGMENT_PASSES, UNDECIDED, USED, YES, SegmentRecord
from .tile_edges import LightTiles

SHADOW_REGISTERS = 64
"""Limit of registers: frames take 0 to 2 % longer with 80. Blocks of one warp, the default, fill a
multiprocessor with 32.
"""


@wp.func
def segment_at(records: wp.array(dtype=wp.vec4f), i: wp.int32) -> SegmentRecord:
    r = SegmentRecord()
    r.q0 = entry(records, 6 * i)
    r.q1 = entry(records, 6 * i + 1)
    r.q2 = entry(records, 6 * i + 2)
    r.q3 = entry(records, 6 * i + 3)
    r.q4 = entry(records, 6 * i + 4)
    r.q5 = entry(records, 6 * i + 5)
    return r


@wp.func
def hit_error(h: wp.vec3f) -> wp.float32:
    """Bound on the change of each coordinate when the float64 hit point was rounded to h."""
    return U32 * largest(h) + 1.0e-37


@wp.func
def tag_row(triangle: wp.int32, slice: wp.int32) -> wp.vec4f:
    return wp.vec4f(wp.cast(triangle, wp.float32), wp.cast(slice, wp.float32), 0.0, 0.0)


@wp.func
def tag_of(row: wp.vec4f) -> wp.vec2i:
    """(triangle, slice) of a pair in shared memory."""
    return wp.vec2i(wp.cast(row[0], wp.int32), wp.cast(row[1], wp.int32))


@functools.cache
def make_shadow_kernel(test: int, block: int) -> wp.Kernel:
    """``block`` threads take one chunk of rays (round by round if r is larger), or with one part of its list.

    With 0 they are ``lanes`` threads, of which each reads triangles for itself: the same bits, on any device.
    """
    judge, decide, used = SEGMENT_PASSES[test], SEGMENT_DECIDES[test], USED[test]
    staged, slots = block > 0, max(1, block)
    shared = make_shared((1 + used) * slots)
    limit = {"cuda_max_registers": SHADOW_REGISTERS} if staged else {}

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, **limit)
    def shadow_kernel(
        lanes: wp.int32,
        space: LightSpace,
        grid: LightTiles,
        rays: LightRays,
        camera: Camera,
        mesh: Mesh,
        alpha: Alpha,
        hits: Hits,
        chunks: RayChunks,
        parts: ListParts,
        shadowed: wp.array2d(dtype=wp.uint8),
        tests: wp.array(dtype=wp.int32),
    ):
        thread = wp.tid()
        width = lanes
        if wp.static(staged):
            width = wp.static(slots)
        lane = thread % width
        work = part_of(parts, thread // width)
        chunk = work[0]
        if chunk < 0 or chunk >= chunks.total[0]:
            return
        light = space.lights[space.index]
        origin_size = wp.float64(largest(camera.eye[0]))
        tile = chunks.tiles[chunks.first[chunk]]
        pairs = pairs_of_part(grid.lists, tile, parts, work[1])
        stop = pairs[1]
        nothing = wp.vec4f()
        base = chunks.first[chunk]
        while base < chunks.first[chunk + 1]:
            at = base + lane
            base += width
            pixel = wp.int32(0)
            own = wp.int32(-1)
            h64 = wp.vec3d()
            deepest = wp.int32(-1)
            if at < chunks.first[chunk + 1]:
                pixel = chunks.pixels[at]
                h64 = rays.hit_points[pixel]
                own = hits.triangle[pixel]
                deepest = rays.last_slice[pixel]
                if parts.split > 0:
                    if shadowed[space.index, pixel] != wp.uint8(0):
                        deepest = -1
            h = to_float32(h64)
            h_error = hit_error(h)
            number = wp.int32(0)
            occluded = wp.bool(False)
            load = pairs[0]
            active = deepest >= 0
            going = active
            if wp.static(staged):
                going = any_of_block(active)
            while going and load < stop:
                held = stop - load
                if wp.static(staged):
                    held = wp.min(held, wp.static(slots))
                    if load + lane < stop:
                        i = grid.lists.values[load + lane]
                        shared(True, lane, tag_row(i, grid.lists.keys[load + lane] - tile * grid.slices))
                        for word in range(wp.static(used)):
                            shared(True, wp.static(slots) * (word + 1) + lane, entry(grid.records, 6 * i + word))
                    wait_for_block()
                if not active:
                    held = 0
                j = wp.int32(0)
                while j < held:
                    i = wp.int32(-1)
                    while j < held and i < 0:
                        here = wp.vec2i()
                        if wp.static(staged):
                            here = tag_of(shared(False, j, nothing))
                        else:
                            here = wp.vec2i(grid.lists.values[load + j], grid.lists.keys[load + j] - tile * grid.slices)
                        if here[1] > deepest:
                            active = wp.bool(False)
                            held = 0
                            break
                        if here[0] != own:
                            s = SegmentRecord()
                            if wp.static(staged):
                                s.q0 = shared(False, wp.static(slots) + j, nothing)
                                s.q1 = shared(False, wp.static(2 * slots) + j, nothing)
                                s.q2 = shared(False, wp.static(3 * slots) + j, nothing)
                                if wp.static(used > 3):
                                    s.q3 = shared(False, wp.static(4 * slots) + j, nothing)
                                if wp.static(used > 4):
                                    s.q4 = shared(False, wp.static(5 * slots) + j, nothing)
                                    s.q5 = shared(False, wp.static(6 * slots) + j, nothing)
                            else:
                                s = segment_at(grid.records, here[0])
                            number += 1
                            verdict = judge(h, light, h_error, s)
                            if wp.static(effects.alpha):
                                if verdict == YES and alpha.masked[here[0]] != wp.uint8(0):
                                    verdict = UNDECIDED
                            if verdict == YES:
                                occluded = wp.bool(True)
                                active = wp.bool(False)
                                held = 0
                            if verdict == UNDECIDED:
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
                if wp.static(staged):
                    load += wp.static(slots)
                    going = any_of_block(active)
                else:
                    load = stop
            if occluded:
                shadowed[space.index, pixel] = wp.uint8(1)
            if number > 0:
                count_tests(tests, pixel, number)

    return shadow_kernel
