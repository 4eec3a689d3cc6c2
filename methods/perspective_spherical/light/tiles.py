"""The light grid (paper, section 4.1): triangles in tiles of a light's rectangles and slices of distance.

A tile of a triangle's box (:mod:`.light.bounds`) is left out only if it certainly misses the triangle
(:func:`~.light.tile_edges.missed`), or if no shadow ray lies in it.
"""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Mesh, corners_of
from ..lists.binning import PieceQueue, piece_of, write_pairs
from ..lists.sorting import PairSink
from .bounds import LitTriangle, lit_triangle
from .space import LightSpace, LightTiles, distance_slice
from .tile_edges import missed, slope_bounds


@wp.func
def narrowed(
    grid: LightTiles, s: LitTriangle, span: wp.vec2i, side: wp.int32, column: wp.vec4d, row: wp.vec4d
) -> wp.vec2i:
    """The slices of ``span`` that the triangle may lie in within one tile, from its plane."""
    if s.slope < wp.float64(0.0) or span[0] == span[1]:
        return span
    slope = slope_bounds(column, row, s.n, grid.stretch[side])
    first = span[0]
    last = span[1]
    if slope[2] > wp.float64(0.0):
        error = slope[2] * slope[2] * s.slope  # see ``missed``
        near = wp.float64(0.999) * s.height / (slope[1] + error)
        if slope[1] > wp.float64(0.0):
            first = wp.max(first, wp.min(last, distance_slice(near, grid, side)))
        if slope[0] > wp.float64(2.0) * error:
            far = wp.float64(1.001) * s.height * slope[2] / (slope[0] - error)
            last = wp.max(first, wp.min(last, distance_slice(far, grid, side)))
    return wp.vec2i(first, last)


@wp.struct
class LightItem:
    """An item that is put into the tiles of rectangle ``side``.

    span  slices that it may lie in     test  whether a tile of its box may miss it
    """

    grid: LightTiles
    s: LitTriangle
    span: wp.vec2i
    side: wp.int32
    test: wp.bool


@wp.func
def slices_in_tile(item: LightItem, column: wp.int32, row: wp.int32, known: wp.bool) -> wp.vec2i:
    """First and last slice that an item is listed in within a tile; last < first where it is left out."""
    grid = item.grid
    side = item.side
    s = item.s
    tile = (side * grid.tiles + row) * grid.tiles + column
    deepest = grid.slices - 1
    if grid.skip_empty:
        deepest = grid.deepest[tile]
        if deepest < item.span[0]:
            return wp.vec2i(0, -1)
    edges = grid.rows[side * grid.tiles + row]
    between = grid.columns[side * grid.tiles + column]
    if item.test and not known and missed(between, edges, grid.stretch[side], s.n0, s.n1, s.n2, s.error):
        return wp.vec2i(0, -1)
    here = narrowed(grid, s, item.span, side, between, edges)
    last = here[0]
    if grid.spans:
        last = here[1]
    return wp.vec2i(here[0], wp.min(last, deepest))


@wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=80)
def bin_kernel(
    widening: wp.float64,
    space: LightSpace,
    grid: LightTiles,
    mesh: Mesh,
    boxes: wp.array(dtype=wp.vec4i),
    spans: wp.array(dtype=wp.vec2i),
    queue: PieceQueue,
    out: PairSink,
):
    """Write the pairs of one piece of work (:func:`..lists.binning.write_pairs`)."""
    p = piece_of(wp.tid(), boxes, queue)
    if p.item < 0:
        return
    span = spans[p.item]
    triangle = p.item // grid.faces
    side = p.item % grid.faces
    single = boxes[p.item][0] == boxes[p.item][2] and boxes[p.item][1] == boxes[p.item][3]
    s = LitTriangle()
    s.slope = wp.float64(-1.0)
    # One tile needs no test; one slice needs no plane.
    if span[0] < span[1] or not single:
        s = lit_triangle(space, side, widening, corners_of(mesh, triangle))
    item = LightItem(grid, s, span, side, s.oriented and not single)
    first = wp.vec2i(side * grid.tiles * grid.tiles, grid.tiles)
    write_pairs(slices_in_tile, item, p, first, grid.slices, triangle, out)
