"""Primary rays of larger triangles, on a GPU: groups of rows (of tall ones: columns), cut to the triangle."""

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Mesh
from ...common.reads import direction_at
from ...exact.triangle import spare_bits
from ...gpu import warps
from ...gpu.entries import entry, entry_of_four, raise_entry
from ...gpu.warps import LANES
from ..queues import CHUNKS, ITEMS, UNDECIDED, Queue, held_undecided, queue_chunks
from .pixels import Candidate, hit_word, sign_bound, test_pixel
from .stream import Lines, ends_of_line, hit_of, stored_candidate, stored_planes

REGISTERS, REGISTERS_OF_LAST = 56, 80
"""Registers per thread, for nine blocks of 128 per multiprocessor, and for six of the last kernel."""

BLOCKS_OF_LAST = 6


@wp.struct
class Rows:
    """A queued group: a triangle as pixels are tested against it, the lines that bound its rows, and these.

    first, number  the first row, and how many        low, high  first and last column of the box
    Rows may be columns, and columns rows (:class:`.stream.Lines`).
    """

    candidate: Candidate
    lines: Lines
    first: wp.int32
    number: wp.int32
    low: wp.int32
    high: wp.int32


@wp.func
def queued_rows(queue: Queue, item: wp.int32, spare: wp.int32, bound: wp.float32, alpha: Alpha) -> Rows:
    """A group of the queue. ``spare``, ``bound``: see :class:`.pixels.Candidate`."""
    work = entry(queue.items, item)
    i = work[0]
    planes, start = stored_planes(queue, i)
    inverse = entry_of_four(queue.records, i, 3)
    rows = Rows()
    rows.candidate = stored_candidate(queue, i, planes, spare, bound, alpha)
    rows.lines.planes = planes
    rows.lines.bound = bound
    rows.lines.start = start
    rows.lines.inverse = wp.vec3f(inverse[0], inverse[1], inverse[2])
    rows.lines.tall = work[3] != 0
    rows.first = work[1] & 65535
    rows.number = work[1] >> 16
    rows.low = work[2] & 65535
    rows.high = work[2] >> 16
    return rows


@wp.struct
class LaneRow:
    """The row of a lane: which line it is, where its pixels begin among those of the group, and what to add to the number of
    one there for its place along the line. number: the pixels of the group.
    """

    line: wp.int32
    start: wp.int32
    base: wp.int32
    number: wp.int32


@wp.func
def rows_of_lanes(rows: Rows, lane: wp.int32, camera: Camera) -> LaneRow:
    """The rows of a group that hold pixels, one for each lane, as long as there are any. All lanes must call it."""
    ends = wp.vec2i(0, -1)
    if lane < rows.number:
        ends = ends_of_line(rows.lines, rows.first + lane, rows.low, rows.high, camera)
    length = wp.max(0, ends[1] - ends[0] + 1)
    own = warps.filled_lane(length)
    length = wp.where(own < LANES, warps.of_lane(length, own), 0)
    sums = warps.sum_to_lane(length)
    found = LaneRow()
    found.number = warps.of_lane(sums, LANES - 1)
    found.start = sums - length
    found.base = warps.of_lane(ends[0], own) - found.start
    found.line = rows.first + own
    return found


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
    must call it.
    """
    r = warps.lane_at(lanes.start, at)
    along = warps.of_lane(lanes.base, r) + at + lane
    line = warps.of_lane(lanes.line, r)
    x = wp.where(rows.lines.tall, line, along)
    y = wp.where(rows.lines.tall, along, line)
    unsure = wp.bool(False)
    pixel = y * camera.width + x
    if at + lane < end:
        unsure = test_pixel(nearest, pixel, rows.candidate, direction_at(camera, x, y))
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
    lane = warps.lane_of(k)
    k = warps.warp_of(k)
    step = warps.warp_of(threads)
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
            held = warps.append_pairs(
                unsure, rows.candidate.i, pixel, held, False, queue.counts, UNDECIDED, queue.undecided
            )
        queue_chunks(queue, item, lanes.number, size, lane)
    warps.append_pairs(False, 0, 0, held, True, queue.counts, UNDECIDED, queue.undecided)


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=REGISTERS_OF_LAST)
def last_kernel(
    threads: wp.int32,
    size: wp.int32,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    nearest: wp.array(dtype=wp.uint64),
    queue: Queue,
):
    """What is left: undecided pairs, and further chunks of queued groups, of ``size`` elements (at most ``most_chunk`` of
    :class:`..settings.Constants`).

    The pairs that the passes before have queued are decided first, then the chunks are tested. A warp keeps the pairs that
    are undecided in its chunks in shared memory, and decides them 32 at a time. So there is no further pass that waits for
    the last warps of this one.
    """
    thread = wp.tid()
    k = warps.warp_of(thread)
    lane = warps.lane_of(thread)
    step = warps.warp_of(threads)
    stop = wp.min(queue.counts[CHUNKS], queue.chunks.shape[0])
    listed = held_undecided(queue, thread)
    spare = spare_bits(queue.depths.shape[0])
    bound = sign_bound(camera.tangents)
    kept = warps.place_of_kept()
    first = k * LANES
    held = wp.int32(0)
    # All lanes go on together. The code that decides is there once: pairs of the list and kept ones come to it in turn.
    while first < listed or held > 0 or k < stop:
        if first < listed or held >= LANES or (held > 0 and k >= stop):
            pair = wp.vec2i(-1, 0)
            if first < listed:
                if first + lane < listed:
                    pair = entry(queue.undecided, first + lane)
                first += step * LANES
            else:
                number = wp.min(held, LANES)
                held -= number
                found = warps.kept_pair(kept, held + wp.min(lane, number - 1))
                if lane < number:
                    pair = found
            if pair[0] >= 0:
                hits, inverse = hit_of(pair, camera, mesh, alpha)
                if hits:
                    raise_entry(nearest, pair[1], hit_word(inverse, pair[0], spare))
        else:
            further = entry(queue.chunks, k)
            k += step
            rows = queued_rows(queue, further[0], spare, bound, alpha)
            lanes = rows_of_lanes(rows, lane, camera)
            at = further[1] * size
            end = wp.min(lanes.number, at + size)
            while at < end:
                unsure, pixel = test_pixel_of(rows, lanes, at, end, lane, camera, nearest)
                at += LANES
                held = warps.keep_pairs(unsure, rows.candidate.i, pixel, held, kept)
