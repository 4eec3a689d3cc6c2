"""Which cells a triangle is binned into: all that come within twice the grid's slack of it, and few others.

The overlap test is Schwarz & Seidel's (2010, "Fast Parallel Surface and Solid Voxelization"): the triangle's three
projections against the projected cell, and its plane against the cell; with the cells grown by the slack. Columns along
the axis that the triangle faces most are cut to the cells that its plane passes, so that the work is proportional to the
triangle's area and not to the volume of its box. Normals and planes whose direction rounding could change are left out of
the test.

Counting and emitting run the same kernels (:mod:`.pairs`), because two kernels may round differently.
"""

from typing import Any

import warp as wp

from ...harness.frame.geometry import Corners
from ..exact.triangle import largest, to_float64
from .grid import Grid, cell_index, cell_of, to_grid

LARGE_COLUMNS = wp.constant(256)
"""A triangle whose box has more columns of cells than this is binned by many threads."""

UNSURE = wp.constant(wp.float64(2.0**-48))  # of |e1| |e2|: below it a normal's sign may be rounding


@wp.struct
class Span:
    """A triangle in grid coordinates, turned so that z is the axis it faces most.

    axis             which axis z is
    low, high        first and last cell of its box, turned
    a, b, c          vertices                 ab, bc, ca  edges, each to 2^-51 of itself
    sign             orientation in the projections along x, y, z; 0 = not sure, the projection is not tested
    n                normal                   level       whether the plane is known well enough to cut columns
    half             half a cell and twice the slack
    """

    axis: wp.int32
    low: wp.vec3i
    high: wp.vec3i
    a: wp.vec3d
    b: wp.vec3d
    c: wp.vec3d
    ab: wp.vec3d
    bc: wp.vec3d
    ca: wp.vec3d
    sign: wp.vec3d
    n: wp.vec3d
    level: wp.bool
    half: wp.float64


@wp.func
def turned(v: Any, axis: wp.int32) -> Any:
    """Coordinates turned cyclically so that ``axis`` comes last."""
    if axis == 0:
        return type(v)(v[1], v[2], v[0])
    if axis == 1:
        return type(v)(v[2], v[0], v[1])
    return v


@wp.func
def index_of(res: wp.vec3i, axis: wp.int32, x: wp.int32, y: wp.int32, z: wp.int32) -> wp.int32:
    """The cell at turned coordinates."""
    if axis == 0:
        return cell_index(res, z, x, y)
    if axis == 1:
        return cell_index(res, y, z, x)
    return cell_index(res, x, y, z)


@wp.func
def sure_sign(x: wp.float64, bound: wp.float64) -> wp.float64:
    if x > bound:
        return wp.float64(1.0)
    if x < -bound:
        return wp.float64(-1.0)
    return wp.float64(0.0)


