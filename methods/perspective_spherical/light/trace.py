"""Tracing shadow rays through a light grid (paper, section 4.4): any hit, one thread block per chunk.

The bit is set in primary-ray order, so that blocks need no synchronisation. With split lists (:mod:`.lists.items`) a
block takes one part of a chunk's list, and skips rays whose bit another part has set.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, corners_of, weld_of
from ...exact.holes import opaque_to_light
from ...exact.triangle import U32, largest, to_float32
from ...gpu.entries import entry
from ..camera.ray_tests import count_tests
from ..lists.binning import TileLists
from ..lists.chunks import RayChunks
from ..lists.items import ListParts, pairs_of_part, part_of
from ..variants import Variant
from .segment_tests import DOUBT, SEGMENT_DECIDES, SEGMENT_PASSES, YES, SegmentRecord
from .space import LightSpace


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


@functools.cache
def make_shadow_kernel(variant: Variant) -> wp.Kernel:
    """``lanes`` threads per chunk, each ray by ray: on CUDA a block, on a CPU one thread for the whole chunk."""
    judge = SEGMENT_PASSES[variant.test]
    decide = SEGMENT_DECIDES[variant.test]

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def shadow_kernel(
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
        k = wp.tid()
        work = part_of(parts, k // lanes)
        chunk = work[0]
        if chunk < 0 or chunk >= chunks.total[0]:
            return
        light = space.lights[space.index]
        origin_size = wp.float64(largest(camera.eye[0]))
        tile = chunks.tiles[chunks.first[chunk]]
        pairs = pairs_of_part(lists, tile, parts, work[1])
        at = chunks.first[chunk] + k % lanes
        while at < chunks.first[chunk + 1]:
            pixel = chunks.pixels[at]
            at += lanes
            h64 = hit_points[pixel]
            h = to_float32(h64)
            h_error = hit_error(h)
            own = hits.triangle[pixel]
            behind = tile * slices + last_slice[pixel] + 1
            number = wp.int32(0)
            occluded = wp.bool(False)
            j = pairs[0]
            stop = pairs[1]
            if parts.split > 0:
                if shadowed[space.index, pixel] != wp.uint8(0):
                    stop = j
            while j < stop:
                i = wp.int32(-1)
                while j < stop and i < 0:
                    if lists.keys[j] >= behind:
                        stop = j
                        break
                    if lists.values[j] != own:
                        number += 1
                        verdict = judge(h, light, h_error, segment_at(records, lists.values[j]))
                        if wp.static(effects.alpha):
                            if verdict == YES and alpha.masked[lists.values[j]] != wp.uint8(0):
                                verdict = DOUBT
                        if verdict == YES:
                            occluded = wp.bool(True)
                            stop = j
                        if verdict == DOUBT:
                            i = lists.values[j]
                    j += 1
                if i >= 0:
                    corners = corners_of(mesh, i)
                    weld = weld_of(mesh, i)
                    occluded = decide(h64, light, corners, weld, origin_size)
                    if wp.static(effects.alpha):
                        if occluded:
                            occluded = opaque_to_light(alpha, i, h64, light, corners, weld, origin_size)
                    if occluded:
                        stop = j
            if occluded:
                shadowed[space.index, pixel] = wp.uint8(1)
            count_tests(tests, pixel, number)

    return shadow_kernel
