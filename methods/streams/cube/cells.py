"""The faces of the cube around a light and their cells: where a point lies on them, the arrays in which rays are sorted into
cells, and how far the rays in them go.

On a face, planes through the light are lines, so bounds computed there are exact. In a room most triangles receive the light
or lie behind those that do: no ray goes so far. So the depth of the farthest receiver is kept for each tile of 8 x 8 cells:
distances from the light along the axis of a face, as float32 whose bits are compared as integers.
"""

from typing import Any

import warp as wp

from ....harness.frame.frame import AT_ONCE, Frame
from ....harness.frame.geometry import Corners, struct_with_bases
from ...exact.triangle import to_float64
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import raise_to

FACES = wp.constant(6)

SPARE = wp.constant(4)
"""Words between two rows of cells: one for the end of a row, the others so that rows begin on 16-byte addresses."""

TILE_SHIFT, TILE_CELLS = wp.constant(3), wp.constant(64)
"""A tile is 8 cells wide and high: the number of cells along a face is a multiple of that."""

MOST_TILES = wp.constant(32)
"""A triangle over more tiles is not tested: its thread would read them one after the other."""


class CellFields:
    """The shadow rays of one light, sorted into the cells of its cube.

    cells      along a face: where rays lie on many faces, and where they lie on few; how many are few
    rectangle  int32 [12]: what the rays cover (:mod:`.rectangle`)
    table      vec4f [7]: what they cover, for triangles (:mod:`.rectangle`)
    place      vec4f [pixels]: (u, v, face, depth) of each pixel's ray (face: also :data:`..rays.sort.STORED_FACE`)
    point      vec4f [pixels]: hit point and pixel, where a ray's is stored (:func:`..rays.place.place_ray`)
    triangle   int32 [pixels]: what each pixel's ray hit
    slot       int32 [pixels]: cell and rank of each pixel's ray (:func:`set_slot`); -1: none
    bits       of a cell in a slot           rank  int32 [pixels]: ranks that have no room there
    count, offset  int32 [6 faces * rows * (cells + SPARE)] and, of offset, one more: rays of each cell; first ray
    rays       vec4f [pixels]: points in the order of cells
    farthest   int32 [6 faces * tiles of 8 x 8 cells]: bits of the greatest depth of a ray
    """

    cells: wp.vec3i
    rectangle: wp.array(dtype=wp.int32)
    table: wp.array(dtype=wp.vec4f)
    place: wp.array(dtype=wp.vec4f)
    point: wp.array(dtype=wp.vec4f)
    triangle: wp.array(dtype=wp.int32)
    slot: wp.array(dtype=wp.int32)
    bits: wp.int32
    rank: wp.array(dtype=wp.int32)
    count: wp.array(dtype=wp.int32)
    offset: wp.array(dtype=wp.int32)
    rays: wp.array(dtype=wp.vec4f)
    farthest: wp.array(dtype=wp.int32)


@struct_with_bases
class RayCells(CellFields):
    """Cells of one size."""


@struct_with_bases
class SpacedCells(CellFields):
    """Cells that are narrower where more rays are expected: with what :mod:`.spacing` describes."""

    spacing: wp.array(dtype=wp.vec2f)
    edges: wp.array(dtype=wp.vec2f)
    density: wp.array(dtype=wp.float32)


