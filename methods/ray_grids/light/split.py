"""Groups of rows of a light's larger triangles, as they are queued for the warps that test the rays in them."""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Mesh, corners_of
from ...common.entries import entry, set_entry
from ...common.reserve import reserve_groups
from ..ahead import FEW_ROWS
from ..aim import cube_of
from ..cube import on_face
from ..queues import ITEMS, LARGE, SMALL, Queue
from ..warps import LANES
from .cells import Sides, cube_space, on_cells, sides_of_flat, sides_of_planes
from .rays import Occluder, occluder_of
from .table import cells_of, last_row, reach_with_rays

SPLITTERS = wp.constant(2)
"""Threads that share the groups of one large triangle: a single one would store those of the largest one after the other."""


@wp.kernel(enable_backward=False, grid_stride=False)
def split_kernel(
    threads: wp.int32,
    light: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    cubes: wp.array2d(dtype=wp.vec4f),
    table: wp.array(dtype=wp.vec4f),
    mesh: Mesh,
    queue: Queue,
):
    """Queue the rows of large triangles in groups, with the lines that bound them and the planes of the triangle.

    A triangle with at most :data:`..ahead.FEW_ROWS` rows is a small group.
    """
    k = wp.tid()
    first = k % SPLITTERS
    k = k // SPLITTERS
    stop = wp.min(queue.counts[LARGE], queue.large.shape[0])
    cube = cube_of(cubes, light)
    row = last_row(table)
    cells = cells_of(row)
    position = lights[light]
    capacity = queue.groups.shape[0]
    while k < stop:
        work = entry(queue.large, k)
        k += threads // SPLITTERS
        i = work[0]
        face = work[1]
        low = work[3] & 65535
        high = work[3] >> 16
        few = high - low < FEW_ROWS
        number = (high - low + LANES * SPLITTERS - first * LANES) // (LANES * SPLITTERS)
        if number > 0:
            # Places are reserved while the corners are loaded.
            corners = corners_of(mesh, i)
            places = reserve_groups(queue.counts, ITEMS, wp.where(few, 0, number), SMALL, few)
            qa = on_face(cube_space(corners.a, cube), face)
            qb = on_face(cube_space(corners.b, cube), face)
            qc = on_face(cube_space(corners.c, cube), face)
            flat = on_cells(qa, qb, qc, reach_with_rays(cube, corners, row), entry(table, face))
            sides = Sides()
            if flat.known:
                sides = sides_of_flat(flat)
            else:
                sides = sides_of_planes(position, cube, face, corners, table[face], cells)
            occluder = occluder_of(i, False, position, corners, row)
            for g in range(number):
                place = wp.where(few, places[1], places[0] + g)
                if place < capacity:
                    y = low + (first + g * SPLITTERS) * LANES
                    which = face | (wp.min(LANES, high - y + 1) << 4) | (y << 16)
                    at = wp.where(few, capacity - 1 - place, place)
                    set_group(queue.groups, at, which, work[2], sides, occluder)


@wp.func
def set_group(
    groups: wp.array2d(dtype=wp.vec4f),
    at: wp.int32,
    which: wp.int32,
    ends: wp.int32,
    sides: Sides,
    occluder: Occluder,
):
    """Store a group: (face and rows << 4 and first row << 16, first cell and last << 16, triangle, its bound), three lines,
    four planes. Whole numbers are stored as bits."""
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
