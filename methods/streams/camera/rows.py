"""Primary rays of larger triangles, on a GPU: groups of rows (of tall ones: columns), cut to the triangle."""

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera
from ...common.reads import direction_at
from ...exact.triangle import spare_bits
from ...gpu.entries import entry, entry_of_four
from ...gpu.warps import LANES, append_pairs, filled_lane, lane_at, lane_of, of_lane, sum_to_lane, warp_of
from ..queues import ITEMS, UNDECIDED, Queue, queue_chunks
from .pixels import Candidate, sign_bound, test_pixel
from .queued import stored_candidate, stored_planes
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
def queued_rows(queue: Queue, item: wp.int32, spare: wp.int32, bound: wp.float32, alpha: Alpha) -> Rows:
    """A group of the queue. ``spare``, ``bound``: see :class:`.pixels.Candidate`."""
    work = entry(queue.items, item)
    i = work[0]
    stored = stored_planes(queue, i)
    inverse = entry_of_four(queue.records, i, 3)
    rows = Rows()
    rows.candidate = stored_candidate(queue, i, stored.planes, spare, bound, alpha)
    rows.lines.start = stored.more
    rows.lines.inverse = wp.vec3f(inverse[0], inverse[1], inverse[2])
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


@wp.func
def test_pixel_of(
    rows: Rows,
    lanes: LaneRow,
    at: wp.int32,
    end: wp.int32,
    lane: wp.int32,
    camera: Camera,
    nearest: wp.array(dtype=wp.uint64),
) -> tuple[wp.bool, wp.int32]:
    """Test pixel ``at`` + lane of a group, if it is before ``end``: whether float64 must decide, and the pixel. All lanes
    must call it."""
    p = pixel_of(rows, lanes, at, lane)
    unsure = wp.bool(False)
    pixel = p[1] * camera.width + p[0]
    if at + lane < end:
        unsure = test_pixel(nearest, pixel, rows.candidate, direction_at(camera, p[0], p[1]))
    return unsure, pixel


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=REGISTERS)
def rows_kernel(
    threads: wp.int32, size: wp.int32, camera: Camera, alpha: Alpha, nearest: wp.array(dtype=wp.uint64), queue: Queue
):
    """Queued groups of rows, a warp for each: its first ``size`` pixels; further chunks of so many are queued."""
    k = wp.tid()
    stop = wp.min(queue.counts[ITEMS], queue.items.shape[0])
    bound = sign_bound(camera.tangents)
    spare = spare_bits(queue.depths.shape[0])
    lane = lane_of(k)
    k = warp_of(k)
    step = warp_of(threads)
    held = wp.int32(0)
    while k < stop:
        item = k
        k += step
        rows = queued_rows(queue, item, spare, bound, alpha)
        lanes = rows_of_lanes(rows, lane, camera)
        at = wp.int32(0)
        end = wp.min(lanes.number, size)
        while at < end:
            unsure, pixel = test_pixel_of(rows, lanes, at, end, lane, camera, nearest)
            at += LANES
            held = append_pairs(unsure, rows.candidate.i, pixel, held, False, queue.counts, UNDECIDED, queue.undecided)
        queue_chunks(queue, item, lanes.number, size, lane)
    append_pairs(False, 0, 0, held, True, queue.counts, UNDECIDED, queue.undecided)