@wp.func
def span_of(grid: Grid, corners: Corners) -> Span:
    """Set a triangle up for :func:`column_cells` and :func:`touches`."""
    s = Span()
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    a = to_grid(grid, a64)
    b = to_grid(grid, b64)
    c = to_grid(grid, c64)
    # Edges from the exact vertices: differences of grid coordinates would be rounded at the grid's size.
    ab = wp.cw_mul(b64 - a64, grid.scale)
    bc = wp.cw_mul(c64 - b64, grid.scale)
    ca = wp.cw_mul(a64 - c64, grid.scale)
    n = wp.cross(ab, -ca)
    s.axis = wp.int32(2)
    if wp.abs(n[0]) > wp.abs(n[1]) and wp.abs(n[0]) > wp.abs(n[2]):
        s.axis = 0
    elif wp.abs(n[1]) > wp.abs(n[2]):
        s.axis = 1
    s.a = turned(a, s.axis)
    s.b = turned(b, s.axis)
    s.c = turned(c, s.axis)
    s.ab = turned(ab, s.axis)
    s.bc = turned(bc, s.axis)
    s.ca = turned(ca, s.axis)
    s.n = turned(n, s.axis)
    product = largest(ab) * largest(ca)
    s.sign = wp.vec3d(
        sure_sign(s.n[0], UNSURE * product), sure_sign(s.n[1], UNSURE * product), sure_sign(s.n[2], UNSURE * product)
    )
    # Rounding tilts the plane by UNSURE * product / n: over the triangle and a cell that must stay below the slack.
    reach = wp.max(largest(ab), wp.max(largest(bc), largest(ca))) + wp.float64(4.0)
    s.level = wp.abs(s.n[2]) * grid.slack > UNSURE * product * reach
    grow = wp.float64(2.0) * grid.slack
    s.half = wp.float64(0.5) + grow
    low = wp.min(s.a, wp.min(s.b, s.c))
    high = wp.max(s.a, wp.max(s.b, s.c))
    res = turned(grid.res, s.axis)
    s.low = wp.vec3i(cell_of(low[0] - grow, res[0]), cell_of(low[1] - grow, res[1]), cell_of(low[2] - grow, res[2]))
    s.high = wp.vec3i(cell_of(high[0] + grow, res[0]), cell_of(high[1] + grow, res[1]), cell_of(high[2] + grow, res[2]))
    return s


@wp.func
def centre(cell: wp.int32) -> wp.float64:
    return wp.float64(cell) + wp.float64(0.5)


@wp.func
def edge_reaches(
    ep: wp.float64, eq: wp.float64, p: wp.float64, q: wp.float64, sign: wp.float64, half: wp.float64
) -> wp.bool:
    """Whether a square around the origin reaches the inner side of the projected edge through (-p, -q)."""
    return sign * (ep * q - eq * p) + half * (wp.abs(ep) + wp.abs(eq)) >= wp.float64(0.0)


@wp.func
def column_cells(s: Span, x: wp.int32, y: wp.int32) -> wp.vec2i:
    """First and last cell of a column that the triangle's plane may pass; first > last if it misses the column."""
    cx = centre(x)
    cy = centre(y)
    if not (
        edge_reaches(s.ab[0], s.ab[1], cx - s.a[0], cy - s.a[1], s.sign[2], s.half)
        and edge_reaches(s.bc[0], s.bc[1], cx - s.b[0], cy - s.b[1], s.sign[2], s.half)
        and edge_reaches(s.ca[0], s.ca[1], cx - s.c[0], cy - s.c[1], s.sign[2], s.half)
    ):
        return wp.vec2i(1, 0)
    if not s.level:
        return wp.vec2i(s.low[2], s.high[2])
    z = s.a[2] - (s.n[0] * (cx - s.a[0]) + s.n[1] * (cy - s.a[1])) / s.n[2]
    reach = s.half * (wp.abs(s.n[0]) + wp.abs(s.n[1])) / wp.abs(s.n[2]) + (s.half - wp.float64(0.5))
    return wp.vec2i(
        wp.max(s.low[2], wp.int32(wp.floor(wp.max(z - reach, wp.float64(s.low[2]))))),
        wp.min(s.high[2], wp.int32(wp.floor(wp.min(z + reach, wp.float64(s.high[2]))))),
    )


@wp.func
def touches(s: Span, x: wp.int32, y: wp.int32, z: wp.int32) -> wp.bool:
    """The projections along x and y; that along z and the plane were :func:`column_cells`'s."""
    cx = centre(x)
    cy = centre(y)
    cz = centre(z)
    return (
        edge_reaches(s.ab[1], s.ab[2], cy - s.a[1], cz - s.a[2], s.sign[0], s.half)
        and edge_reaches(s.bc[1], s.bc[2], cy - s.b[1], cz - s.b[2], s.sign[0], s.half)
        and edge_reaches(s.ca[1], s.ca[2], cy - s.c[1], cz - s.c[2], s.sign[0], s.half)
        and edge_reaches(s.ab[2], s.ab[0], cz - s.a[2], cx - s.a[0], s.sign[1], s.half)
        and edge_reaches(s.bc[2], s.bc[0], cz - s.b[2], cx - s.b[0], s.sign[1], s.half)
        and edge_reaches(s.ca[2], s.ca[0], cz - s.c[2], cx - s.c[0], s.sign[1], s.half)
    )


