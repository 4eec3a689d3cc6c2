"""The second level: a grid in each occupied cell of the top grid, with a resolution that its own triangles ask for.

A leaf grid is a :class:`..grids.grid.Grid`, so triangles are binned into it by the same code. Its slack covers that of
the top grid: a ray passes within the top grid's slack of every point of it in the top cells that it visits, and that is
res times as much in cells of the leaf grid. The same factor holds for rounding.
"""

import warp as wp

from ...harness.frame.geometry import Mesh
from ..grids.binning import BinItem, Pairs
from ..grids.grid import Grid, cell_counts

FINEST_LEAF = wp.constant(1024)
"""Leaf cells along an axis at most: what ten bits hold, and a slack of 2^-5 of a leaf cell or less near the scene."""

EMPTY_CELL = wp.constant(-1)


@wp.struct
class Levels:
    """Both levels.

    grid   Grid [1]: the top grid             cells  number of top cells that there is room for
    top, leaf  the triangles of each top cell and of each leaf cell
    res    int32 [top cells]: leaf resolution, :func:`packed_res`
    first  int32 [top cells]: the first leaf cell, EMPTY_CELL where the cell is empty
    counts, scan  int64 [top cells]: leaf cells of each top cell, and their inclusive scan
    """

    grid: wp.array(dtype=Grid)
    cells: wp.int32
    top: Pairs
    leaf: Pairs
    res: wp.array(dtype=wp.int32)
    first: wp.array(dtype=wp.int32)
    counts: wp.array(dtype=wp.int64)
    scan: wp.array(dtype=wp.int64)


@wp.func
def packed_res(res: wp.vec3i) -> wp.int32:
    """Three numbers of 1 to FINEST_LEAF in 30 bits."""
    return (res[0] - 1) | ((res[1] - 1) << 10) | ((res[2] - 1) << 20)


@wp.func
def unpacked_res(packed: wp.int32) -> wp.vec3i:
    return wp.vec3i((packed & 1023) + 1, ((packed >> 10) & 1023) + 1, ((packed >> 20) & 1023) + 1)


@wp.func
def leaf_grid(top: Grid, cell: wp.int32, res: wp.vec3i) -> Grid:
    """The grid of ``res`` cells in a cell of the top grid."""
    row = cell // top.res[0]
    place = wp.vec3d(wp.float64(cell - row * top.res[0]), wp.float64(row % top.res[1]), wp.float64(row // top.res[1]))
    finer = wp.vec3d(wp.float64(res[0]), wp.float64(res[1]), wp.float64(res[2]))
    leaf = Grid()
    leaf.origin = top.origin + wp.cw_div(place, top.scale)
    leaf.scale = wp.cw_mul(top.scale, finer)
    leaf.res = res
    leaf.slack = wp.float64(2.0) * top.slack * wp.max(finer[0], wp.max(finer[1], finer[2]))
    return leaf


@wp.kernel(enable_backward=False)
def resolution_kernel(density: wp.float64, levels: Levels):
    """The resolution of each cell's leaf grid, ``density`` cells per triangle, and its number of cells."""
    cell = wp.tid()
    held = levels.top.end[cell] - levels.top.begin[cell]
    if held == 0:
        levels.counts[cell] = wp.int64(0)
        return
    wanted = wp.max(1, wp.int32(wp.float64(held) * density))
    one = wp.vec3d(wp.float64(1.0), wp.float64(1.0), wp.float64(1.0))
    res = cell_counts(wp.cw_div(one, levels.grid[0].scale), wanted)
    res = wp.min(res, wp.vec3i(FINEST_LEAF, FINEST_LEAF, FINEST_LEAF))
    levels.res[cell] = packed_res(res)
    levels.counts[cell] = wp.int64(res[0] * res[1] * res[2])


@wp.kernel(enable_backward=False)
def first_kernel(levels: Levels):
    """Where the cells of each leaf grid begin."""
    cell = wp.tid()
    first = wp.int32(EMPTY_CELL)
    if levels.counts[cell] > wp.int64(0):
        first = wp.int32(levels.scan[cell] - levels.counts[cell])
    levels.first[cell] = first


@wp.func
def leaf_item(levels: Levels, mesh: Mesh, item: wp.int32) -> BinItem:
    """The triangle of a top pair, into the leaf grid of its cell."""
    cell = levels.top.keys[item]
    what = BinItem()
    what.triangle = -1
    if cell < levels.cells:
        what.grid = leaf_grid(levels.grid[0], cell, unpacked_res(levels.res[cell]))
        what.base = levels.first[cell]
        what.triangle = levels.top.values[item]
    return what
