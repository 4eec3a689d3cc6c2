"""Tracing primary rays through the perspective grid (paper, section 3): closest hit, front to back, by tile.

A tile's list is one run of sorted pairs, front slices first. A ray is done once its hit lies before the slice of
the next pair. Thread blocks are tracing tiles of k x k sorting tiles (indirect mapping): threads of one sorting
tile follow one another, so that lanes of a warp share a list.

A ray first goes on to the next triangle that float32 cannot rule out, then decides: the lanes of a warp decide
together, which is rare and long, instead of each holding up all others in turn.

With split lists (:mod:`.lists.items`) a block takes one part of one sorting tile's list; parts meet in ``nearest``.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray, corners_of, ray_of, weld_of
from ....harness.frame.specialise import effects
from ...common.alpha import opaque_at_hit
from ...common.triangle import NO_HIT, depth_key, nearer, write_hit
from ..variants import Variant
from .ray_tests import RAY_DECIDES, RAY_PASSES, RayRecord
from .tiles import slice_scale

INDEX_BITS = wp.constant(wp.uint64(24))
"""Bits of a packed hit that hold the triangle; the upper 40 hold the depth key."""

NO_NEAREST = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))


@wp.func
def indirect_pixel(
    block: wp.int32, rest: wp.int32, width: wp.int32, height: wp.int32, tile: wp.int32, k: wp.int32
) -> wp.vec3i:
    """(x, y, sorting tile) of a place in a tracing tile: sorting tiles row by row, in them pixels. -1 outside."""
    across = (width + tile - 1) // tile
    blocks_across = (across + k - 1) // k
    area = tile * tile
    sub = rest // area
    inside = rest % area
    column = (block % blocks_across) * k + sub % k
    row = (block // blocks_across) * k + sub // k
    x = column * tile + inside % tile
    y = row * tile + inside // tile
    if sub >= k * k or x >= width or y >= height:
        return wp.vec3i(-1, -1, -1)
    return wp.vec3i(x, y, row * across + column)


@wp.func
def slice_start(
    depth_range: wp.array(dtype=wp.float32), per_slice: wp.float32, slice: wp.int32
) -> wp.float32:
    """A depth that no triangle first listed in ``slice`` comes before, less what rounding may move it."""
    if slice == 0 or per_slice == 0.0:
        return wp.float32(-1.0)
    return (depth_range[0] + wp.float32(slice) / per_slice) * 0.9999 - 1.0e-5 * depth_range[0]


@wp.func
def packed_hit(t: wp.float64, i: wp.int32) -> wp.uint64:
    """(depth key, triangle) in the order of ``nearer``."""
    return (depth_key(t) << INDEX_BITS) | wp.uint64(i)


@wp.func
def packed_depth(nearest: wp.uint64) -> wp.float32:
    """A depth at or beyond that of a packed hit; infinite where there is none."""
    if nearest == NO_NEAREST:
        return wp.INF
    # The key is the complement of the leading bits of 1 / t: without those that follow, 1 / t is too small.
    inverse = (wp.uint64(0xFFFFFFFFFF) - (nearest >> INDEX_BITS)) << wp.uint64(23)
    return wp.float32(wp.float64(1.0) / wp.cast(inverse, wp.float64))


@wp.func
def record_at(records: wp.array(dtype=wp.vec4f), i: wp.int32) -> RayRecord:
    r = RayRecord()
    r.q0 = records[3 * i]
    r.q1 = records[3 * i + 1]
    r.q2 = records[3 * i + 2]
    return r


@functools.cache
def make_trace_kernel(variant: Variant) -> wp.Kernel:
    """One thread a pixel, each reading triangles for itself: direct on any device, the twin of the staged kernel."""
    passes = RAY_PASSES[variant.test]
    decide = RAY_DECIDES[variant.test]

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def trace_kernel(
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
        area = k * k * tile * tile
        block = thread // area
        part = wp.int32(0)
        if split > 0:
            if wp.int64(block) >= item_scan[item_scan.shape[0] - 1]:
                return
            part = items[block][1]
            block = items[block][0]
        place = indirect_pixel(block, thread % area, camera.width, camera.height, tile, k)
        if place[0] < 0:
            return
        pixel = place[1] * camera.width + place[0]
        ray = Ray(camera.eye[0], camera.column[place[0]] + camera.row[place[1]])
        d = ray.direction
        size = wp.abs(d[0]) + wp.abs(d[1]) + wp.abs(d[2])
        per_slice = slice_scale(depth_range, slices)
        best = wp.int32(-1)
        best_t = wp.float64(wp.INF)
        depth = wp.float32(wp.INF)
        number = wp.int32(0)
        slice = wp.int32(-1)
        j = begin[place[2]]
        stop = end[place[2]]
        if split > 0:
            depth = packed_depth(nearest[pixel])
            j += part * split
            stop = wp.min(stop, j + split)
        while j < stop:
            i = wp.int32(-1)
            while j < stop and i < 0:
                if depth < wp.INF:
                    here = keys[j] - place[2] * slices
                    if here != slice:
                        slice = here
                        if depth < slice_start(depth_range, per_slice, slice):
                            stop = j
                            break
                number += 1
                if passes(d, size, record_at(records, values[j])):
                    i = values[j]
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
        if split > 0:
            if best >= 0:
                wp.atomic_min(nearest, pixel, packed_hit(best_t, best))
            if tests.shape[0] > 1:
                wp.atomic_add(tests, pixel, number)
        else:
            write_hit(hits, hit_points, pixel, ray, best, best_t, mesh)
            if tests.shape[0] > 1:
                tests[pixel] = number

    return trace_kernel


@functools.cache
def make_resolve_kernel(variant: Variant) -> wp.Kernel:
    """Write the answers that the parts of split lists agreed on."""
    decide = RAY_DECIDES[variant.test]

    @wp.kernel(enable_backward=False, module="unique")
    def resolve_kernel(
        camera: Camera,
        mesh: Mesh,
        nearest: wp.array(dtype=wp.uint64),
        hits: Hits,
        hit_points: wp.array(dtype=wp.vec3d),
    ):
        pixel = wp.tid()
        ray = ray_of(camera, pixel)
        best = wp.int32(-1)
        t = wp.float64(wp.INF)
        if nearest[pixel] != NO_NEAREST:
            best = wp.int32(nearest[pixel] & ((wp.uint64(1) << INDEX_BITS) - wp.uint64(1)))
            t = decide(ray, corners_of(mesh, best), weld_of(mesh, best))
        write_hit(hits, hit_points, pixel, ray, best, t, mesh)

    return resolve_kernel
