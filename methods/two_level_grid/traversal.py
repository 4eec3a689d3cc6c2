"""A ray's walk through both levels, in one loop of steps, so that the lanes of a warp that are in leaf grids stay together.

Each step ends in another cell: of the leaf grid, or of the top grid where the ray leaves its leaf grid or finds none. Both
walks are in the top grid's coordinates; a face of a leaf cell lies at cell + k / res there.
"""

from typing import Any

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.geometry import Mesh
from ..exact.ray_queries import Found, RayPart, nothing_found
from ..grids.grid import cell_index, cell_of
from ..grids.walk import FOREVER, TIE, Walk, advance, enter, inside, next_leave
from ..rays.kernels import make_primary_kernel, make_shadow_kernel
from .leaves import Levels, unpacked_res

REGISTERS = 128
"""Limit per thread on a GPU: the best on balls-40k and balls-300k."""


@wp.struct
class LeafWalk:
    """A walk within one leaf grid.

    first  its first cell; -1: the ray is in no leaf grid     res    cells along each axis; size: 1 / res
    cell   where the ray is                                  leave  when it leaves that cell on each axis
    """

    first: wp.int32
    res: wp.vec3i
    size: wp.vec3d
    cell: wp.vec3i
    leave: wp.vec3d


@wp.func
def leaf_leave(w: Walk, leaf: LeafWalk, axis: wp.int32) -> wp.float64:
    """When the ray leaves its leaf cell along one axis; never, if it does not move along it."""
    if w.step[axis] == 0:
        return FOREVER
    face = leaf.cell[axis]
    if w.step[axis] > 0:
        face += 1
    at = wp.float64(w.cell[axis]) + wp.float64(face) * leaf.size[axis]
    return (at - w.origin[axis]) * w.inverse[axis]


@wp.func
def enter_leaf(w: Walk, at: wp.vec3d, first: wp.int32, res: wp.vec3i) -> LeafWalk:
    """Start in the leaf grid of the top cell that the walk is in, at grid coordinates ``at``."""
    leaf = LeafWalk()
    leaf.first = first
    leaf.res = res
    for axis in range(wp.static(3)):
        leaf.size[axis] = wp.float64(1.0) / wp.float64(res[axis])
        within = (at[axis] - wp.float64(w.cell[axis])) * wp.float64(res[axis])
        leaf.cell[axis] = cell_of(within, res[axis])
        leaf.leave[axis] = leaf_leave(w, leaf, axis)
    return leaf


@wp.func
def leaf_advance(w: Walk, leaf: LeafWalk) -> LeafWalk:
    """Step across the face that is reached first, the lower axis where two are."""
    axis = wp.int32(2)
    if leaf.leave[0] <= leaf.leave[1] and leaf.leave[0] <= leaf.leave[2]:
        axis = 0
    elif leaf.leave[1] <= leaf.leave[2]:
        axis = 1
    leaf.cell[axis] = leaf.cell[axis] + w.step[axis]
    leaf.leave[axis] = leaf_leave(w, leaf, axis)
    return leaf


@wp.func
def walk(test: wp.Function, levels: Levels, mesh: Mesh, alpha: Alpha, part: RayPart, query: Any) -> Found:
    """Call ``test`` for the triangles in the leaf cells of a ray: see :mod:`..rays.kernels`.

    The walk ends behind the closest hit and all that may tie with it, or when ``test`` sets ``found.done``.
    """
    found = nothing_found(wp.INF)
    grid = levels.grid[0]
    way = wp.cw_mul(part.direction, grid.scale)
    w = enter(grid, part)
    leaf = LeafWalk()
    leaf.first = -1
    entered = w.start
    going = w.start <= w.end
    while going:
        if leaf.first < 0:
            cell = cell_index(grid.res, w.cell[0], w.cell[1], w.cell[2])
            first = levels.first[cell]
            if first >= 0:
                leaf = enter_leaf(w, w.origin + way * entered, first, unpacked_res(levels.res[cell]))
        leave = next_leave(w)
        left = leaf.first < 0
        if leaf.first >= 0:
            at = leaf.first + cell_index(leaf.res, leaf.cell[0], leaf.cell[1], leaf.cell[2])
            for k in range(levels.leaf.begin[at], levels.leaf.end[at]):
                i = levels.leaf.values[k]
                if i != part.own and not found.done:
                    found.tests += 1
                    found = test(mesh, alpha, i, query, found)
            leaf_end = wp.min(leaf.leave[0], wp.min(leaf.leave[1], leaf.leave[2]))
            leave = wp.min(leave, leaf_end)
            if leaf_end < FOREVER:
                leaf = leaf_advance(w, leaf)
                left = not inside(leaf.cell, leaf.res)
        if found.done or leave > wp.min(found.t * TIE, part.end) + w.margin or leave == FOREVER:
            going = False
        elif left:
            leaf.first = -1
            entered = next_leave(w)
            w = advance(w)
            going = inside(w.cell, grid.res)
    return found


def make_kernels() -> tuple[wp.Kernel, wp.Kernel]:
    """The kernels of primary rays and of shadow rays."""
    return make_primary_kernel(Levels, walk, REGISTERS), make_shadow_kernel(Levels, walk, REGISTERS)
