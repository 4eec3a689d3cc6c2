"""Shadow rays sorted into the cells of the light's cube: face, row, cell."""

from __future__ import annotations

import warp as wp

from ...common.entries import entry, set_entry
from ...common.pixels import tile_pixel
from ...common.reserve import number_in
from ..aim import FACE, FACES, HIGH_U, HIGH_V, LARGEST, LOW_U, LOW_V, from_ordered
from ..queues import RAYS
from ..warps import scan_row
from .reach import note_receiver

SPARE = wp.constant(4)
"""Words between two rows of cells: where a row ends, and none to keep rows on 16-byte addresses."""


@wp.func
def face_rectangle(face: wp.int32, rectangle: wp.array(dtype=wp.int32), cells: wp.int32) -> wp.vec4f:
    """(low u, low v, cells per u, cells per v) of a face."""
    low_u = wp.float32(-1.0)
    low_v = wp.float32(-1.0)
    high_u = wp.float32(1.0)
    high_v = wp.float32(1.0)
    if face == 0:
        low_u = from_ordered(rectangle[LOW_U])
        low_v = from_ordered(rectangle[LOW_V])
        high_u = -from_ordered(rectangle[HIGH_U])
        high_v = -from_ordered(rectangle[HIGH_V])
    n = wp.float32(cells)
    hair = (
        1.0e-6 * wp.max(wp.max(wp.abs(low_u), wp.abs(high_u)), wp.max(wp.abs(low_v), wp.abs(high_v)))
        + 1.0e-30
    )
    return wp.vec4f(low_u, low_v, n / (high_u - low_u + hair), n / (high_v - low_v + hair))


@wp.func
def cell_along(x: wp.float32, low: wp.float32, per_unit: wp.float32, cells: wp.int32) -> wp.int32:
    """Monotone; triangles are mapped by the same numbers, with a pad far beyond what this rounds."""
    return wp.int32(wp.clamp((x - low) * per_unit, 0.0, wp.float32(cells) - 0.5))


@wp.func
def cell_index(face: wp.int32, x: wp.int32, y: wp.int32, cells: wp.int32) -> wp.int32:
    """Cells of a row are neighbours in memory, and so are the rays in them."""
    return (face * cells + y) * (cells + SPARE) + x


@wp.func
def span_of(
    offset: wp.array(dtype=wp.int32), face: wp.int32, x0: wp.int32, x1: wp.int32, y: wp.int32, cells: wp.int32
) -> wp.vec2i:
    """First ray and end of cells x0..x1 of a row."""
    first = cell_index(face, x0, y, cells)
    return wp.vec2i(entry(offset, first), entry(offset, first + (x1 - x0) + 1))


@wp.func
def cells_in_use(rectangle: wp.array(dtype=wp.int32), cells: wp.vec2i) -> wp.int32:
    """Cells along a face: the first number where rays lie on several faces, the second where all lie on face 0.

    Fewer rays of other triangles share a finer cell, but every face in use has its cells cleared and summed up.
    """
    chosen = cells[1]
    for k in range(1, FACES):
        if rectangle[FACE + k] == 0:
            chosen = cells[0]
    return chosen


@wp.kernel(enable_backward=False, grid_stride=False)
def count_kernel(
    width: wp.int32,
    height: wp.int32,
    cells_either: wp.vec2i,
    place: wp.array(dtype=wp.vec4f),
    rectangle: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    slot: wp.array(dtype=wp.vec2i),
    farthest: wp.array(dtype=wp.int32),
):
    """Cell of every ray, and its rank there; the farthest receivers. Ranks depend on the order of threads; no answer
    does."""
    at = tile_pixel(wp.tid(), width, height)
    if at[0] < 0:
        return
    pixel = at[1] * width + at[0]
    p = entry(place, pixel)
    face = wp.int32(p[2])
    if face < 0:
        set_entry(slot, pixel, wp.vec2i(-1, 0))
        return
    cells = cells_in_use(rectangle, cells_either)
    r = face_rectangle(face, rectangle, cells)
    x = cell_along(p[0], r[0], r[2], cells)
    y = cell_along(p[1], r[1], r[3], cells)
    cell = cell_index(face, x, y, cells)
    set_entry(slot, pixel, wp.vec2i(cell, number_in(count, cell)))
    note_receiver(farthest, face, x, y, p[3], cells)


@wp.kernel(enable_backward=False, grid_stride=False)
def scan_kernel(
    cells_either: wp.vec2i,
    rectangle: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    offset: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    table: wp.array(dtype=wp.vec4f),
):
    """Where each row's rays lie (GPU: 128 threads a row, faces without rays left out), and the faces' rectangles.

    table: each face's rectangle in float32, for triangles: (low u, low v, cells per u, cells per v); zero if unused.
    After them, cells along a face and the largest coordinate of a hit point.
    """
    k = wp.tid()
    row = k // 128
    cells = cells_in_use(rectangle, cells_either)
    if rectangle[FACE + row // cells] == 0:
        scan_row(count, offset, row * (cells + SPARE), cells, counts, RAYS)
    if k < FACES:
        t = wp.vec4f(0.0, 0.0, 0.0, 0.0)
        if rectangle[FACE + k] == 0:
            t = face_rectangle(k, rectangle, cells)
        table[k] = t
    if k == FACES:
        table[k] = wp.vec4f(wp.float32(cells), wp.cast(rectangle[LARGEST], wp.float32), 0.0, 0.0)


@wp.func
def cells_of(table: wp.array(dtype=wp.vec4f)) -> wp.int32:
    """Cells along a face, as the scan left them."""
    return wp.int32(table[FACES][0])


@wp.func
def reach_of(table: wp.array(dtype=wp.vec4f)) -> wp.float32:
    """The largest coordinate of a hit point, likewise."""
    return table[FACES][1]


@wp.kernel(enable_backward=False, grid_stride=False)
def scatter_kernel(
    width: wp.int32,
    height: wp.int32,
    point: wp.array(dtype=wp.vec4f),
    slot: wp.array(dtype=wp.vec2i),
    offset: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec4f),
):
    """Rays in cell order: float32 hit point, and the pixel's number in the bits of the fourth."""
    at = tile_pixel(wp.tid(), width, height)
    if at[0] < 0:
        return
    pixel = at[1] * width + at[0]
    s = entry(slot, pixel)
    if s[0] >= 0:
        set_entry(rays, offset[s[0]] + s[1], entry(point, pixel))
