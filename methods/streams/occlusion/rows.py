"""Shadow rays of larger triangles, on a GPU: groups of their rows, as they are queued, and the rays in these, cut to the
triangle.
"""

import functools
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Mesh, corners_of
from ...gpu import prefetch, warps
from ...gpu.entries import entry, entry_if, set_entry
from ...gpu.prefetch import FEW_ROWS, shared_entry
from ...gpu.reserve import reserve_groups
from ...gpu.warps import LANES
from ..camera.pixels import sure_of
from ..cube import footprint
from ..cube.cells import RayCells
from ..cube.footprint import Sides, corners_on, in_cube_space, on_bins, sides_on_face
from ..cube.lights import Light, cube_of_light, position_of
from ..cube.rectangle import cells_of, last_row
from ..queues import CHUNKS, ITEMS, LARGE, SMALL, UNDECIDED, Queue, claim_chunks, store_chunks
from ..rays.sort import span_of
from .planes import Occluder, ShadowBits, bound_of, certain, occluder_of, occludes_none, set_shadowed

SPLITTERS = wp.constant(2)
"""Threads that share the groups of one large triangle: a single one would store those of the largest one after the other."""

REGISTERS, REGISTERS_OF_SPLIT = 56, 96
"""Registers per thread that processes a queue, for nine blocks of 128 per multiprocessor; and of one that splits large
triangles: they are fewer than a GPU has room for.
"""


@wp.func
def groups_of(low: wp.int32, high: wp.int32, first: wp.int32, threads: wp.int32) -> wp.int32:
    """How many groups of rows low to high thread ``first`` of ``threads`` stores."""
    return (high - low + LANES * threads - first * LANES) // (LANES * threads)


@wp.func
def places_of(queue: Queue, low: wp.int32, high: wp.int32, number: wp.int32) -> wp.vec2i:
    """Reserve places for the groups of rows low to high; a triangle with at most :data:`FEW_ROWS` is a small one."""
    few = high - low < FEW_ROWS
    return reserve_groups(queue.counts, ITEMS, wp.where(few, 0, number), SMALL, few)


@wp.func
def queue_rows(queue: Queue, i: wp.int32, face: wp.int32, box: wp.vec4i, sides: Sides, occluder: Occluder):
    """Queue a large triangle's rows of cells (``box``: first column and row, last ones) in groups, by one thread."""
    number = groups_of(box[1], box[3], 0, 1)
    places = places_of(queue, box[1], box[3], number)
    ends = box[0] | (box[2] << 16)
    for g in range(number):
        y = box[1] + g * LANES
        set_group(queue.groups, places, g, face, y, box[1], box[3], ends, sides, occluder)


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=REGISTERS_OF_SPLIT)
def split_kernel(threads: wp.int32, light: Light, table: wp.array(dtype=wp.vec4f), mesh: Mesh, queue: Queue):
    """Queue the rows of large triangles in groups, with the lines that bound them and the planes of the triangle."""
    k = wp.tid()
    first = k % SPLITTERS
    k = k // SPLITTERS
    stop = wp.min(queue.counts[LARGE], queue.large.shape[0])
    cube = cube_of_light(light)
    row = last_row(table)
    position = position_of(light)
    while k < stop:
        work = entry(queue.large, k)
        k += threads // SPLITTERS
        i = work[0]
        face = work[1]
        low = work[3] & 65535
        high = work[3] >> 16
        number = groups_of(low, high, first, SPLITTERS)
        if number > 0:
            # Places are reserved while the corners are loaded.
            corners = corners_of(mesh, i)
            places = places_of(queue, low, high, number)
            q = corners_on(in_cube_space(corners, cube), face)
            r = entry(table, face)
            flat = on_bins(q, footprint.extent_with_rays(cube, corners, row), r)
            sides = sides_on_face(flat, position, cube, face, corners, r)
            bound = bound_of(row, corners)
            occluder = occluder_of(i, bound, bound, position, corners, True)
            for g in range(number):
                y = low + (first + g * SPLITTERS) * LANES
                set_group(queue.groups, places, g, face, y, low, high, work[2], sides, occluder)


@wp.func
def set_group(
    groups: wp.array2d(dtype=wp.vec4f),
    places: wp.vec2i,
    g: wp.int32,
    face: wp.int32,
    y: wp.int32,
    low: wp.int32,
    high: wp.int32,
    ends: wp.int32,
    sides: Sides,
    occluder: Occluder,
):
    """Store group g of rows low to high, from row y on, in its place (:func:`places_of`), if there is room: (face and
    rows << 4 and first row << 16, first cell and last << 16, triangle, its bound), three lines, four planes. Whole numbers
    are stored as bits. A triangle that occludes no ray has no rows.
    """
    few = high - low < FEW_ROWS
    place = wp.where(few, places[1], places[0] + g)
    if place >= groups.shape[0]:
        return
    at = wp.where(few, groups.shape[0] - 1 - place, place)
    rows = wp.where(occludes_none(occluder), 0, wp.min(LANES, high - y + 1))
    which = face | (rows << 4) | (y << 16)
    head = wp.vec4f(
        wp.cast(which, wp.float32), wp.cast(ends, wp.float32), wp.cast(occluder.i, wp.float32), occluder.bound
    )
    set_entry(groups, at, 0, head)
    set_entry(groups, at, 1, sides.line0)
    set_entry(groups, at, 2, sides.line1)
    set_entry(groups, at, 3, sides.line2)
    set_entry(groups, at, 4, occluder.e0)
    set_entry(groups, at, 5, occluder.e1)
    set_entry(groups, at, 6, occluder.e2)
    set_entry(groups, at, 7, occluder.plane)


