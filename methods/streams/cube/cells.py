"""The arrays in which a light's rays are sorted into cells, and the slots of its rays: 32 bits that say where each lies."""

from typing import Any

import warp as wp

from ....harness.frame.frame import AT_ONCE, Frame
from ....harness.frame.geometry import struct_with_bases
from ...gpu.entries import entry, set_entry
from .faces import FACES
from .farthest import TILE_CELLS

SPARE = wp.constant(4)
"""Words between two rows of cells: one for the end of a row, the others so that rows begin on 16-byte addresses."""


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
    """Cells that are narrower where more rays are expected: ``spacing`` and ``edges`` of columns and rows
    (:mod:`.spacing`), ``density`` of the rays (:mod:`.density`)."""

    spacing: wp.array(dtype=wp.vec2f)
    edges: wp.array(dtype=wp.vec2f)
    density: wp.array(dtype=wp.float32)


def cell_arrays(frame: Frame, cells: tuple[int, int, int], sorted_rays: bool = True) -> dict[str, Any]:
    """The arrays of :class:`RayCells` that lights in one branch use in turn. ``cells``: of :class:`RayCells`. On the
    GPU the scan empties ``count``.

    Not ``sorted_rays``: those that sort rays into cells are one element long.
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
