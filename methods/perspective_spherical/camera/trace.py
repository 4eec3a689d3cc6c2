"""Tracing primary rays through the perspective grid (paper, section 3): closest hit, front to back, by tile.

A tile's list is one run of sorted pairs, front slices first. A ray is done once its hit lies before the slice of
the next pair. Thread blocks are tracing tiles of k x k sorting tiles (indirect mapping): threads of one sorting
tile follow one another, so that lanes of a warp share a list.

A ray first advances to the next triangle that float32 cannot rule out, then decides it in float64. The decision is rare
and slow, so the lanes of a warp make theirs together instead of each one making the others wait.

With split lists (:mod:`.lists.items`) a block takes one part of one sorting tile's list; parts meet in ``nearest``.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray, corners_of, ray_of, ray_through, weld_of
from ...exact.holes import opaque_at_hit
from ...exact.triangle import NO_HIT, depth_key, nearer, spare_bits, total, write_hit
from ...gpu.entries import entry
from ..lists.binning import TileLists
from ..lists.items import ListParts, pairs_of_part, part_of
from ..variants import Variant
from .ray_tests import RAY_DECIDES, RAY_PASSES, RayRecord, count_tests
from .tiles import ImageTiles, slice_scale

INDEX_BITS = wp.constant(wp.uint64(24))
"""Bits of a packed hit that may hold the triangle; the upper 40, and those that it does not need, hold the depth key."""

NO_NEAREST = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))


@wp.func
def indirect_pixel(
    camera: Camera, grid: ImageTiles, k: wp.int32, block: wp.int32, place: wp.int32
) -> wp.vec3i:
    """(x, y, sorting tile) of a place in a tracing tile of k x k: sorting tiles row by row, in them pixels. -1 outside."""
    blocks_across = (grid.across + k - 1) // k
    area = grid.tile * grid.tile
    sub = place // area
    inside = place % area
    column = (block % blocks_across) * k + sub % k
    row = (block // blocks_across) * k + sub // k
    x = column * grid.tile + inside % grid.tile
    y = row * grid.tile + inside // grid.tile
    if sub >= k * k or x >= camera.width or y >= camera.height:
        return wp.vec3i(-1, -1, -1)
    return wp.vec3i(x, y, row * grid.across + column)


@wp.func
def slice_start(grid: ImageTiles, per_slice: wp.float32, slice: wp.int32) -> wp.float32:
    """A depth that no triangle first listed in ``slice`` comes before, less what rounding may move it."""
    if slice == 0 or per_slice == 0.0:
        return wp.float32(-1.0)
    return (grid.depth_range[0] + wp.float32(slice) / per_slice) * 0.9999 - 1.0e-5 * grid.depth_range[0]


@wp.func
def packed_hit(t: wp.float64, i: wp.int32, spare: wp.int32) -> wp.uint64:
    """(depth key, triangle) in the order of ``nearer``. ``spare`` as for keys: bits that the triangle does not need."""
    return (depth_key(t, spare) << wp.uint64(24 - spare)) | wp.uint64(i)


@wp.func
def packed_triangle(nearest: wp.uint64, spare: wp.int32) -> wp.int32:
    """The triangle of a packed hit."""
    return wp.int32(nearest & wp.uint64(0xFFFFFF >> spare))


@wp.func
def packed_depth(nearest: wp.uint64) -> wp.float32:
    """A depth at or beyond that of a packed hit; infinite where there is none."""
    if nearest == NO_NEAREST:
        return wp.INF
    # The key is the complement of the leading bits of 1 / t: without those that follow the first 40, 1 / t is too small.
    inverse = (wp.uint64(0xFFFFFFFFFF) - (nearest >> INDEX_BITS)) << wp.uint64(23)
    return wp.float32(wp.float64(1.0) / wp.cast(inverse, wp.float64))


@wp.func
def record_at(records: wp.array(dtype=wp.vec4f), i: wp.int32) -> RayRecord:
    r = RayRecord()
    r.q0 = entry(records, 3 * i)
    r.q1 = entry(records, 3 * i + 1)
    r.q2 = entry(records, 3 * i + 2)
    return r


@wp.func
def write_nearest(
    pixel: wp.int32,
    ray: Ray,
    best: wp.int32,
    t: wp.float64,
    mesh: Mesh,
    parts: ListParts,
    nearest: wp.array(dtype=wp.uint64),
    hits: Hits,
    hit_points: wp.array(dtype=wp.vec3d),
):
    """Write a pixel's closest hit; of a split list, the nearest of this part and those before it to ``nearest``."""
    if parts.split > 0:
        if best >= 0:
            spare = spare_bits(mesh.triangles.shape[0])
            wp.atomic_min(nearest, pixel, packed_hit(t, best, spare))
    else:
        write_hit(hits, hit_points, pixel, ray, best, t, mesh)


@functools.cache
def make_trace_kernel(variant: Variant) -> wp.Kernel:
    """One thread per pixel, each reading triangles for itself. Runs on any device; the equivalent of the staged
    kernel."""
    passes = RAY_PASSES[variant.test]
    decide = RAY_DECIDES[variant.test]

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def trace_kernel(
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
        area = k * k * grid.tile * grid.tile
        work = part_of(parts, thread // area)
        if work[0] < 0:
            return
        place = indirect_pixel(camera, grid, k, work[0], thread % area)
        if place[0] < 0:
            return
        pixel = place[1] * camera.width + place[0]
        ray = ray_through(camera, place[0], place[1])
        size = total(ray.direction)
        per_slice = slice_scale(grid)
        best = wp.int32(-1)
        best_t = wp.float64(wp.INF)
        depth = wp.float32(wp.INF)
        if parts.split > 0:
            depth = packed_depth(nearest[pixel])
        number = wp.int32(0)
        slice = wp.int32(-1)
        pairs = pairs_of_part(lists, place[2], parts, work[1])
        j = pairs[0]
        stop = pairs[1]
        while j < stop:
            i = wp.int32(-1)
            while j < stop and i < 0:
                if depth < wp.INF:
                    here = lists.keys[j] - place[2] * grid.slices
                    if here != slice:
                        slice = here
                        if depth < slice_start(grid, per_slice, slice):
                            stop = j
                            break
                number += 1
                if passes(ray.direction, size, record_at(records, lists.values[j])):
                    i = lists.values[j]
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
        write_nearest(pixel, ray, best, best_t, mesh, parts, nearest, hits, hit_points)
        count_tests(tests, pixel, number)

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
            best = packed_triangle(nearest[pixel], spare_bits(mesh.triangles.shape[0]))
            t = decide(ray, corners_of(mesh, best), weld_of(mesh, best))
        write_hit(hits, hit_points, pixel, ray, best, t, mesh)

    return resolve_kernel