@wp.func
def rays_of_row(group: wp.int32, r: wp.int32, along: wp.int32, cells: Any) -> wp.vec2i:
    """First ray and end in row r of a group in shared memory, cut to the triangle; none beyond its rows. ``along``: cells
    along a face.
    """
    head = shared_entry(True, group, wp.vec4f())
    which = wp.cast(head[0], wp.int32)
    span = wp.vec2i(0, 0)
    if r < ((which >> 4) & 63):
        sides = Sides()
        sides.line0 = shared_entry(True, group + 16, wp.vec4f())
        sides.line1 = shared_entry(True, group + 32, wp.vec4f())
        sides.line2 = shared_entry(True, group + 48, wp.vec4f())
        limits = wp.cast(head[1], wp.int32)
        y = (which >> 16) + r
        face = which & 15
        ends = footprint.cells_of_row(sides, face, y, limits & 65535, limits >> 16, along, cells)
        if ends[1] >= ends[0]:
            span = span_of(cells.offset, face, ends[0], ends[1], y, along)
    return span


@wp.func
def occluder_of_group(occluder: Occluder, group: wp.int32, loaded: wp.int32) -> Occluder:
    """The occluder of a group in shared memory, unless that is the one ``loaded`` before."""
    o = occluder
    other = group != loaded
    head = shared_entry(other, group, wp.vec4f(0.0, 0.0, wp.cast(occluder.i, wp.float32), occluder.bound))
    o.i = wp.cast(head[2], wp.int32)
    o.bound = head[3]
    o.sure = head[3]
    o.e0 = shared_entry(other, group + 64, occluder.e0)
    o.e1 = shared_entry(other, group + 80, occluder.e1)
    o.e2 = shared_entry(other, group + 96, occluder.e2)
    o.plane = shared_entry(other, group + 112, occluder.plane)
    return o


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
        row = prefetch.row_at(rows, warps.lane_at(start, at))
        prefetch.fetch_ray(rays, row[0] + at + lane, at + lane < end, row[1], steps, prefetch.step_of(at))
    prefetch.end_of_step()


@wp.struct
class Tested:
    """The pair that a lane tested last: undecided if the ray's ``own`` triangle, known one step later, is not triangle
    ``i``. held: pairs that the warp holds (:func:`...gpu.warps.append_pairs`).
    """

    i: wp.int32
    own: wp.int32
    pixel: wp.int32
    held: wp.int32


@wp.func
def append_tested(tested: Tested, last: wp.bool, queue: Queue) -> wp.int32:
    """Queue the pair if it is undecided; how many the warp still holds. All lanes must call it."""
    return warps.append_pairs(
        tested.own != tested.i, tested.i, tested.pixel, tested.held, last, queue.counts, UNDECIDED, queue.undecided
    )


@wp.func
def test_fetched(h: wp.vec4f, occluder: Occluder, inside: wp.bool, before: Tested, bits: Any, queue: Queue) -> Tested:
    """Test a lane's ray, if it has one (``inside``), and queue the pair that it tested ``before`` if that is undecided. All
    lanes must call it.
    """
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
    chunks of so many (``again``).
    """

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def rows_kernel(threads: wp.int32, size: wp.int32, cells: RayCells, alpha: Alpha, bits: ShadowBits, queue: Queue):
        k = wp.tid()
        capacity = queue.groups.shape[0]
        large = wp.min(queue.counts[ITEMS], capacity)
        small = wp.min(queue.counts[SMALL], capacity)
        along = cells_of(last_row(cells.table))
        stop = large + prefetch.packs_of(small)
        if wp.static(again):
            stop = wp.min(queue.counts[CHUNKS], queue.chunks.shape[0])
        lane = warps.lane_of(k)
        k = warps.warp_of(k)
        step = warps.warp_of(threads)
        steps = prefetch.place_of_steps()
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
            following = prefetch.fetch_groups(queue.groups, item, large, small, set)
        while k < stop:
            prefetch.wait_for_groups()
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
                following = prefetch.fetch_groups(queue.groups, item, large, small, set)
            row = lane
            if this_item >= large:
                group += prefetch.pack_of(lane) * prefetch.GROUP_BYTES
                row = lane & (FEW_ROWS - 1)
            span = rays_of_row(group, row, along, cells)
            length = span[1] - span[0]
            sums = warps.sum_to_lane(length)
            number = warps.of_lane(sums, LANES - 1)
            start = sums - length
            rows = prefetch.set_rows(length > 0, span[0] - start, group)
            if length == 0:
                start = prefetch.NOWHERE
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
                    occluder.sure = sure_of(occluder.i, occluder.bound, alpha)
                    while at < end:
                        prefetch.wait_for_step()
                        h = prefetch.fetched_ray(steps, prefetch.step_of(at))
                        inside = at + lane < end
                        fetch_ray_of_lane(steps, rows, start, at + 3 * LANES, lane, end, cells.rays)
                        tested = test_fetched(h, occluder, inside, tested, bits, queue)
                        at += LANES
                while at < end:
                    prefetch.wait_for_step()
                    of_ray = prefetch.fetched_group(steps, prefetch.step_of(at))
                    h = prefetch.fetched_ray(steps, prefetch.step_of(at))
                    occluder = occluder_of_group(occluder, of_ray, loaded)
                    occluder.sure = sure_of(occluder.i, occluder.bound, alpha)
                    loaded = of_ray
                    inside = at + lane < end
                    fetch_ray_of_lane(steps, rows, start, at + 3 * LANES, lane, end, cells.rays)
                    tested = test_fetched(h, occluder, inside, tested, bits, queue)
                    at += LANES
            if wp.static(not again):
                store_chunks(queue, claimed, this_item, number, size, lane)
        append_tested(tested, True, queue)

    return rows_kernel
