"""Shadow rays sorted into the cells of the light's cube: face, row, cell."""

import functools
from typing import Any

import warp as wp

from ...common.pixels import tile_pixel
from ...gpu.entries import entry, entry_if, set_entry
from ...gpu.reserve import number_among
from ...gpu.warps import scan_row
from ..cube.cells import SPARE, RayCells, place_in_order, raise_from, set_slot, tile_index
from ..cube.rectangle import cells_in_use, cells_of, face_in_use, face_rectangle, last_row, set_table
from ..cube.spacing import in_cells, set_edges
from ..queues import RAYS
from .hit_points import PrimaryHits, has_ray, point_of_word

STORED_FACE = wp.constant(8)
"""Added to the face of a place whose ray has its point in ``point``."""


@wp.func
def cell_of(p: wp.vec4f, face: wp.int32, r: wp.vec4f, along: wp.int32, cells: Any) -> wp.vec2i:
    """Column and row of a ray's cell, given its place (u, v, ...) and its face's row of the table."""
    x = in_cells(cells, 0, face, (p[0] - r[0]) * r[2], along)
    y = in_cells(cells, 1, face, (p[1] - r[1]) * r[3], along)
    last = wp.float32(along) - 0.5
    return wp.vec2i(wp.int32(wp.min(x, last)), wp.int32(wp.min(y, last)))


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
def rays_in_box(offset: wp.array(dtype=wp.int32), face: wp.int32, box: wp.vec4i, cells: wp.int32) -> wp.int32:
    """Number of rays in a box of cells: first column and row, last column and row."""
    first = wp.int32(cell_index(face, box[0], box[1], cells))
    across = box[2] - box[0] + 1
    number = wp.int32(0)
    y = wp.int32(box[1])
    # Two rows at a time: what is loaded of both is on its way at once.
    while y <= box[3]:
        two = y < box[3]
        other = first + cells + SPARE
        start = entry(offset, first)
        end = entry(offset, first + across)
        start_other = entry_if(two, offset, other, 0)
        end_other = entry_if(two, offset, other + across, 0)
        number += (end - start) + (end_other - start_other)
        first = other + cells + SPARE
        y += 2
    return number


@wp.func
def count_in_cell(
    pixel: wp.int32, p: wp.vec4f, face: wp.int32, r: wp.vec4f, along: wp.int32, stored: wp.bool, cells: Any
):
    """Count the ray of a pixel in its cell, given its place, the face's rectangle and the cells along it; ``stored``:
    whether its point is.
    """
    at = cell_of(p, face, r, along, cells)
    cell = cell_index(face, at[0], at[1], along)
    # Loaded before the rank is waited for.
    tile = tile_index(face, at[0], at[1], along)
    seen = entry(cells.farthest, tile)
    set_slot(pixel, cell, number_among(cells.count, cell), stored, cells)
    raise_from(seen, cells.farthest, tile, p[3])


@wp.func
def count_ray(pixel: wp.int32, p: wp.vec4f, cells: Any):
    """Count the ray of a pixel in its cell, given its place."""
    face = wp.int32(p[2]) & (STORED_FACE - 1)
    along = cells_in_use(cells.rectangle, cells.cells)
    stored = p[2] >= wp.float32(STORED_FACE)
    count_in_cell(pixel, p, face, face_rectangle(face, cells.rectangle), along, stored, cells)


@wp.func
def count_in_table(pixel: wp.int32, p: wp.vec4f, stored: wp.bool, cells: Any):
    """:func:`count_ray`, where the faces' rectangles are in the table already."""
    face = wp.int32(p[2])
    count_in_cell(pixel, p, face, entry(cells.table, face), cells_of(last_row(cells.table)), stored, cells)


@wp.kernel(enable_backward=False, grid_stride=False)
def count_kernel(
    first: wp.int32, light: wp.int32, hits: PrimaryHits, receivers: wp.array2d(dtype=wp.uint8), cells: RayCells
):
    """Cell of every ray, and its rank there; the farthest receivers. Ranks depend on the order of threads; no answer
    does.
    """
    at = tile_pixel(first + wp.tid(), hits.camera.width, hits.camera.height)
    if at[0] < 0:
        return
    pixel = at[1] * hits.camera.width + at[0]
    if not has_ray(hits, receivers, light, pixel):
        set_entry(cells.slot, pixel, -1)
        return
    count_ray(pixel, entry(cells.place, pixel), cells)


@wp.kernel(enable_backward=False, grid_stride=False)
def table_kernel(cells: RayCells):
    """The table, where what the rays cover is known before there are rays."""
    set_table(wp.tid(), cells.rectangle, cells.table, cells_in_use(cells.rectangle, cells.cells))


@wp.kernel(enable_backward=False, grid_stride=False)
def scan_kernel(threads: wp.int32, tabled: wp.bool, cells: RayCells, counts: wp.array(dtype=wp.int32)):
    """Where each row's rays lie (GPU: 128 threads per row, faces without rays left out), and the table and the edges of rows
    for triangles, unless they are ``tabled``.
    """
    k = wp.tid()
    row = k // 128
    along = cells_in_use(cells.rectangle, cells.cells)
    before = row // along
    face = face_in_use(cells.rectangle, before)
    if face >= 0:
        first = (face * along + row - before * along) * (along + SPARE)
        scan_row(cells.count, cells.offset, first, along, counts, RAYS)
    if not tabled:
        set_table(k, cells.rectangle, cells.table, along)
        set_edges(k, threads, cells, along)


@wp.func
def put_ray(hits: PrimaryHits, pixel: wp.int32, at: wp.vec2i, slot: wp.int32, cells: Any):
    """Put the ray of a pixel in column and row ``at`` where its slot says, if it has one."""
    if slot == -1:
        return
    place = place_in_order(pixel, slot, cells)
    if slot < 0:
        set_entry(cells.rays, place, entry(cells.point, pixel))
    else:
        h = point_of_word(hits, pixel, at)
        set_entry(cells.rays, place, wp.vec4f(h[0], h[1], h[2], wp.cast(pixel, wp.float32)))


@functools.cache
def make_scatter_kernel(slotted: bool) -> wp.Kernel:
    """Rays in cell order: float32 hit point, and the pixel's number in the bits of the fourth. ``slotted``: whether every
    pixel has a slot, also those without a ray.
    """

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def scatter_kernel(
        first: wp.int32, light: wp.int32, hits: PrimaryHits, receivers: wp.array2d(dtype=wp.uint8), cells: RayCells
    ):
        at = tile_pixel(first + wp.tid(), hits.camera.width, hits.camera.height)
        if at[0] < 0:
            return
        pixel = at[1] * hits.camera.width + at[0]
        wanted = wp.bool(True)
        if wp.static(not slotted):
            wanted = has_ray(hits, receivers, light, pixel)
        if wanted:
            put_ray(hits, pixel, at, entry(cells.slot, pixel), cells)

    return scatter_kernel
