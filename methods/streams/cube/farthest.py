"""How far a light's rays go: the farthest receiver in each tile of 8 x 8 cells, and triangles that lie beyond it.

In a room most triangles receive the light or lie behind those that do: no ray goes so far. Depths are distances
from the light along the axis of a face, as float32 whose bits are compared as integers.
"""

import warp as wp

from ....harness.frame.geometry import Corners
from ...common.pixels import tile_threads
from ...gpu.entries import entry
from ...gpu.reserve import raise_to

TILE_SHIFT = wp.constant(3)
"""A tile is 8 cells wide and high: the number of cells along a face is a multiple of that."""

TILE_CELLS = wp.constant(64)

MOST_TILES = wp.constant(32)
"""A triangle over more tiles is not tested: its thread would read them one after the other."""


@wp.func
def tile_index(face: wp.int32, x: wp.int32, y: wp.int32, cells: wp.int32) -> wp.int32:
    """The tile of a cell."""
    along = cells >> TILE_SHIFT
    return (face * along + (y >> TILE_SHIFT)) * along + (x >> TILE_SHIFT)


@wp.func
def empty_tiles(farthest: wp.array(dtype=wp.int32), thread: wp.int32, width: wp.int32, height: wp.int32):
    """No ray yet in any tile; by the threads of an image (:mod:`...common.pixels`)."""
    tile = wp.int32(thread)
    while tile < farthest.shape[0]:
        farthest[tile] = 0
        tile += tile_threads(width, height)


@wp.func
def raise_farthest(
    farthest: wp.array(dtype=wp.int32), face: wp.int32, x: wp.int32, y: wp.int32, along: wp.float32, cells: wp.int32
):
    """A ray in cell (x, y) of a face ends at depth ``along`` > 0."""
    tile = tile_index(face, x, y, cells)
    raise_from(entry(farthest, tile), farthest, tile, along)


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
