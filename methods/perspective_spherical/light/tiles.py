"""The light grid (paper, section 4.1): triangles in tiles of a light's rectangles and slices of distance.

A tile of a triangle's box (:mod:`.light.bounds`) is left out only if it certainly misses the triangle
(:func:`~.light.tile_edges.missed`), or if no shadow ray lies in it.
"""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Mesh, corners_of
from ...common.reserve import reserve_many
from ..lists.binning import PairSink, piece_of, write_pair
from .bounds import LitTriangle, lit_triangle
from .frame import distance_slice
from .tile_edges import missed, slope_bounds


@wp.struct
class LightTiles:
    """The grid: rectangles, tiles along a side of one, slices; edges of the tiles (:mod:`.light.tile_edges`).

    spans       lists in every slice that a triangle spans, not only in the first
    skip_empty  no pair where no ray lies: ``deepest`` is the last slice that a ray of the tile reaches
    """

    faces: wp.int32
    tiles: wp.int32
    slices: wp.int32
    spans: wp.bool
    skip_empty: wp.bool
    extent: wp.array(dtype=wp.float64)
    columns: wp.array(dtype=wp.vec4d)
    rows: wp.array(dtype=wp.vec4d)
    stretch: wp.array(dtype=wp.vec2d)
    deepest: wp.array(dtype=wp.int32)


@wp.func
def narrowed(
    s: LitTriangle,
    span: wp.vec2i,
    column: wp.vec4d,
    row: wp.vec4d,
    stretch: wp.vec2d,
    extent: wp.array(dtype=wp.float64),
    side: wp.int32,
    slices: wp.int32,
) -> wp.vec2i:
    """The slices of ``span`` that the triangle may lie in within one tile, from its plane."""
    if s.slope < wp.float64(0.0) or span[0] == span[1]:
        return span
    slope = slope_bounds(column, row, s.n, stretch)
    first = span[0]
    last = span[1]
    if slope[2] > wp.float64(0.0):
        error = slope[2] * slope[2] * s.slope  # see ``missed``
        near = wp.float64(0.999) * s.height / (slope[1] + error)
        if slope[1] > wp.float64(0.0):
            first = wp.max(first, wp.min(last, distance_slice(near, extent, side, slices)))
        if slope[0] > wp.float64(2.0) * error:
            far = wp.float64(1.001) * s.height * slope[2] / (slope[0] - error)
            last = wp.max(first, wp.min(last, distance_slice(far, extent, side, slices)))
    return wp.vec2i(first, last)


@wp.func
def slices_in_tile(
    g: LightTiles,
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
    tile = (side * g.tiles + row) * g.tiles + column
    deepest = g.slices - 1
    if g.skip_empty:
        deepest = g.deepest[tile]
        if deepest < span[0]:
            return wp.vec2i(0, -1)
    edges = g.rows[side * g.tiles + row]
    between = g.columns[side * g.tiles + column]
    if test and missed(between, edges, g.stretch[side], s.n0, s.n1, s.n2, s.error):
        return wp.vec2i(0, -1)
    here = narrowed(s, span, between, edges, g.stretch[side], g.extent, side, g.slices)
    last = here[0]
    if g.spans:
        last = here[1]
    return wp.vec2i(here[0], wp.min(last, deepest))


@wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=80)
def bin_kernel(
    g: LightTiles,
    lanes: wp.int32,
    index: wp.int32,
    widening: wp.float64,
    pads: wp.array(dtype=wp.float64),
    lights: wp.array(dtype=wp.vec3f),
    frame: wp.array(dtype=wp.mat33d),
    mesh: Mesh,
    boxes: wp.array(dtype=wp.vec4i),
    spans: wp.array(dtype=wp.vec2i),
    queue: wp.array(dtype=wp.vec2i),
    out: PairSink,
):
    """Write the pairs of one piece of work: count them, reserve their places, find them again."""
    p = piece_of(wp.tid(), lanes, boxes, queue, out.needs[out.slot + 1])
    if p.item < 0:
        return
    span = spans[p.item]
    triangle = p.item // g.faces
    side = p.item % g.faces
    single = boxes[p.item][0] == boxes[p.item][2] and boxes[p.item][1] == boxes[p.item][3]
    s = LitTriangle()
    s.slope = wp.float64(-1.0)
    # One tile needs no test; one slice needs no plane.
    if span[0] < span[1] or not single:
        s = lit_triangle(lights[index], frame[0], side, widening, pads[0], corners_of(mesh, triangle))
    test = s.oriented and not single
    number = wp.int32(0)
    hits = wp.int32(0)
    kept_at = wp.int32(-1)
    kept = wp.vec2i(0, -1)
    for at in range(p.first, p.stop, p.step):
        found = slices_in_tile(g, s, span, side, p.x + at % p.w, p.y + at // p.w, test)
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
                found = slices_in_tile(g, s, span, side, column, row, False)
            cell = ((side * g.tiles + row) * g.tiles + column) * g.slices
            for slice in range(found[0], found[1] + 1):
                write_pair(place, cell + slice, triangle, out)
                place += wp.int64(1)
