"""The tiles of a light's rectangles: which of them holds a ray, their edges, and whether a tile misses a triangle.

A tile is bounded by planes through the light (meridians, or straight edges on a face) or by parallels. A triangle
certainly misses it where one of the planes through light and edge has all four corners outside: see ``missed``.
"""

import warp as wp

from ..lists.sorting import TileLists
from .mapping import CUBE, TWO_ANGLE
from .sphere import HALF_PI

UNTESTED = wp.constant(wp.float64(4.0))
"""In place of a cosine: this column or row holds directions that its corners do not bound, so it is never missed."""

COLLAPSE = wp.constant(wp.float64(1.0e-5))
"""Two-angle columns and rows nearer than this to +-pi/2 are untested: there the map is not one to one."""

EXTENT = wp.constant(8)
"""Length of a face's extent: two coordinates and distance, lowest then highest, and two unused."""


@wp.struct
class LightTiles:
    """The grid: rectangles, tiles along a side of one, slices; the tiles' edges; the triangles in them, and their lists.

    every_slice lists in every slice that a triangle spans, not only in the first
    skip_empty  no pair where no ray lies, by ``deepest``
    widening    growth of each triangle about its middle
    extent      float64 [faces * EXTENT]: lowest then highest coordinates and distance of each rectangle
    columns, rows  vec4d [faces * tiles], stretch vec2d [faces]: :func:`edges_kernel`
    deepest     int32 [tiles of all faces]: last slice that a shadow ray of the tile reaches, -1 without rays
    spans       vec2i [items]: slices that each item may lie in
    records     vec4f [6 * triangles]: :mod:`.segment_tests`
    """

    faces: wp.int32
    tiles: wp.int32
    slices: wp.int32
    every_slice: wp.bool
    skip_empty: wp.bool
    widening: wp.float64
    extent: wp.array(dtype=wp.float64)
    columns: wp.array(dtype=wp.vec4d)
    rows: wp.array(dtype=wp.vec4d)
    stretch: wp.array(dtype=wp.vec2d)
    deepest: wp.array(dtype=wp.int32)
    spans: wp.array(dtype=wp.vec2i)
    records: wp.array(dtype=wp.vec4f)
    lists: TileLists


@wp.func
def tile_of(angle: wp.float64, low: wp.float64, high: wp.float64, tiles: wp.int32) -> wp.int32:
    """Index of the tile along one axis. Monotone, and the same function for rays and triangles."""
    if not (high > low):
        return 0
    share = (angle - low) / (high - low)
    return wp.int32(wp.clamp(share * wp.float64(tiles), wp.float64(0.0), wp.float64(tiles) - wp.float64(0.5)))


@wp.func
def distance_slice(distance: wp.float64, grid: LightTiles, face: wp.int32) -> wp.int32:
    """Slice between the nearest and the farthest ray of a face; nearer triangles fall into the first."""
    return tile_of(distance, grid.extent[face * EXTENT + 2], grid.extent[face * EXTENT + 5], grid.slices)


@wp.func
def edge_pad(low: wp.float64, high: wp.float64) -> wp.float64:
    """Bound, with a margin, on the distance by which ``tile_of`` may misplace a ray at a tile's edge."""
    return wp.float64(1.0e-13) * (high - low) + wp.float64(1.0e-15) * (wp.abs(low) + wp.abs(high))


@wp.func
def untested() -> wp.vec4d:
    return wp.vec4d(UNTESTED, UNTESTED, UNTESTED, UNTESTED)


@wp.func
def circle_edges(low: wp.float64, high: wp.float64) -> wp.vec4d:
    if high - low > wp.float64(3.0):
        return untested()
    return wp.vec4d(wp.cos(low), wp.sin(low), wp.cos(high), wp.sin(high))


@wp.func
def tangent_edges(low: wp.float64, high: wp.float64, flips: wp.bool) -> wp.vec4d:
    """Edges of a two-angle tile as (1, tan); of a row behind, with both turned round (see ``missed``)."""
    one = wp.float64(1.0)
    ahead = low > COLLAPSE - HALF_PI and high < HALF_PI - COLLAPSE
    behind = low > HALF_PI + COLLAPSE or high < -HALF_PI - COLLAPSE
    if not ahead and not behind:
        return untested()
    if behind and flips:
        return wp.vec4d(-one, -wp.tan(low), -one, -wp.tan(high))
    return wp.vec4d(one, wp.tan(low), one, wp.tan(high))


@wp.func
def bulge(width: wp.float64) -> wp.float64:
    """How much a cosine may exceed the larger of its two values ``width`` apart, where that is positive."""
    return wp.float64(1.0) / wp.cos(wp.min(wp.float64(1.51), wp.float64(0.50001) * width))


