"""Groups of rows of a light's larger triangles, as they are queued for the warps that test the rays in them."""

from typing import Any

import warp as wp

from ....harness.frame.geometry import Corners, Mesh, corners_of
from ...gpu.entries import entry, set_entry
from ...gpu.prefetch import FEW_ROWS, shared_entry
from ...gpu.reserve import reserve_groups
from ...gpu.warps import LANES
from ..cube.footprint import (
    Flat,
    Sides,
    cells_of_row,
    corners_on,
    extent_with_rays,
    in_cube_space,
    on_bins,
    sides_of_flat,
    sides_of_planes,
)
from ..cube.lights import Cube, Light, cube_of_light, position_of
from ..cube.rectangle import last_row
from ..queues import ITEMS, LARGE, SMALL, Queue
from ..rays.sort import span_of
from .planes import Occluder, occluder_of, occludes_none

SPLITTERS = wp.constant(2)
"""Threads that share the groups of one large triangle: a single one would store those of the largest one after the other."""


REGISTERS = 96
"""Registers per thread that splits large triangles: they are fewer than a GPU has room for."""


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
def sides_on_face(flat: Flat, light: wp.vec3f, cube: Cube, face: wp.int32, corners: Corners, r: wp.vec4f) -> Sides:
    """The lines that bound a triangle's cells on a face, from its projection if that is known."""
    if flat.valid:
        return sides_of_flat(flat)
    return sides_of_planes(light, cube, face, corners, r)


@wp.func
def queue_rows(queue: Queue, i: wp.int32, face: wp.int32, box: wp.vec4i, sides: Sides, occluder: Occluder):
    """Queue a large triangle's rows of cells (``box``: first column and row, last ones) in groups, by one thread."""
    number = groups_of(box[1], box[3], 0, 1)
    places = places_of(queue, box[1], box[3], number)
    ends = box[0] | (box[2] << 16)
    for g in range(number):
        y = box[1] + g * LANES
        set_group(queue.groups, places, g, face, y, box[1], box[3], ends, sides, occluder)


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=REGISTERS)
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
            flat = on_bins(q, extent_with_rays(cube, corners, row), r)
            sides = sides_on_face(flat, position, cube, face, corners, r)
            occluder = occluder_of(i, False, position, corners, row, True)
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
    are stored as bits. A triangle that occludes no ray has no rows."""
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
    along a face."""
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
        ends = cells_of_row(sides, face, y, limits & 65535, limits >> 16, along, cells)
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
