"""Shadow rays of larger triangles, on a GPU: the rays in groups of rows, cut to the triangle."""

import functools
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ...gpu.entries import entry, entry_if
from ...gpu.prefetch import (
    FEW_ROWS,
    GROUP_BYTES,
    NOWHERE,
    end_of_step,
    fetch_groups,
    fetch_ray,
    fetched_group,
    fetched_ray,
    pack_of,
    packs_of,
    place_of_steps,
    row_at,
    set_rows,
    step_of,
    wait_for_groups,
    wait_for_step,
)
from ...gpu.warps import LANES, append_pairs, lane_at, lane_of, of_lane, sum_to_lane, warp_of
from ..cube.cells import RayCells
from ..cube.rectangle import cells_of, last_row
from ..queues import CHUNKS, ITEMS, SMALL, UNDECIDED, Queue, claim_chunks, store_chunks
from .groups import occluder_of_group, rays_of_row
from .planes import Occluder
from .ray_test import ShadowBits, certain, set_shadowed

REGISTERS = 56
"""Registers per thread that processes a queue, for nine blocks of 128 per multiprocessor."""


@wp.func
def fetch_ray_of_lane(
    steps: wp.int32,
    rows: wp.int32,
    start: wp.int32,
    at: wp.int32,
    lane: wp.int32,
    end: wp.int32,
    rays: wp.array(dtype=wp.vec4f),
):
    """Fetch ray ``at`` + lane of the rows of a warp's lanes, if that is before ``end``, for the step of ``at``. All lanes
    must call it.

    start  where the rays of a lane's row start        rows  place of the rows (:func:`...gpu.prefetch.set_rows`)
    """
    if at < end:
        row = row_at(rows, lane_at(start, at))
        fetch_ray(rays, row[0] + at + lane, at + lane < end, row[1], steps, step_of(at))
    end_of_step()


@wp.func
def sure_of(occluder: Occluder, alpha: Alpha) -> wp.float32:
    """Beyond which signs hit certainly: none do if the triangle has holes."""
    return wp.where(alpha.masked[occluder.i] != wp.uint8(0), wp.INF, occluder.bound)


@wp.struct
class Tested:
    """The pair that a lane tested last: undecided if the ray's ``own`` triangle, known one step later, is not triangle
    ``i``. held: pairs that the warp holds (:func:`...gpu.warps.append_pairs`)."""

    i: wp.int32
    own: wp.int32
    pixel: wp.int32
    held: wp.int32


@wp.func
def append_tested(tested: Tested, last: wp.bool, queue: Queue) -> wp.int32:
    """Queue the pair if it is undecided; how many the warp still holds. All lanes must call it."""
    return append_pairs(
        tested.own != tested.i, tested.i, tested.pixel, tested.held, last, queue.counts, UNDECIDED, queue.undecided
    )


@wp.func
def test_fetched(h: wp.vec4f, occluder: Occluder, inside: wp.bool, before: Tested, bits: Any, queue: Queue) -> Tested:
    """Test a lane's ray, if it has one (``inside``), and queue the pair that it tested ``before`` if that is undecided. All
    lanes must call it."""
    misses, hits = certain(h, occluder)
    tested = Tested()
    tested.held = append_tested(before, False, queue)
    tested.i = occluder.i
    tested.pixel = wp.cast(h[3], wp.int32)
    if inside and hits:
        set_shadowed(bits, tested.pixel, occluder.i)
    tested.own = entry_if(inside and not misses and not hits, bits.triangle, tested.pixel, occluder.i)
    return tested


@functools.cache
def make_rows_kernel(again: bool) -> wp.Kernel:
    """Queued groups of rows, a warp for each large one and for four small ones: their first ``size`` rays; or the further
    chunks of so many (``again``)."""

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def rows_kernel(threads: wp.int32, size: wp.int32, cells: RayCells, alpha: Alpha, bits: ShadowBits, queue: Queue):
        k = wp.tid()
        capacity = queue.groups.shape[0]
        large = wp.min(queue.counts[ITEMS], capacity)
        small = wp.min(queue.counts[SMALL], capacity)
        along = cells_of(last_row(cells.table))
        stop = large + packs_of(small)
        if wp.static(again):
            stop = wp.min(queue.counts[CHUNKS], queue.chunks.shape[0])
        lane = lane_of(k)
        k = warp_of(k)
        step = warp_of(threads)
        steps = place_of_steps()
        tested = Tested()
        # The groups of the next item are fetched while this one's are in use.
        item = k
        chunk = wp.int32(0)
        set = wp.int32(0)
        following = wp.int32(0)
        if k < stop:
            if wp.static(again):
                further = entry(queue.chunks, k)
                item = further[0]
                chunk = further[1]
            following = fetch_groups(queue.groups, item, large, small, set)
        while k < stop:
            wait_for_groups()
            group = following
            this_item = item
            this_chunk = chunk
            k += step
            item = k
            set = 1 - set
            if k < stop:
                if wp.static(again):
                    further = entry(queue.chunks, k)
                    item = further[0]
                    chunk = further[1]
                following = fetch_groups(queue.groups, item, large, small, set)
            row = lane
            if this_item >= large:
                group += pack_of(lane) * GROUP_BYTES
                row = lane & (FEW_ROWS - 1)
            span = rays_of_row(group, row, along, cells)
            length = span[1] - span[0]
            sums = sum_to_lane(length)
            number = of_lane(sums, LANES - 1)
            start = sums - length
            rows = set_rows(length > 0, span[0] - start, group)
            if length == 0:
                start = NOWHERE
            claimed = wp.int32(0)
            if wp.static(not again):
                if number > size:
                    claimed = claim_chunks(queue, number, size)
            at = this_chunk * size
            end = wp.min(number, at + size)
            if at < end:
                for ahead in range(3):
                    fetch_ray_of_lane(steps, rows, start, at + ahead * LANES, lane, end, cells.rays)
                occluder = Occluder()
                loaded = wp.int32(-1)
                if this_item < large:
                    # All rays are of one group: its occluder is loaded once.
                    occluder = occluder_of_group(occluder, group, loaded)
                    if wp.static(effects.alpha):
                        occluder.sure = sure_of(occluder, alpha)
                    while at < end:
                        wait_for_step()
                        h = fetched_ray(steps, step_of(at))
                        inside = at + lane < end
                        fetch_ray_of_lane(steps, rows, start, at + 3 * LANES, lane, end, cells.rays)
                        tested = test_fetched(h, occluder, inside, tested, bits, queue)
                        at += LANES
                while at < end:
                    wait_for_step()
                    of_ray = fetched_group(steps, step_of(at))
                    h = fetched_ray(steps, step_of(at))
                    occluder = occluder_of_group(occluder, of_ray, loaded)
                    if wp.static(effects.alpha):
                        occluder.sure = sure_of(occluder, alpha)
                    loaded = of_ray
                    inside = at + lane < end
                    fetch_ray_of_lane(steps, rows, start, at + 3 * LANES, lane, end, cells.rays)
                    tested = test_fetched(h, occluder, inside, tested, bits, queue)
                    at += LANES
            if wp.static(not again):
                store_chunks(queue, claimed, this_item, number, size, lane)
        append_tested(tested, True, queue)

    return rows_kernel