@wp.kernel(enable_backward=False)
def edges_kernel(map: wp.int32, grid: LightTiles):
    """Edges of every column and row of tiles, once per frame; the directions of the corners are their products.

    Column (c, s) and row (c', s') meet in direction (c' c, c' s, s'). ``stretch[face]``: see ``missed``.
    """
    k = wp.tid()
    face = k // grid.tiles
    j = wp.float64(k % grid.tiles)
    offset = face * EXTENT
    extent = grid.extent
    wide = (extent[offset + 3] - extent[offset]) / wp.float64(grid.tiles)
    tall = (extent[offset + 4] - extent[offset + 1]) / wp.float64(grid.tiles)
    pad_u = edge_pad(extent[offset], extent[offset + 3])
    pad_v = edge_pad(extent[offset + 1], extent[offset + 4])
    low_u = extent[offset] + j * wide - pad_u
    high_u = extent[offset] + (j + wp.float64(1.0)) * wide + pad_u
    low_v = extent[offset + 1] + j * tall - pad_v
    high_v = extent[offset + 1] + (j + wp.float64(1.0)) * tall + pad_v
    one = wp.float64(1.0)
    stretch = wp.vec2d(one, one)
    if map == TWO_ANGLE:
        grid.columns[k] = tangent_edges(low_u, high_u, False)
        grid.rows[k] = tangent_edges(low_v, high_v, True)
    elif map == CUBE:
        grid.columns[k] = wp.vec4d(one, low_u, one, high_u)
        grid.rows[k] = wp.vec4d(one, low_v, one, high_v)
    else:
        grid.columns[k] = circle_edges(low_u, high_u)
        grid.rows[k] = circle_edges(wp.max(low_v, -HALF_PI), wp.min(high_v, HALF_PI))
        stretch = wp.vec2d(bulge(wide + wp.float64(2.0) * pad_u), bulge(tall + wp.float64(2.0) * pad_v))
    grid.stretch[face] = stretch


@wp.func
def along(column: wp.vec4d, n: wp.vec3d, stretch: wp.float64) -> wp.float64:
    """Upper bound of n . (cos, sin) between a column's edges."""
    most = wp.max(n[0] * column[0] + n[1] * column[1], n[0] * column[2] + n[1] * column[3])
    if most > wp.float64(0.0):
        most = most * stretch
    return most


@wp.func
def least_along(column: wp.vec4d, n: wp.vec3d) -> wp.float64:
    """Lower bound of n . (1, tan) between a column's edges."""
    return wp.min(n[0] * column[0] + n[1] * column[1], n[0] * column[2] + n[1] * column[3])


@wp.func
def beyond(column: wp.vec4d, row: wp.vec4d, n: wp.vec3d, stretch: wp.float64, error: wp.float64) -> wp.bool:
    """Whether the whole tile lies certainly on the negative side of the plane with normal n.

    On a sphere: n . d <= c' M + s' n_z with M the bound along the column; M cos + n_z sin that is negative at both
    ends of less than half a turn is negative between them. On a face n . d is linear. A row behind the light has
    c' = -1: there the column's least value counts.
    """
    m = wp.float64(0.0)
    if row[0] < wp.float64(0.0) and row[2] < wp.float64(0.0):
        m = least_along(column, n)
    else:
        m = along(column, n, stretch)
    return wp.max(row[0] * m + row[1] * n[2], row[2] * m + row[3] * n[2]) < -error


@wp.func
def missed(
    column: wp.vec4d, row: wp.vec4d, stretch: wp.vec2d, n0: wp.vec3d, n1: wp.vec3d, n2: wp.vec3d, error: wp.float64
) -> wp.bool:
    """Whether a tile certainly misses the triangle with inward planes n0, n1, n2, known to ``error`` for unit d.

    A ray's place is known to a pad in angle, and its direction (1, tan, tan) to that times its length squared: near the
    plane x = 0 two tangents are an ill-conditioned form of a direction.
    """
    two = wp.float64(2.0)
    if column[0] > two or row[0] > two:
        return False
    longest = wp.max(wp.abs(column[0]) + wp.abs(column[1]), wp.abs(column[2]) + wp.abs(column[3])) + wp.max(
        wp.abs(row[1]), wp.abs(row[3])
    )
    e = error * longest * longest
    return (
        beyond(column, row, n0, stretch[0], e)
        or beyond(column, row, n1, stretch[0], e)
        or beyond(column, row, n2, stretch[0], e)
    )


@wp.func
def slope_bounds(column: wp.vec4d, row: wp.vec4d, n: wp.vec3d, stretch: wp.vec2d) -> wp.vec3d:
    """Lowest and highest n . d in a tile, and the longest d (the shortest is 1); the last 0 where not known."""
    zero = wp.float64(0.0)
    two = wp.float64(2.0)
    if column[0] > two or row[0] > two or row[0] < zero or row[2] < zero:
        return wp.vec3d(zero, zero, zero)
    most = along(column, n, stretch[0])
    least = least_along(column, n)
    high = wp.max(row[0] * most + row[1] * n[2], row[2] * most + row[3] * n[2])
    if high > zero:
        high = high * stretch[1]
    low = wp.min(row[0] * least + row[1] * n[2], row[2] * least + row[3] * n[2])
    if least < zero:
        low = zero  # the cosines' own least may lie between the edges
    far = wp.float64(1.0)
    if column[0] == wp.float64(1.0) and column[2] == wp.float64(1.0) and row[0] == wp.float64(1.0):
        x = wp.max(wp.abs(column[1]), wp.abs(column[3]))
        y = wp.max(wp.abs(row[1]), wp.abs(row[3]))
        far = wp.sqrt(wp.float64(1.0) + x * x + y * y)
    return wp.vec3d(low, high, far)