@wp.struct
class Pairs:
    """(cell, triangle) pairs and the list of each cell.

    count, scan   int64 [items]: cells of each item, and their inclusive scan
    keys, values  int32 [2 * capacity]: cell and triangle; a sort needs the second half
    begin, end    int32 [cells]: the list of a cell is values[begin:end], in index order; (0, 0) where it is empty
    """

    count: wp.array(dtype=wp.int64)
    scan: wp.array(dtype=wp.int64)
    keys: wp.array(dtype=wp.int32)
    values: wp.array(dtype=wp.int32)
    begin: wp.array(dtype=wp.int32)
    end: wp.array(dtype=wp.int32)


@wp.struct
class BinItem:
    """A triangle and the grid that it is binned into, whose cells are numbered from ``base``. triangle: -1 for none."""

    grid: Grid
    base: wp.int32
    triangle: wp.int32


@wp.struct
class LargeItems:
    """The queue of items whose columns many threads share.

    size    int32 [1]: how many                 items  int32 [items]
    cursor  int32 [items]: pairs written so far of each queued item
    """

    size: wp.array(dtype=wp.int32)
    items: wp.array(dtype=wp.int32)
    cursor: wp.array(dtype=wp.int32)


@wp.func
def bin_cells(
    emit: wp.bool, slot: wp.int32, lane: wp.int32, lanes: wp.int32, item: wp.int32, s: Span, what: BinItem, pairs: Pairs,
    large: LargeItems,
) -> wp.int64:  # fmt: skip
    """Count the cells of an item's triangle in every ``lanes``-th column, or emit their pairs where there is room.

    ``slot``: of an item that others bin as well, its place in the queue; -1: of no other. The order of the lanes' pairs is
    arbitrary; a triangle is in a cell once, and the stable sort by cell leaves the triangles of a cell in the order of the
    items, so the lists are the same in every run.
    """
    across = s.high[0] - s.low[0] + 1
    columns = across * (s.high[1] - s.low[1] + 1)
    first = pairs.scan[item] - pairs.count[item]
    found = wp.int64(0)
    for column in range(lane, columns, lanes):
        x = s.low[0] + column % across
        y = s.low[1] + column // across
        cells = column_cells(s, x, y)
        for z in range(cells[0], cells[1] + 1):
            if touches(s, x, y, z):
                if emit:
                    place = first + found
                    if slot >= 0:
                        place = first + wp.int64(wp.atomic_add(large.cursor, slot, 1))
                    if place < wp.int64(pairs.keys.shape[0] // 2):
                        pairs.keys[wp.int32(place)] = what.base + index_of(what.grid.res, s.axis, x, y, z)
                        pairs.values[wp.int32(place)] = what.triangle
                found += wp.int64(1)
    return found


@wp.func
def bin_item(emit: wp.bool, item: wp.int32, what: BinItem, corners: Corners, pairs: Pairs, large: LargeItems):
    """Count the cells of an item's triangle, or emit its pairs.

    Large triangles are queued when counting, and left out when emitting.
    """
    s = span_of(what.grid, corners)
    columns = wp.int64(s.high[0] - s.low[0] + 1) * wp.int64(s.high[1] - s.low[1] + 1)
    found = wp.int64(0)
    if columns <= wp.int64(LARGE_COLUMNS):
        found = bin_cells(emit, -1, 0, 1, item, s, what, pairs, large)
    elif not emit:
        slot = wp.atomic_add(large.size, 0, 1)
        large.items[slot] = item
        large.cursor[slot] = 0
    if not emit:
        pairs.count[item] = found
