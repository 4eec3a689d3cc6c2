"""The light grid (paper, section 4.1): triangles in tiles of a light's rectangles and slices of distance.

A tile of a triangle's box (:mod:`.light.bounds`) is left out only if it certainly misses the triangle
(:func:`~.light.tile_edges.missed`), or if no shadow ray lies in it.
"""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Mesh, corners_of
from ...gpu.reserve import reserve_many
from ..lists.binning import PairSink, PieceQueue, piece_of, write_pair
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


@wp.func
def slices_in_tile(
    grid: LightTiles,
    s: LitTriangle,
    span: wp.vec2i,
    side: wp.int32,
    column: wp.int32,
    row: wp.int32,
    test: wp.bool,
) -> wp.vec2i:
    """First and last slice that an item is listed in within a tile; last < first where it is left out.

    test: whether the tile may miss the item, which is in doubt unless it is the only one, or was found to hold it
    """
    tile = (side * grid.tiles + row) * grid.tiles + column
    deepest = grid.slices - 1
    if grid.skip_empty:
        deepest = grid.deepest[tile]
        if deepest < span[0]:
            return wp.vec2i(0, -1)
    edges = grid.rows[side * grid.tiles + row]
    between = grid.columns[side * grid.tiles + column]
    if test and missed(between, edges, grid.stretch[side], s.n0, s.n1, s.n2, s.error):
        return wp.vec2i(0, -1)
    here = narrowed(grid, s, span, side, between, edges)
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
    """Write the pairs of one piece of work: count them, reserve their places, find them again."""
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
    test = s.oriented and not single
    number = wp.int32(0)
    hits = wp.int32(0)
    kept_at = wp.int32(-1)
    kept = wp.vec2i(0, -1)
    for at in range(p.first, p.stop, p.step):
        found = slices_in_tile(grid, s, span, side, p.x + at % p.w, p.y + at // p.w, test)
        if found[1] >= found[0]:
            number += found[1] - found[0] + 1
            hits = hits | (1 << ((at - p.first) // p.step))
            kept_at = at
            kept = found
    if number == 0:
        return
    place = reserve_many(out.needs, out.slot, number)
    for at in range(p.first, p.stop, p.step):
        if (hits >> ((at - p.first) // p.step)) & 1 != 0:
            column = p.x + at % p.w
            row = p.y + at // p.w
            found = kept
            if at != kept_at:
                found = slices_in_tile(grid, s, span, side, column, row, False)
            cell = ((side * grid.tiles + row) * grid.tiles + column) * grid.slices
            for slice in range(found[0], found[1] + 1):
                write_pair(place, cell + slice, triangle, out)
                place += wp.int64(1)
