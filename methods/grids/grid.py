"""Where the grid lies: its box, its resolution and how much its cells must overlap, decided on the device.

Everything is in grid coordinates, where a cell is a unit cube: g = (p - origin) * scale, in float64. A position on
a ray is then known to 2^-49 of the largest grid coordinate involved (a difference, a product, a quotient and a
product again, each rounded at 2^-53). ``slack`` is more than that bound: the traversal passes within ``slack`` of
every point of its ray, and triangles are binned into every cell that comes within twice ``slack`` of them. So no ray
can slip between the cells of a triangle, through a corner or along a face.
"""

import warp as wp

from ..common.axes import longest_axis
from ..common.bounds import box_high, box_low
from ..exact.triangle import largest, to_float64

FINEST_SLACK = wp.constant(wp.float64(2.0**-16))
ROUNDING = wp.constant(wp.float64(2.0**-46))
COARSEST_SLACK = wp.constant(wp.float64(2.0**-5))
FLATTEST = wp.constant(wp.float64(2.0**-10))  # a box flatter than this, against its longest side, gets one layer


@wp.struct
class Grid:
    """origin, scale vec3d: grid coordinates are (p - origin) * scale. res: cells along x, y, z. slack: in cells."""

    origin: wp.vec3d
    scale: wp.vec3d
    res: wp.vec3i
    slack: wp.float64


@wp.func
def at_least_one(x: wp.float64, most: wp.int32) -> wp.int32:
    """floor(x), between 1 and ``most``."""
    return wp.int32(wp.clamp(wp.floor(x), wp.float64(1.0), wp.float64(most)))


@wp.func
def cell_counts(extent: wp.vec3d, cells: wp.int32) -> wp.vec3i:
    """Cells along each axis: nearly cubes, and never more than ``cells`` in all.

    Cleary & Wyvill's rule, res = extent * cbrt(cells / volume), taken from the shortest axis to the longest with
    what is left over each time, so that a flat or a long box keeps its number of cells.
    """
    last = longest_axis(extent)
    first = (last + 1) % 3  # the shortest of the other two
    middle = (last + 2) % 3
    if extent[middle] < extent[first]:
        middle = first
        first = 3 - last - middle
    longest = extent[last]
    count = wp.float64(cells)
    shortest = extent[first]
    second = extent[middle]
    n_first = wp.int32(1)
    if shortest > FLATTEST * longest:
        side = wp.pow(count / (shortest * second * longest), wp.float64(1.0) / wp.float64(3.0))
        n_first = at_least_one(shortest * side, cells)
    left = count / wp.float64(n_first)
    n_middle = wp.int32(1)
    if second > FLATTEST * longest:
        n_middle = at_least_one(wp.min(left, second * wp.sqrt(left / (second * longest))), cells)
    n_last = at_least_one(wp.floor(left) / wp.float64(n_middle), cells)
    res = wp.vec3i(1, 1, 1)
    res[first] = n_first
    res[middle] = n_middle
    res[last] = n_last
    return res


@wp.kernel(enable_backward=False)
def place_grid_kernel(
    cells: wp.int32, box: wp.array(dtype=wp.float32), bound: wp.array(dtype=wp.float32), grid: wp.array(dtype=Grid)
):
    """Place the grid around ``box``; one thread. Where nothing is valid, one cell around the origin."""
    g = Grid()
    g.res = wp.vec3i(1, 1, 1)
    one = wp.float64(1.0)
    half = wp.float64(0.5)
    g.origin = wp.vec3d(-half, -half, -half)
    g.scale = wp.vec3d(one, one, one)
    g.slack = FINEST_SLACK
    low = to_float64(box_low(box))
    high = to_float64(box_high(box))
    if low[0] <= high[0]:
        extent = high - low
        g.res = cell_counts(extent, cells)
        flat = FLATTEST * largest(extent)
        extent = wp.vec3d(wp.max(extent[0], flat), wp.max(extent[1], flat), wp.max(extent[2], flat))
        count = wp.vec3d(wp.float64(g.res[0]), wp.float64(g.res[1]), wp.float64(g.res[2]))
        middle = (low + high) * half
        # The rounding of rays is proportional to the distance of the eye in cells.
        off = wp.float64(bound[0]) + largest(middle)
        distance = off * largest(wp.cw_div(count, extent))
        g.slack = wp.min(FINEST_SLACK + ROUNDING * (distance + largest(count)), COARSEST_SLACK)
        # Every triangle lies further than the slack from the outer faces.
        margin = wp.float64(4.0) * g.slack
        inner = count - wp.vec3d(margin, margin, margin) * wp.float64(2.0)
        g.scale = wp.cw_div(inner, extent)
        g.origin = middle - wp.cw_div(count * half, g.scale)
    grid[0] = g


@wp.func
def to_grid(grid: Grid, p: wp.vec3d) -> wp.vec3d:
    return wp.cw_mul(p - grid.origin, grid.scale)


@wp.func
def cell_index(res: wp.vec3i, x: wp.int32, y: wp.int32, z: wp.int32) -> wp.int32:
    return (z * res[1] + y) * res[0] + x


@wp.func
def cell_of(g: wp.float64, res: wp.int32) -> wp.int32:
    """The cell of a grid coordinate, clamped to the grid."""
    return wp.int32(wp.clamp(wp.floor(g), wp.float64(0.0), wp.float64(res - 1)))
