"""Shadow rays of larger triangles: groups of rows of cells, cut to the triangle; and the pairs left to float64."""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Mesh, Ray, corners_of, weld_of
from ....harness.frame.specialise import effects
from ...common.alpha import opaque_to_light
from ...common.entries import entry, set_entry
from ...common.hitpoint import hit_point, plane_distance
from ...common.reserve import reserve
from ...common.segment import occludes
from ...common.triangle import largest
from ..aim import Cube
from ..cube import on_face
from ..fetch import direction_at
from ..queues import DOUBTS, ITEMS, LARGE, PARTS, Queue, queue_parts
from ..warps import LANES, append_pairs, filled_lane, lane_at, of_lane, sum_to_lane
from .bins import RayCells, cells_of, reach_with_rays, span_of
from .cells import Sides, cells_of_row, cube_space, on_cells, sides_of_flat, sides_of_planes
from .rays import (
    NO,
    Occluder,
    ShadowBits,
    bound_of,
    float32_verdict,
    set_bit_or_doubt,
    set_shadowed,
    stored_planes,
    test_ray,
)

REGISTERS = 56
"""Registers per thread that processes a queue, for nine blocks of 128 per multiprocessor."""

SPLITTERS = wp.constant(2)
"""Threads that share the rows of one large triangle."""


@wp.kernel(enable_backward=False, grid_stride=False)
def split_kernel(
    threads: wp.int32,
    light: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    cubes: wp.array(dtype=Cube),
    table: wp.array(dtype=wp.vec4f),
    mesh: Mesh,
    queue: Queue,
):
    """Queue the rows of large triangles in groups, with the lines that bound them.

    An item is (triangle, face and rows << 4 and first row << 16, first cell and last << 16, bits of the triangle's
    bound), and three lines.
    """
    k = wp.tid()
    stop = wp.min(queue.counts[LARGE], queue.large.shape[0])
    cube = cubes[light]
    cells = cells_of(table)
    position = lights[light]
    first = k % SPLITTERS
    k = k // SPLITTERS
    while k < stop:
        work = entry(queue.large, k)
        k += threads // SPLITTERS
        i = work[0]
        face = work[1]
        low = work[3] & 65535
        high = work[3] >> 16
        number = (high - low + LANES) // LANES - first
        if number > 0:
            number = (number + SPLITTERS - 1) // SPLITTERS
            corners = corners_of(mesh, i)
            qa = on_face(cube_space(corners.a, cube), face)
            qb = on_face(cube_space(corners.b, cube), face)
            qc = on_face(cube_space(corners.c, cube), face)
            flat = on_cells(qa, qb, qc, reach_with_rays(cube, corners, table), table[face])
            sides = Sides()
            if flat.known:
                sides = sides_of_flat(flat)
            else:
                sides = sides_of_planes(position, cube, face, corners, table[face], cells)
            bound = bound_of(table, corners)
            place = reserve(queue.counts, ITEMS, number)
            for g in range(number):
                if place + g < queue.items.shape[0]:
                    y = low + (first + g * SPLITTERS) * LANES
                    rows = wp.min(LANES, high - y + 1)
                    which = face | (rows << 4) | (y << 16)
                    set_entry(queue.items, place + g, wp.vec4i(i, which, work[2], wp.cast(bound, wp.int32)))
                    set_entry(queue.lines, place + g, 0, sides.line0)
                    set_entry(queue.lines, place + g, 1, sides.line1)
                    set_entry(queue.lines, place + g, 2, sides.line2)


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
def ray_of_lane(
    base: wp.int32,
    start: wp.int32,
    at: wp.int32,
    lane: wp.int32,
    end: wp.int32,
    rays: wp.array(dtype=wp.vec4f),
) -> wp.vec4f:
    """Element ``at`` + lane of the rows of a warp's lanes, if that is before ``end``. All lanes must call it.

    ``start``: where the elements of a lane's row start; ``base``: the place of the row among the rays, less ``start``.
    """
    ray = of_lane(base, lane_at(start, at)) + at + lane
    h = wp.vec4f()
    if at + lane < end:
        h = entry(rays, ray)
    return h


