"""A ray's walk through the cells of one grid, and the kernels that trace rays by it."""

from typing import Any

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.geometry import Mesh
from ..exact.ray_queries import Found, RayPart, nothing_found
from ..rays.kernels import make_primary_kernel, make_shadow_kernel
from .binning import Pairs
from .grid import Grid, cell_index
from .walk import FOREVER, TIE, advance, enter, inside, next_leave

REGISTERS = 64
"""Limit per thread on a GPU: the best on balls-40k and balls-300k."""


@wp.struct
class Cells:
    """A grid [1] and the triangles of each cell."""

    grid: wp.array(dtype=Grid)
    lists: Pairs


@wp.func
def walk(test: wp.Function, cells: Cells, mesh: Mesh, alpha: Alpha, part: RayPart, query: Any) -> Found:
    """Call ``test`` for the triangles in the cells of a ray: see :mod:`..rays.kernels`.

    The walk ends behind the closest hit and all that may tie with it, or when ``test`` sets ``found.done``.
    """
    found = nothing_found(wp.INF)
    grid = cells.grid[0]
    w = enter(grid, part)
    going = w.start <= w.end
    while going:
        cell = cell_index(grid.res, w.cell[0], w.cell[1], w.cell[2])
        for k in range(cells.lists.begin[cell], cells.lists.end[cell]):
            i = cells.lists.values[k]
            if i != part.own and not found.done:
                found.tests += 1
                found = test(mesh, alpha, i, query, found)
        leave = next_leave(w)
        if found.done or leave > wp.min(found.t * TIE, part.end) + w.margin or leave == FOREVER:
            going = False
        else:
            w = advance(w)
            going = inside(w.cell, grid.res)
    return found


def make_kernels() -> tuple[wp.Kernel, wp.Kernel]:
    """The kernels of primary rays and of shadow rays."""
    return make_primary_kernel(Cells, walk, REGISTERS), make_shadow_kernel(Cells, walk, REGISTERS)
