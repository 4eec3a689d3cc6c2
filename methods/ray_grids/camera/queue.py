"""Primary rays of larger triangles: groups of rows (of tall ones: columns), cut to the triangle, pixel by pixel."""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera
from ....harness.frame.specialise import effects
from ...common.entries import entry, entry_now, entry_of_four
from ...common.triangle import spare_bits
from ..fetch import direction_at
from ..queues import DOUBTS, ITEMS, PARTS, Queue, queue_parts
from ..warps import LANES, append_pairs, filled_lane, lane_at, lane_of, of_lane, sum_to_lane, warp_of
from .pixels import Candidate, sign_bound, test_pixel, test_pixel_or_queue
from .stream import Lines, pixels_of_row

REGISTERS = 56
"""Registers per thread, for nine blocks of 128 per multiprocessor."""


@wp.func
def line_direction(tall: wp.bool, line: wp.int32, camera: Camera) -> wp.vec3f:
    """The part of their directions that all pixels of a row, or of a column, have in common."""
    if tall:
        return entry(camera.column, line)
    return entry(camera.row, line)


@functools.cache
def make_item_kernel(cuda: bool, again: bool) -> wp.Kernel:
    """Queued groups of rows, one warp for each on the GPU, one thread on the CPU; ``again``: their further parts."""
    counter = PARTS if again else ITEMS

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def item_kernel(
        threads: wp.int32,
        size: wp.int32,
        camera: Camera,
        alpha: Alpha,
        nearest: wp.array(dtype=wp.uint64),
        queue: Queue,
    ):
        k = wp.tid()
        stop = queue.counts[wp.static(counter)]
        if wp.static(again):
            stop = wp.min(stop, queue.parts.shape[0])
        else:
            stop = wp.min(stop, queue.items.shape[0])
        bound = sign_bound(camera.tangents)
        spare = spare_bits(queue.depths.shape[0])
        step = threads
        lane = wp.int32(0)
        if wp.static(cuda):
            lane = lane_of(k)
            k = warp_of(k)
            step = warp_of(threads)
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
            r0 = entry_of_four(queue.records, i, 0)
            r1 = entry_of_four(queue.records, i, 1)
            r2 = entry_of_four(queue.records, i, 2)
            r3 = entry_of_four(queue.records, i, 3)
            candidate = Candidate()
            candidate.i = i
            candidate.spare = spare
            candidate.bound = bound
            candidate.m = entry_now(queue.depths, i)
            candidate.planes.n0 = wp.vec3f(r0[0], r0[1], r0[2])
            candidate.planes.n1 = wp.vec3f(r1[0], r1[1], r1[2])
            candidate.planes.n2 = wp.vec3f(r2[0], r2[1], r2[2])
            lines = Lines()
            lines.start = wp.vec3f(r0[3], r1[3], r2[3])
            lines.inverse = wp.vec3f(r3[0], r3[1], r3[2])
            first = work[1] & 65535
            rows = work[1] >> 16
            low = work[2] & 65535
            high = work[2] >> 16
            tall = work[3] != 0
            extent = wp.where(tall, camera.height, camera.width)
            candidate.sure = candidate.bound
            if wp.static(effects.alpha):
                if alpha.masked[i] != wp.uint8(0):
                    candidate.sure = wp.INF
            number = wp.int32(0)
            if wp.static(cuda):
                ends = wp.vec2i(0, -1)
                if lane < rows:
                    direction = line_direction(tall, first + lane, camera)
                    ends = pixels_of_row(
                        candidate.planes, candidate.bound, lines, direction, low, high, extent
                    )
                # From here on a lane has a row that holds pixels, as long as there are any.
                length = wp.max(0, ends[1] - ends[0] + 1)
                own = filled_lane(length)
                length = wp.where(own < LANES, of_lane(length, own), 0)
                sums = sum_to_lane(length)
                number = of_lane(sums, LANES - 1)
                start = sums - length
                base = of_lane(ends[0], own) - start
                own += first
                at = part * size
                end = wp.min(number, at + size)
                if at < end:
                    while at < end:
                        element = at + lane
                        r = lane_at(start, at)
                        along = of_lane(base, r) + element
                        line = of_lane(own, r)
                        x = wp.where(tall, line, along)
                        y = wp.where(tall, along, line)
                        at += LANES
                        unsure = wp.bool(False)
                        pixel = y * camera.width + x
                        if element < end:
                            unsure = test_pixel(nearest, pixel, candidate, direction_at(camera, x, y))
                        held = append_pairs(unsure, i, pixel, held, False, queue.counts, DOUBTS, queue.doubts)
            else:
                for line in range(first, first + rows):
                    direction = line_direction(tall, line, camera)
                    ends = pixels_of_row(
                        candidate.planes, candidate.bound, lines, direction, low, high, extent
                    )
                    for along in range(ends[0], ends[1] + 1):
                        # A part has its share of the group's pixels in order, as on the GPU.
                        if number // size == part:
                            x = wp.where(tall, line, along)
                            y = wp.where(tall, along, line)
                            pixel = y * camera.width + x
                            test_pixel_or_queue(nearest, queue, pixel, candidate, direction_at(camera, x, y))
                        number += 1
            if wp.static(not again):
                queue_parts(queue, item, number, size, lane)
        if wp.static(cuda):
            append_pairs(False, 0, 0, held, True, queue.counts, DOUBTS, queue.doubts)

    return item_kernel