@functools.cache
def make_item_kernel(cuda: bool, again: bool) -> wp.Kernel:
    """Queued groups of rows, one warp for each on the GPU, one thread on the CPU; ``again``: their further parts."""
    counter = PARTS if again else ITEMS

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def item_kernel(
        threads: wp.int32,
        size: wp.int32,
        cells: RayCells,
        alpha: Alpha,
        bits: ShadowBits,
        queue: Queue,
    ):
        k = wp.tid()
        stop = queue.counts[wp.static(counter)]
        if wp.static(again):
            stop = wp.min(stop, queue.parts.shape[0])
        else:
            stop = wp.min(stop, queue.items.shape[0])
        along = cells_of(cells.table)
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
                further = entry(queue.parts, k)
                item = further[0]
                part = further[1]
            k += step
            work = entry(queue.items, item)
            i = work[0]
            sides = Sides()
            sides.line0 = entry(queue.lines, item, 0)
            sides.line1 = entry(queue.lines, item, 1)
            sides.line2 = entry(queue.lines, item, 2)
            rows = (work[1] >> 4) & 63
            occluder = Occluder()
            occluder.i = i
            occluder.bound = wp.cast(work[3], wp.float32)
            occluder.sure = occluder.bound
            if wp.static(effects.alpha):
                if alpha.masked[i] != wp.uint8(0):
                    occluder.sure = wp.INF
            number = wp.int32(0)
            if wp.static(cuda):
                span = wp.vec2i(0, 0)
                if lane < rows:
                    span = rays_of_row(work, lane, sides, along, cells.offset)
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
                    occluder = stored_planes(queue.records, occluder)
                    # Two rays at a time, and the next two are loaded before these are acted on, to hide the latency.
                    h = ray_of_lane(base, start, at, lane, end, cells.rays)
                    g = ray_of_lane(base, start, at + LANES, lane, end, cells.rays)
                    while at < end:
                        verdict = wp.int32(NO)
                        verdict_other = wp.int32(NO)
                        if at + lane < end:
                            verdict = float32_verdict(h, occluder)
                        if at + LANES + lane < end:
                            verdict_other = float32_verdict(g, occluder)
                        pixel = wp.cast(h[3], wp.int32)
                        pixel_other = wp.cast(g[3], wp.int32)
                        at += 2 * LANES
                        if at < end:
                            h = ray_of_lane(base, start, at, lane, end, cells.rays)
                            g = ray_of_lane(base, start, at + LANES, lane, end, cells.rays)
                        unsure = wp.bool(False)
                        unsure_other = wp.bool(False)
                        if verdict != NO:
                            unsure = set_bit_or_doubt(bits, verdict, i, pixel)
                        if verdict_other != NO:
                            unsure_other = set_bit_or_doubt(bits, verdict_other, i, pixel_other)
                        held = append_pairs(unsure, i, pixel, held, False, queue.counts, DOUBTS, queue.doubts)
                        held = append_pairs(
                            unsure_other, i, pixel_other, held, False, queue.counts, DOUBTS, queue.doubts
                        )
            else:
                occluder = stored_planes(queue.records, occluder)
                for r in range(rows):
                    span = rays_of_row(work, r, sides, along, cells.offset)
                    for ray in range(span[0], span[1]):
                        # A part has its share of the group's rays in order, as on the GPU.
                        if number // size == part:
                            test_ray(bits, queue, entry(cells.rays, ray), occluder)
                        number += 1
            if wp.static(not again):
                queue_parts(queue, item, number, size, lane)
        if wp.static(cuda):
            append_pairs(False, 0, 0, held, True, queue.counts, DOUBTS, queue.doubts)

    return item_kernel


@functools.cache
def make_doubt_kernel(stored: bool) -> wp.Kernel:
    """(triangle, pixel) pairs that float32 could not decide. ``stored``: hit_points vec3d [pixels] are exact; else they are
    computed again, since few are needed."""

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=64)
    def doubt_kernel(
        threads: wp.int32,
        lights: wp.array(dtype=wp.vec3f),
        camera: Camera,
        mesh: Mesh,
        alpha: Alpha,
        hit_points: wp.array(dtype=wp.vec3d),
        bits: ShadowBits,
        queue: Queue,
    ):
        k = wp.tid()
        stop = wp.min(queue.counts[DOUBTS], queue.doubts.shape[0])
        origin_size = wp.float64(largest(camera.eye[0]))
        light = lights[bits.light]
        while k < stop:
            pair = queue.doubts[k]
            k += threads
            i = pair[0]
            if bits.visibility[bits.light, pair[1]] == wp.uint8(0):
                h = wp.vec3d()
                if wp.static(stored):
                    h = hit_points[pair[1]]
                else:
                    y = wp.int32(wp.uint32(pair[1]) // wp.uint32(camera.width))
                    ray = Ray(entry(camera.eye, 0), direction_at(camera, pair[1] - y * camera.width, y))
                    own = corners_of(mesh, entry(bits.triangle, pair[1]))
                    h = hit_point(ray, plane_distance(ray, own), own)
                corners = corners_of(mesh, i)
                weld = weld_of(mesh, i)
                shadowed = occludes(h, light, corners, weld, origin_size)
                if wp.static(effects.alpha):
                    if shadowed:
                        shadowed = opaque_to_light(alpha, i, h, light, corners, weld, origin_size)
                if shadowed:
                    set_shadowed(bits, pair[1], i)

    return doubt_kernel
