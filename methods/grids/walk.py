"""Amanatides & Woo (1987) through a grid in float64.

The distance to the next face along each axis is computed from the cell's index and is not accumulated, so that its
error does not grow along the ray. A direction component of zero, of either sign, never steps. Each step leaves one
cell for good, so that a ray ends after at most as many steps as there are cells along the three axes.
"""

import warp as wp

from ..exact.ray_queries import RayPart
from ..exact.triangle import largest
from .grid import Grid, cell_of, to_grid

FOREVER = wp.constant(wp.float64(wp.inf))
TIE = wp.constant(wp.float64(1.0 + 2.0**-28))  # hits this close may be a tie: see nearer
STOP_MARGIN = wp.constant(wp.float64(2.0**-10))  # cells: how far beyond a hit the search continues


@wp.struct
class Walk:
    """A ray in the grid: origin and direction in grid coordinates, the cell, and when it leaves it on each axis.

    end     when the ray leaves the grid or its segment; a walk that misses the grid has start > end
    margin  STOP_MARGIN cells, as a distance along the ray
    """

    origin: wp.vec3d
    inverse: wp.vec3d
    cell: wp.vec3i
    step: wp.vec3i
    leave: wp.vec3d
    start: wp.float64
    end: wp.float64
    margin: wp.float64


@wp.func
def clipped(g: wp.float64, d: wp.float64, res: wp.int32, interval: wp.vec2d) -> wp.vec2d:
    """The part of a ray's interval in which 0 <= g + t d <= res; (1, 0) where there is none."""
    far = wp.float64(res)
    if d == wp.float64(0.0):
        if g < wp.float64(0.0) or g > far:
            return wp.vec2d(wp.float64(1.0), wp.float64(0.0))
        return interval
    t0 = -g / d
    t1 = (far - g) / d
    return wp.vec2d(wp.max(interval[0], wp.min(t0, t1)), wp.min(interval[1], wp.max(t0, t1)))


@wp.func
def direction_step(d: wp.float64) -> wp.int32:
    if d > wp.float64(0.0):
        return 1
    if d < wp.float64(0.0):
        return -1
    return 0


@wp.func
def inverse_of(d: wp.float64) -> wp.float64:
    if d == wp.float64(0.0):
        return wp.float64(0.0)
    return wp.float64(1.0) / d


@wp.func
def leave_time(cell: wp.int32, step: wp.int32, origin: wp.float64, inverse: wp.float64) -> wp.float64:
    """When the ray leaves the cell along one axis; never, if it does not move along it."""
    if step == 0:
        return FOREVER
    face = cell
    if step > 0:
        face = cell + 1
    return (wp.float64(face) - origin) * inverse


@wp.func
def enter(grid: Grid, part: RayPart) -> Walk:
    """Start along a ray."""
    w = Walk()
    g = to_grid(grid, part.start)
    gd = wp.cw_mul(part.direction, grid.scale)
    interval = wp.vec2d(wp.float64(0.0), part.end)
    interval = clipped(g[0], gd[0], grid.res[0], interval)
    interval = clipped(g[1], gd[1], grid.res[1], interval)
    interval = clipped(g[2], gd[2], grid.res[2], interval)
    w.start = interval[0]
    w.end = interval[1]
    w.origin = g
    w.inverse = wp.vec3d(inverse_of(gd[0]), inverse_of(gd[1]), inverse_of(gd[2]))
    w.margin = STOP_MARGIN * inverse_of(largest(gd))
    w.step = wp.vec3i(direction_step(gd[0]), direction_step(gd[1]), direction_step(gd[2]))
    if w.start <= w.end:
        p = g + gd * w.start
        w.cell = wp.vec3i(cell_of(p[0], grid.res[0]), cell_of(p[1], grid.res[1]), cell_of(p[2], grid.res[2]))
        w.leave = wp.vec3d(
            leave_time(w.cell[0], w.step[0], g[0], w.inverse[0]),
            leave_time(w.cell[1], w.step[1], g[1], w.inverse[1]),
            leave_time(w.cell[2], w.step[2], g[2], w.inverse[2]),
        )
    return w


@wp.func
def next_leave(w: Walk) -> wp.float64:
    return wp.min(w.leave[0], wp.min(w.leave[1], w.leave[2]))


@wp.func
def inside(cell: wp.vec3i, res: wp.vec3i) -> wp.bool:
    return (
        cell[0] >= 0 and cell[1] >= 0 and cell[2] >= 0
        and cell[0] < res[0] and cell[1] < res[1] and cell[2] < res[2]
    )  # fmt: skip


@wp.func
def advance(w: Walk) -> Walk:
    """Step into the next cell: across the face that is reached first, the lower axis where two are."""
    if w.leave[0] <= w.leave[1] and w.leave[0] <= w.leave[2]:
        w.cell[0] = w.cell[0] + w.step[0]
        w.leave[0] = leave_time(w.cell[0], w.step[0], w.origin[0], w.inverse[0])
    elif w.leave[1] <= w.leave[2]:
        w.cell[1] = w.cell[1] + w.step[1]
        w.leave[1] = leave_time(w.cell[1], w.step[1], w.origin[1], w.inverse[1])
    else:
        w.cell[2] = w.cell[2] + w.step[2]
        w.leave[2] = leave_time(w.cell[2], w.step[2], w.origin[2], w.inverse[2])
    return w
