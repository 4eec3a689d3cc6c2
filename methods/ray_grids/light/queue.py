"""Shadow rays of larger triangles: groups of rows of cells, cut to the triangle; and the pairs left to float64."""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Mesh, corners_of, weld_of
from ....harness.frame.specialise import effects
from ...common.alpha import opaque_to_light
from ...common.entries import entry, set_entry
from ...common.reserve import reserve
from ...common.segment import occludes
from ...common.triangle import largest, total
from ..aim import Cube
from ..cube import on_face
from ..queues import DOUBTS, ITEMS, LARGE, PARTS, queue_parts
from ..warps import LANES, filled_lane, gather, lane_at, of_lane, sum_to_lane
from .bins import cells_of, span_of
from .cells import Sides, cells_of_row, cube_space, on_cells, sides_of_flat, sides_of_planes
from .rays import NO, bound_of, left_open, occluder_at, shade, verdict

REGISTERS = 56
"""Registers a thread that empties a queue: nine blocks of 128 a multiprocessor."""

SPLITTERS = wp.constant(2)
"""Threads that share the rows of one large triangle."""


@wp.kernel(enable_backward=False, grid_stride=False)
def split_kernel(
    threads: wp.int32,
    index: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    cubes: wp.array(dtype=Cube),
    table: wp.array(dtype=wp.vec4f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    large: wp.array(dtype=wp.vec4i),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
    lines: wp.array2d(dtype=wp.vec4f),
):
    """Queue the rows of large triangles in groups, with the lines that bound them.

    An item is (triangle, face and rows << 4 and first row << 16, first cell and last << 16, bits of the triangle's
    bound), and three lines.
    """
    k = wp.tid()
    stop = wp.min(counts[LARGE], large.shape[0])
    cube = cubes[index]
    cells = cells_of(table)
    light = lights[index]
    first = k % SPLITTERS
    k = k // SPLITTERS
    while k < stop:
        work = entry(large, k)
        k += threads // SPLITTERS
        i = work[0]
        face = work[1]
        low = work[3] & 65535
        high = work[3] >> 16
        number = (high - low + LANES) // LANES - first
        if number > 0:
            number = (number + SPLITTERS - 1) // SPLITTERS
            corners = triangles[i]
            a = points[corners[0]]
            b = points[corners[1]]
            c = points[corners[2]]
            reach = wp.max(total(a - cube.middle), wp.max(total(b - cube.middle), total(c - cube.middle)))
            qa = on_face(cube_space(a, cube), face)
            qb = on_face(cube_space(b, cube), face)
            flat = on_cells(qa, qb, on_face(cube_space(c, cube), face), reach, table[face])
            sides = Sides()
            if flat.known:
                sides = sides_of_flat(flat)
            else:
                sides = sides_of_planes(light, cube, face, a, b, c, table[face], cells)
            bound = bound_of(table, a, b, c)
            place = reserve(counts, ITEMS, number)
            for g in range(number):
                if place + g < items.shape[0]:
                    y = low + (first + g * SPLITTERS) * LANES
                    rows = wp.min(LANES, high - y + 1)
                    which = face | (rows << 4) | (y << 16)
                    set_entry(items, place + g, wp.vec4i(i, which, work[2], wp.cast(bound, wp.int32)))
                    set_entry(lines, place + g, 0, sides.line0)
                    set_entry(lines, place + g, 1, sides.line1)
                    set_entry(lines, place + g, 2, sides.line2)


@wp.func
def rays_of_row(
    work: wp.vec4i, r: wp.int32, sides: Sides, cells: wp.int32, offset: wp.array(dtype=wp.int32)
) -> wp.vec2i:
    """First ray and end in row r of an item, cut to the triangle."""
    y = (work[1] >> 16) + r
    ends = cells_of_row(sides, y, work[2] & 65535, work[2] >> 16)
    if ends[1] < ends[0]:
        return wp.vec2i(0, 0)
    return span_of(offset, work[1] & 15, ends[0], ends[1], y, cells)


@wp.func
def ray_of(
    base: wp.int32,
    start: wp.int32,
    at: wp.int32,
    lane: wp.int32,
    end: wp.int32,
    rays: wp.array(dtype=wp.vec4f),
) -> wp.vec4f:
    """Element ``at`` + lane of the rows of a warp's lanes, if that is before ``end``. All lanes must call it.

    ``base``, ``start``: where a lane's row lies among the rays less where its elements start, and where they start.
    """
    ray = of_lane(base, lane_at(start, at)) + at + lane
    h = wp.vec4f()
    if at + lane < end:
        h = entry(rays, ray)
    return h


@functools.cache
def make_item_kernel(cuda: bool, again: bool) -> wp.Kernel:
    """Queued groups of rows, a warp each on the GPU, a thread each on the CPU; ``again``: their further parts."""
    counter = PARTS if again else ITEMS

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def item_kernel(
        threads: wp.int32,
        size: wp.int32,
        index: wp.int32,
        table: wp.array(dtype=wp.vec4f),
        records: wp.array2d(dtype=wp.vec4f),
        offset: wp.array(dtype=wp.int32),
        rays: wp.array(dtype=wp.vec4f),
        triangle: wp.array(dtype=wp.int32),
        items: wp.array(dtype=wp.vec4i),
        lines: wp.array2d(dtype=wp.vec4f),
        alpha: Alpha,
        visibility: wp.array2d(dtype=wp.uint8),
        counts: wp.array(dtype=wp.int32),
        parts: wp.array(dtype=wp.vec2i),
        doubts: wp.array(dtype=wp.vec2i),
    ):
        k = wp.tid()
        stop = counts[wp.static(counter)]
        if wp.static(again):
            stop = wp.min(stop, parts.shape[0])
        else:
            stop = wp.min(stop, items.shape[0])
        cells = cells_of(table)
        step = threads
        lane = wp.int32(0)
        if wp.static(cuda):
            lane = k % LANES
            k = k // LANES
            step = threads // LANES
        held = wp.int32(0)
        while k < stop:
            item = k
            part = wp.int32(0)
            if wp.static(again):
                further = entry(parts, k)
                item = further[0]
                part = further[1]
            k += step
            work = entry(items, item)
            i = work[0]
            sides = Sides()
            sides.line0 = entry(lines, item, 0)
            sides.line1 = entry(lines, item, 1)
            sides.line2 = entry(lines, item, 2)
            rows = (work[1] >> 4) & 63
            bound = wp.cast(work[3], wp.float32)
            sure = bound
            if wp.static(effects.alpha):
                if alpha.masked[i] != wp.uint8(0):
                    sure = wp.INF
            number = wp.int32(0)
            if wp.static(cuda):
                span = wp.vec2i(0, 0)
                if lane < rows:
                    span = rays_of_row(work, lane, sides, cells, offset)
                # From here on a lane has a row that holds rays, as long as there are any.
                length = span[1] - span[0]
                own = filled_lane(length)
                length = wp.where(own < LANES, of_lane(length, own), 0)
                sums = sum_to_lane(length)
                number = of_lane(sums, LANES - 1)
                start = sums - length
                base = of_lane(span[0], own) - start
                at = part * size
                end = wp.min(number, at + size)
                if at < end:
                    occluder = occluder_at(records, i)
                    # Two rays at a time, and the next two asked for before these are settled: memory is far.
                    h = ray_of(base, start, at, lane, end, rays)
                    g = ray_of(base, start, at + LANES, lane, end, rays)
                    while at < end:
                        said = wp.int32(NO)
                        said_other = wp.int32(NO)
                        if at + lane < end:
                            said = verdict(h, occluder, bound, sure)
                        if at + LANES + lane < end:
                            said_other = verdict(g, occluder, bound, sure)
                        pixel = wp.cast(h[3], wp.int32)
                        pixel_other = wp.cast(g[3], wp.int32)
                        at += 2 * LANES
                        if at < end:
                            h = ray_of(base, start, at, lane, end, rays)
                            g = ray_of(base, start, at + LANES, lane, end, rays)
                        unsure = wp.bool(False)
                        unsure_other = wp.bool(False)
                        if said != NO:
                            unsure = left_open(said, i, pixel, index, triangle, visibility)
                        if said_other != NO:
                            unsure_other = left_open(said_other, i, pixel_other, index, triangle, visibility)
                        held = gather(unsure, i, pixel, held, False, counts, DOUBTS, doubts)
                        held = gather(unsure_other, i, pixel_other, held, False, counts, DOUBTS, doubts)
            else:
                occluder = occluder_at(records, i)
                for r in range(rows):
                    span = rays_of_row(work, r, sides, cells, offset)
                    for ray in range(span[0], span[1]):
                        # A part has its share of the group's rays in order, as on the GPU.
                        if number // size == part:
                            shade(
                                i,
                                entry(rays, ray),
                                index,
                                occluder,
                                bound,
                                sure,
                                triangle,
                                visibility,
                                counts,
                                doubts,
                            )
                        number += 1
            if wp.static(not again):
                queue_parts(item, number, size, lane, counts, parts)
        if wp.static(cuda):
            gather(False, 0, 0, held, True, counts, DOUBTS, doubts)

    return item_kernel


@wp.kernel(enable_backward=False, grid_stride=False)
def doubt_kernel(
    threads: wp.int32,
    index: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    camera: Camera,
    mesh: Mesh,
    hit: wp.array(dtype=wp.vec3d),
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
    alpha: Alpha,
    visibility: wp.array2d(dtype=wp.uint8),
):
    """Pairs that float32 could not decide."""
    k = wp.tid()
    stop = wp.min(counts[DOUBTS], doubts.shape[0])
    origin_size = wp.float64(largest(camera.eye[0]))
    while k < stop:
        pair = doubts[k]
        k += threads
        if visibility[index, pair[1]] == wp.uint8(0):
            corners = corners_of(mesh, pair[0])
            weld = weld_of(mesh, pair[0])
            shadowed = occludes(hit[pair[1]], lights[index], corners, weld, origin_size)
            if wp.static(effects.alpha):
                if shadowed:
                    shadowed = opaque_to_light(
                        alpha, pair[0], hit[pair[1]], lights[index], corners, weld, origin_size
                    )
            if shadowed:
                visibility[index, pair[1]] = wp.uint8(1)
