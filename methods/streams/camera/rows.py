"""Primary rays of larger triangles: groups of rows (of tall ones: columns), cut to the triangle, pixel by pixel."""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera
from ...exact.triangle import spare_bits
from ...gpu.entries import entry, entry_now, entry_of_four
from ...gpu.warps import LANES, append_pairs, filled_lane, lane_at, lane_of, of_lane, sum_to_lane, warp_of
from ..queues import CHUNKS, ITEMS, UNDECIDED, Queue, queue_chunks
from ..reads import direction_at
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


@wp.struct
class Rows:
    """A queued group: a triangle as pixels are tested against it, the lines that bound its rows, and these.

    first, number  the first row, and how many        low, high  first and last column of the box
    tall           whether rows are columns, and columns rows
    """

    candidate: Candidate
    lines: Lines
    first: wp.int32
    number: wp.int32
    low: wp.int32
    high: wp.int32
    tall: wp.bool


@wp.func
def queued_rows(queue: Queue, item: wp.int32, spare: wp.int32, bound: wp.float32) -> Rows:
    """A group of the queue. ``spare``, ``bound``: see :class:`.pixels.Candidate`."""
    work = entry(queue.items, item)
    i = work[0]
    r0 = entry_of_four(queue.records, i, 0)
    r1 = entry_of_four(queue.records, i, 1)
    r2 = entry_of_four(queue.records, i, 2)
    r3 = entry_of_four(queue.records, i, 3)
    rows = Rows()
    rows.candidate.i = i
    rows.candidate.spare = spare
    rows.candidate.bound = bound
    rows.candidate.sure = bound
    rows.candidate.m = entry_now(queue.depths, i)
    rows.candidate.planes.n0 = wp.vec3f(r0[0], r0[1], r0[2])
    rows.candidate.planes.n1 = wp.vec3f(r1[0], r1[1], r1[2])
    rows.candidate.planes.n2 = wp.vec3f(r2[0], r2[1], r2[2])
    rows.lines.start = wp.vec3f(r0[3], r1[3], r2[3])
    rows.lines.inverse = wp.vec3f(r3[0], r3[1], r3[2])
    rows.first = work[1] & 65535
    rows.number = work[1] >> 16
    rows.low = work[2] & 65535
    rows.high = work[2] >> 16
    rows.tall = work[3] != 0
    return rows


@wp.func
def ends_of_row(rows: Rows, line: wp.int32, camera: Camera) -> wp.vec2i:
    """First and last pixel of a row of the group, cut to the triangle."""
    planes = rows.candidate.planes
    d = line_direction(rows.tall, line, camera)
    extent = wp.where(rows.tall, camera.height, camera.width)
    return pixels_of_row(planes, rows.candidate.bound, rows.lines, d, rows.low, rows.high, extent)


@wp.struct
class LaneRow:
    """The row of a lane: which line it is, where its pixels begin among those of the group, and what to add to the number of
    one there for its place along the line. number: the pixels of the group."""

    line: wp.int32
    start: wp.int32
    base: wp.int32
    number: wp.int32


@wp.func
def rows_of_lanes(rows: Rows, lane: wp.int32, camera: Camera) -> LaneRow:
    """The rows of a group that hold pixels, one for each lane, as long as there are any. All lanes must call it."""
    ends = wp.vec2i(0, -1)
    if lane < rows.number:
        ends = ends_of_row(rows, rows.first + lane, camera)
    length = wp.max(0, ends[1] - ends[0] + 1)
    own = filled_lane(length)
    length = wp.where(own < LANES, of_lane(length, own), 0)
    sums = sum_to_lane(length)
    found = LaneRow()
    found.number = of_lane(sums, LANES - 1)
    found.start = sums - length
    found.base = of_lane(ends[0], own) - found.start
    found.line = rows.first + own
    return found


@wp.func
def pixel_of(rows: Rows, lanes: LaneRow, at: wp.int32, lane: wp.int32) -> wp.vec2i:
    """Column and row of pixel ``at`` + lane of a group. All lanes must call it."""
    r = lane_at(lanes.start, at)
    along = of_lane(lanes.base, r) + at + lane
    line = of_lane(lanes.line, r)
    return wp.vec2i(wp.where(rows.tall, line, along), wp.where(rows.tall, along, line))


@functools.cache
def make_item_kernel(cuda: bool, again: bool) -> wp.Kernel:
    """Queued groups of rows, one warp for each on the GPU, one thread on the CPU; ``again``: their further chunks, on
    the CPU (on the GPU: :mod:`.remainder`)."""
    counter = CHUNKS if again else ITEMS

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
            stop = wp.min(stop, queue.chunks.shape[0])
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
            chunk = wp.int32(0)
            if wp.static(again):
                further = entry(queue.chunks, k)
                item = further[0]
                chunk = further[1]
            k += step
            rows = queued_rows(queue, item, spare, bound)
            i = rows.candidate.i
            if wp.static(effects.alpha):
                if alpha.masked[i] != wp.uint8(0):
                    rows.candidate.sure = wp.INF
            number = wp.int32(0)
            if wp.static(cuda):
                lanes = rows_of_lanes(rows, lane, camera)
                number = lanes.number
                at = wp.int32(0)
                end = wp.min(number, size)
                while at < end:
                    p = pixel_of(rows, lanes, at, lane)
                    unsure = wp.bool(False)
                    pixel = p[1] * camera.width + p[0]
                    if at + lane < end:
                        unsure = test_pixel(nearest, pixel, rows.candidate, direction_at(camera, p[0], p[1]))
                    at += LANES
                    held = append_pairs(
                        unsure, i, pixel, held, False, queue.counts, UNDECIDED, queue.undecided
                    )
            else:
                for line in range(rows.first, rows.first + rows.number):
                    ends = ends_of_row(rows, line, camera)
                    for along in range(ends[0], ends[1] + 1):
                        # A chunk has its share of the group's pixels in order, as on the GPU.
                        if number // size == chunk:
                            x = wp.where(rows.tall, line, along)
                            y = wp.where(rows.tall, along, line)
                            pixel = y * camera.width + x
                            test_pixel_or_queue(
                                nearest, queue, pixel, rows.candidate, direction_at(camera, x, y)
                            )
                        number += 1
            if wp.static(not again):
                queue_chunks(queue, item, number, size, lane)
        if wp.static(cuda):
            append_pairs(False, 0, 0, held, True, queue.counts, UNDECIDED, queue.undecided)

    return item_kernel