def cell_arrays(frame: Frame, cells: tuple[int, int, int], sorted_rays: bool = True) -> dict[str, Any]:
    """The arrays of :class:`RayCells` that lights in one branch use in turn. ``cells``: of :class:`RayCells`. On the
    GPU the scan empties ``count``. Not ``sorted_rays``: those that sort rays into cells are one element long.
    """
    many, few, faces = cells
    spare, all_faces = int(SPARE), int(FACES)
    # Each face has its own place. If the finer cells are for a single face, it is face 0, and only that needs room.
    number = max(all_faces * many * (many + spare), (1 if faces == 1 else all_faces) * few * (few + spare))
    sorted_cells, sorted_pixels = (number, frame.pixels) if sorted_rays else (1, 1)
    with wp.ScopedDevice(frame.device):
        return {
            "cells": wp.vec3i(many, few, faces),
            "place": wp.zeros(frame.pixels, dtype=wp.vec4f),
            "point": wp.zeros(frame.pixels, dtype=wp.vec4f),
            "triangle": wp.zeros(frame.pixels, dtype=wp.int32),
            "slot": wp.zeros(sorted_pixels, dtype=wp.int32),
            "bits": number.bit_length(),
            "rank": wp.zeros(sorted_pixels, dtype=wp.int32),
            "count": wp.zeros(sorted_cells, dtype=wp.int32),
            "offset": wp.zeros(sorted_cells + 1, dtype=wp.int32),
            "rays": wp.zeros(sorted_pixels + AT_ONCE, dtype=wp.vec4f),
            "farthest": wp.zeros(-(-number // int(TILE_CELLS)), dtype=wp.int32),
        }


@wp.func
def face_of(q: wp.vec3d) -> wp.int32:
    """Face of the largest coordinate: 0 +x, 1 -x, 2 +y, 3 -y, 4 +z, 5 -z."""
    x = wp.abs(q[0])
    y = wp.abs(q[1])
    z = wp.abs(q[2])
    face = wp.int32(0)
    along = q[0]
    if y > x and y >= z:
        face = 2
        along = q[1]
    elif z > x and z > y:
        face = 4
        along = q[2]
    if along < wp.float64(0.0):
        face += 1
    return face


@wp.func
def on_face(q: Any, face: wp.int32) -> Any:
    """(along, across, up) of a point in the frame of a face."""
    r = q
    if face >> 1 == 1:
        r = type(q)(q[1], q[2], q[0])
    elif face >> 1 == 2:
        r = type(q)(q[2], q[0], q[1])
    if face & 1 == 1:
        r = type(q)(-r[0], r[1], r[2])
    return r


@wp.func
def place_of(hit: wp.vec3d, light: wp.vec3f, axes: wp.mat33d) -> wp.vec4f:
    """(u, v, face, depth) of a hit point; computed in float64, so that u and v keep a float's digits at any distance.

    The depth is taken along the face's axis; infinite where the point is the light.
    """
    q = axes * (hit - to_float64(light))
    face = face_of(q)
    r = on_face(q, face)
    u = wp.float32(0.0)
    v = wp.float32(0.0)
    depth = wp.float32(wp.INF)
    if r[0] > wp.float64(0.0):
        scale = wp.float64(1.0) / r[0]
        u = wp.float32(r[1] * scale)
        v = wp.float32(r[2] * scale)
        depth = wp.float32(r[0])
    return wp.vec4f(u, v, wp.float32(face), depth)


@wp.func
def set_slot(pixel: wp.int32, cell: wp.int32, rank: wp.int32, stored: wp.bool, cells: Any):
    """Set a ray's slot: from the lowest bit its cell, its rank, and in the highest whether its point is ``stored``.

    A rank without room is all ones there, and lies in ``rank``. No slot is -1: all ones are no cell. Four bytes for eight,
    where the passes wait for memory.
    """
    most = (1 << (31 - cells.bits)) - 1
    if rank >= most:
        set_entry(cells.rank, pixel, rank)
    word = cell | (wp.min(rank, most) << cells.bits)
    set_entry(cells.slot, pixel, wp.where(stored, word | (1 << 31), word))


@wp.func
def place_in_order(pixel: wp.int32, slot: wp.int32, cells: Any) -> wp.int32:
    """Where a pixel's ray lies among the rays."""
    most = (1 << (31 - cells.bits)) - 1
    rank = (slot >> cells.bits) & most
    start = entry(cells.offset, slot & ((1 << cells.bits) - 1))
    if rank == most:
        rank = entry(cells.rank, pixel)
    return start + rank


@wp.func
def tile_index(face: wp.int32, x: wp.int32, y: wp.int32, cells: wp.int32) -> wp.int32:
    """The tile of a cell."""
    along = cells >> TILE_SHIFT
    return (face * along + (y >> TILE_SHIFT)) * along + (x >> TILE_SHIFT)


@wp.func
def raise_from(seen: wp.int32, farthest: wp.array(dtype=wp.int32), tile: wp.int32, along: wp.float32):
    """Raise a tile to the depth ``along`` > 0, given what it held before."""
    depth = wp.cast(along, wp.int32)
    if seen < depth:
        raise_to(farthest, tile, depth)


@wp.func
def nearest_depth(q: Corners, slack: wp.float32) -> wp.float32:
    """A depth along a face's axis that no point of the triangle is nearer than."""
    return wp.min(q.a[0], wp.min(q.b[0], q.c[0])) - slack


@wp.func
def all_rays_end_before(
    depth: wp.float32, farthest: wp.array(dtype=wp.int32), face: wp.int32, box: wp.vec4i, cells: wp.int32
) -> wp.bool:
    """Whether certainly no ray in a box of cells (first column and row, last column and row) reaches ``depth``.

    Depth along the axis of a face is linear, so if the corners of a triangle lie at least that deep, all of its points
    do. A shadow segment from the light to a hit point at less depth has no point in common with it.
    """
    x0 = box[0] >> TILE_SHIFT
    y0 = wp.int32(box[1] >> TILE_SHIFT)
    x1 = box[2] >> TILE_SHIFT
    y1 = box[3] >> TILE_SHIFT
    if not (depth > 0.0) or (x1 - x0 + 1) * (y1 - y0 + 1) > MOST_TILES:
        return False
    along = cells >> TILE_SHIFT
    tile = (face * along + y0) * along + x0
    most = wp.int32(0)
    x = wp.int32(x0)
    while y0 <= y1:
        most = wp.max(most, entry(farthest, tile))
        x += 1
        tile += 1
        if x > x1:
            x = x0
            y0 += 1
            tile += along - (x1 - x0 + 1)
    return most < wp.cast(depth, wp.int32)
