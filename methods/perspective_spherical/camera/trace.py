"""Tracing primary rays through the perspective grid (paper, section 3): closest hit, front to back, by tile.

A tile's list is one run of sorted pairs, front slices first. A ray is done once its hit lies before the slice of
the next pair. Thread blocks are tracing tiles of k x k sorting tiles (indirect mapping): threads of one sorting
tile follow one another, so that lanes of a warp share a list.

The threads of a block bring triangles to shared memory: they alternate between loading records, one each, and testing
what is there, with a synchronisation between the two. Shared memory is partitioned equally among the sorting tiles of a
tracing tile; a round ends the block's work when no ray of it needs another. A record's free fourth components carry its
triangle and its depth.

A ray first advances to the next triangle that float32 cannot rule out, then decides it in float64. The decision is rare
and slow, so the lanes of a warp make theirs together instead of each one making the others wait.

With split lists (:mod:`.variants.split_lists`) a block takes one part of one sorting tile's list; parts meet in ``nearest``.
"""

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray, corners_of, direction_through, ray_of, weld_of
from ...exact.holes import opaque_at_hit
from ...exact.triangle import NO_HIT, depth_key, nearer, spare_bits, total, write_hit
from ...gpu.entries import entry
from ..lists.staging import any_of_block, make_shared, wait_for_block
from ..variants.split_lists import ListParts, pairs_of_part, part_of
from .ray_tests import RAY_DECIDES, RAY_PASSES, RECORD, RayRecord, count_tests
from .tiles import ImageTiles, slice_scale

INDEX_BITS = wp.constant(wp.uint64(24))
"""Bits of a packed hit that may hold the triangle; the upper 40, and those that it does not need, hold the depth key."""

TRACE_REGISTERS = 80
"""Limit of registers: more warps hide latency. On an H200 frames take 0 to 3 % longer with 64, where more is spilled, and 0
to 2 % longer with 96.
"""

NO_NEAREST = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))


@wp.func
def indirect_pixel(camera: Camera, grid: ImageTiles, k: wp.int32, block: wp.int32, place: wp.int32) -> wp.vec3i:
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


@wp.struct
class Traced:
    """What a trace writes, arrays [pixels].

    nearest     uint64: of split lists, the packed hit that their parts agree on
    hit_points  vec3d: in float64, the origins of the shadow rays
    tests       int32: raised by the triangle tests of each pixel; [1] where they are not counted
    """

    nearest: wp.array(dtype=wp.uint64)
    hits: Hits
    hit_points: wp.array(dtype=wp.vec3d)
    tests: wp.array(dtype=wp.int32)


@wp.func
def tagged(q: wp.vec4f, tag: wp.float32) -> wp.vec4f:
    return wp.vec4f(q[0], q[1], q[2], tag)


@functools.cache
def make_trace_kernel(test: int, block: int) -> wp.Kernel:
    """``block`` threads take one tracing tile, or an equal part of it; of split lists, one part of one tile's.

    With 0 each thread is alone and reads triangles for itself: the same bits, on any device.
    """
    passes, decide = RAY_PASSES[test], RAY_DECIDES[test]
    staged, slots = block > 0, max(1, block)
    shared = make_shared(RECORD * slots)
    limit = {"cuda_max_registers": TRACE_REGISTERS} if staged else {}

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, **limit)
    def trace_kernel(
        k: wp.int32, camera: Camera, mesh: Mesh, alpha: Alpha, grid: ImageTiles, parts: ListParts, out: Traced
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
        if wp.static(staged):
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
                pairs = pairs_of_part(grid.lists, mine[2], parts, work[1])
                load = pairs[0] + lane % room
                load_stop = pairs[1]
        direction = wp.vec3f(0.0, 0.0, 0.0)
        pixel = wp.int32(0)
        left = wp.int32(0)
        own = wp.int32(0)
        depth = wp.float32(wp.INF)
        if place[0] >= 0:
            pixel = place[1] * camera.width + place[0]
            direction = direction_through(camera, place[0], place[1])
            pairs = pairs_of_part(grid.lists, place[2], parts, work[1])
            own = pairs[0]
            left = pairs[1] - pairs[0]
            if parts.split > 0:
                depth = packed_depth(out.nearest[pixel])
        ray = Ray(camera.eye[0], direction)
        size = total(ray.direction)
        per_slice = slice_scale(grid)
        best = wp.int32(-1)
        best_t = wp.float64(wp.INF)
        number = wp.int32(0)
        nothing = wp.vec4f()
        going = left > 0
        if wp.static(staged):
            own = ((first + lane) // tile_area - first_sub) * room
            going = any_of_block(going)
        while going:
            if wp.static(staged):
                if load < load_stop and lane // room * room + room <= wp.static(slots):
                    i = grid.lists.values[load]
                    r = record_at(grid.records, i)
                    start = slice_start(grid, per_slice, grid.lists.keys[load] - mine[2] * grid.slices)
                    shared(True, lane, r.q0)
                    shared(True, wp.static(slots) + lane, tagged(r.q1, start))
                    shared(True, wp.static(2 * slots) + lane, tagged(r.q2, wp.cast(i, wp.float32)))
                load += room
                wait_for_block()
            j = wp.int32(0)
            held = wp.int32(left)
            if wp.static(staged):
                held = wp.min(left, room)
            while j < held:
                i = wp.int32(-1)
                while j < held and i < 0:
                    s = RayRecord()
                    if wp.static(staged):
                        s.q1 = shared(False, wp.static(slots) + own + j, nothing)
                        start = s.q1[3]
                    else:
                        start = wp.float32(0.0)
                        if depth < wp.INF:
                            start = slice_start(grid, per_slice, grid.lists.keys[own + j] - place[2] * grid.slices)
                    if depth < start:
                        left = 0
                        held = 0
                        break
                    if wp.static(staged):
                        s.q0 = shared(False, own + j, nothing)
                        s.q2 = shared(False, wp.static(2 * slots) + own + j, nothing)
                    else:
                        s = record_at(grid.records, grid.lists.values[own + j])
                    number += 1
                    if passes(ray.direction, size, s):
                        if wp.static(staged):
                            i = wp.cast(s.q2[3], wp.int32)
                        else:
                            i = grid.lists.values[own + j]
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
            if wp.static(staged):
                left = wp.max(0, left - room)
                going = any_of_block(left > 0)
            else:
                going = wp.bool(False)
        if place[0] >= 0:
            if parts.split == 0:
                write_hit(out.hits, out.hit_points, pixel, ray, best, best_t, mesh)
            elif best >= 0:
                wp.atomic_min(out.nearest, pixel, packed_hit(best_t, best, spare_bits(mesh.triangles.shape[0])))
            count_tests(out.tests, pixel, number)

    return trace_kernel


@functools.cache
def make_resolve_kernel(test: int) -> wp.Kernel:
    """Write the answers that the parts of split lists agreed on."""
    decide = RAY_DECIDES[test]

    @wp.kernel(enable_backward=False, module="unique")
    def resolve_kernel(camera: Camera, mesh: Mesh, out: Traced):
        pixel = wp.tid()
        ray = ray_of(camera, pixel)
        nearest = out.nearest[pixel]
        best = wp.int32(-1)
        t = wp.float64(wp.INF)
        if nearest != NO_NEAREST:
            best = packed_triangle(nearest, spare_bits(mesh.triangles.shape[0]))
            t = decide(ray, corners_of(mesh, best), weld_of(mesh, best))
        write_hit(out.hits, out.hit_points, pixel, ray, best, t, mesh)

    return resolve_kernel
