"""The light grid (paper, section 4.1): triangles in tiles of a light's rectangles and slices of distance.

A first pass finds where a triangle lies in each rectangle: its box of tiles, which holds the map's exact bounds of the
triangle (:mod:`.light.mapping`), its span of slices and its record; the second its pairs. Conservative throughout: a tile
of the box is left out only if it certainly misses the triangle (:func:`~.light.tile_edges.missed`), or if no shadow ray
lies in it. An item is a triangle in one rectangle: item = triangle * faces + face.
"""

import functools

import warp as wp

from ....harness.frame.geometry import Corners, Mesh, corners_of, value_struct, weld_of
from ...exact.segment import side_of_light
from ...exact.triangle import largest, to_float64
from ...gpu.entries import set_entry
from ..culling import faces_away
from ..lists.binning import INLINE_TILES, Bins, piece_of, queue_large, write_pairs
from .bounds import BOUNDS
from .mapping import LightSpace, face_frame
from .segment_tests import write_record
from .sphere import ROUNDING, TWO_PI
from .tile_edges import EXTENT, LightTiles, distance_slice, missed, slope_bounds, tile_of

FAR_EYE = wp.constant(wp.float64(2.0**-16))
"""Addition to the error of the rays for an eye far away, as a share of its distance."""


@wp.struct
class LitTriangle:
    """Corners in the frame of a face, from the light; inward planes through the light and the edges.

    ``oriented``: whether inward is known; ``error`` bounds a plane's value for a unit direction known to ``pad``
    n, height: normal turned away from the light and its product with a corner: the distance along a unit d is
    height / (n . d); ``slope`` bounds the error of n . d, negative where the distance is not known well
    """

    a: wp.vec3d
    b: wp.vec3d
    c: wp.vec3d
    n0: wp.vec3d
    n1: wp.vec3d
    n2: wp.vec3d
    oriented: wp.bool
    error: wp.float64
    n: wp.vec3d
    height: wp.float64
    slope: wp.float64


@wp.func
def lit_triangle(space: LightSpace, grid: LightTiles, face: wp.int32, corners: Corners) -> LitTriangle:
    """A triangle that is widened about its middle, in the frame of a face."""
    l64 = to_float64(space.proxy_positions[space.index])
    axes = space.axes[0]
    pad = space.pads[0]
    a = face_frame(axes * (to_float64(corners.a) - l64), face)
    b = face_frame(axes * (to_float64(corners.b) - l64), face)
    c = face_frame(axes * (to_float64(corners.c) - l64), face)
    middle = (a + b + c) / wp.float64(3.0)
    a += (a - middle) * grid.widening
    b += (b - middle) * grid.widening
    c += (c - middle) * grid.widening
    s = LitTriangle()
    s.a = a
    s.b = b
    s.c = c
    s.n0 = wp.cross(b, c - b)
    s.n1 = wp.cross(c, a - c)
    s.n2 = wp.cross(a, b - a)
    s.n = wp.cross(b - a, c - a)
    det = wp.dot(s.n, a)
    reach = wp.max(largest(a), wp.max(largest(b), largest(c)))
    edge = wp.max(largest(b - a), wp.max(largest(c - b), largest(a - c)))
    s.oriented = wp.abs(det) > wp.float64(8.0) * ROUNDING * edge * edge * reach
    if det < wp.float64(0.0):
        s.n0 = -s.n0
        s.n1 = -s.n1
        s.n2 = -s.n2
        s.n = -s.n
    s.height = wp.abs(det)
    s.slope = wp.float64(-1.0)
    if s.height > wp.float64(8.0e4) * ROUNDING * edge * edge * reach:
        s.slope = wp.float64(8.0) * ROUNDING * edge * edge + wp.float64(2.0) * pad * largest(s.n)
    steepest = wp.max(largest(s.n0), wp.max(largest(s.n1), largest(s.n2)))
    s.error = wp.float64(8.0) * ROUNDING * reach * edge + wp.float64(2.0) * pad * steepest
    return s


@wp.func
def covered(grid: LightTiles, axis: wp.int32, low: wp.float64, high: wp.float64, wrap: wp.int32) -> wp.vec2i:
    """Tiles along an axis of a rectangle that low..high may touch, also one turn further where it wraps; (1, 0) for none.

    axis  place of the rectangle's lowest coordinate in ``grid.extent``
    """
    first = grid.extent[axis]
    last = grid.extent[axis + 3]
    result = wp.vec2i(1, 0)
    overlaps = wp.int32(0)
    turns = wp.int32(0)
    if wrap == 1:
        turns = 1
    for turn in range(-turns, turns + 1):
        shift = wp.float64(turn) * TWO_PI
        if high + shift >= first and low + shift <= last:
            overlaps += 1
            result = wp.vec2i(
                tile_of(low + shift, first, last, grid.tiles), tile_of(high + shift, first, last, grid.tiles)
            )
    if overlaps > 1:
        # Both ends of the rectangle: take all tiles; the planes through the edges reject those between.
        return wp.vec2i(0, grid.tiles - 1)
    return result


@wp.func
def no_ray_in(grid: LightTiles, box: wp.vec4i, slice: wp.int32, side: wp.int32) -> wp.bool:
    """Whether no shadow ray in a small box of tiles reaches ``slice``; large boxes are not tested."""
    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) > INLINE_TILES:
        return False
    for row in range(box[1], box[3] + 1):
        for column in range(box[0], box[2] + 1):
            if grid.deepest[(side * grid.tiles + row) * grid.tiles + column] >= slice:
                return False
    return True


@wp.func
def ray_size(space: LightSpace) -> wp.float32:
    """Bounds every coordinate of the hit points; and what an eye far away may have rounded them by."""
    most = wp.float64(largest(space.eye[0])) * FAR_EYE
    for axis in range(6):
        most = wp.max(most, wp.abs(space.box[axis]))
    return wp.float32(most * wp.float64(1.000001))


@functools.cache
def make_bound_kernel(bounds: str) -> wp.Kernel:
    """Bounds of triangles, by name in :data:`.bounds.BOUNDS`: compiled apart, as each takes many registers."""
    bounds_of, wrap = BOUNDS[bounds]

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, cuda_max_registers=128)
    def bound_kernel(test: wp.int32, outward: wp.float64, space: LightSpace, grid: LightTiles, mesh: Mesh, bins: Bins):
        """Each item's box of tiles, span of slices and record; queue the large ones."""
        item = wp.tid()
        set_entry(bins.boxes, item, wp.vec4i(0, 0, -1, -1))
        i = item // grid.faces
        side = item % grid.faces
        offset = side * EXTENT
        if mesh.valid[i] == wp.uint8(0) or not (grid.extent[offset + 3] >= grid.extent[offset]):
            return
        light = space.lights[space.index]
        corners = corners_of(mesh, i)
        if side_of_light(light, corners) == 0.0 or faces_away(outward, light, corners):
            return
        s = lit_triangle(space, grid, side, corners)
        # Nearest point: no nearer than the plane, nor than the nearest vertex less the longest edge.
        normal = wp.cross(s.b - s.a, s.c - s.a)
        size = wp.length(normal)
        la = wp.length(s.a)
        lb = wp.length(s.b)
        lc = wp.length(s.c)
        longest = wp.max(wp.length(s.b - s.a), wp.max(wp.length(s.c - s.b), wp.length(s.a - s.c)))
        near = wp.max(wp.float64(0.0), wp.min(la, wp.min(lb, lc)) - longest)
        if size > wp.float64(1.0e-9) * longest * longest:
            plane = wp.abs(wp.dot(normal, s.a)) / size
            near = wp.max(near, plane - wp.float64(1.0e-5) * longest)
        near = near * (wp.float64(1.0) - space.distance_pad)
        if near > grid.extent[offset + 5]:
            return
        bounds = bounds_of(s.a, s.b, s.c, space.pads[0])
        if not (bounds[1] >= bounds[0]):
            return
        x = covered(grid, offset, bounds[0], bounds[1], wp.static(wrap[0]))
        y = covered(grid, offset + 1, bounds[2], bounds[3], wp.static(wrap[1]))
        if x[1] < x[0] or y[1] < y[0]:
            return
        box = wp.vec4i(x[0], y[0], x[1], y[1])
        first = distance_slice(near, grid, side)
        if grid.skip_empty and no_ray_in(grid, box, first, side):
            return
        set_entry(bins.boxes, item, box)
        far = wp.max(la, wp.max(lb, lc)) * (wp.float64(1.0) + space.distance_pad)
        set_entry(grid.spans, item, wp.vec2i(first, distance_slice(far, grid, side)))
        queue_large(item, box, bins.queue)
        write_record(grid.records, i, test, light, corners, weld_of(mesh, i), ray_size(space))

    return bound_kernel


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


@value_struct
class LightItem:
    """An item that is put into the tiles of rectangle ``side``.

    span  slices that it may lie in     test  whether a tile of its box may miss it
    """

    grid: LightTiles
    s: LitTriangle
    span: wp.vec2i
    side: wp.int32
    test: wp.bool


@wp.func
def slices_in_tile(item: LightItem, column: wp.int32, row: wp.int32, known: wp.bool) -> wp.vec2i:
    """First and last slice that an item is listed in within a tile; last < first where it is left out."""
    grid = item.grid
    side = item.side
    s = item.s
    tile = (side * grid.tiles + row) * grid.tiles + column
    deepest = grid.slices - 1
    if grid.skip_empty:
        deepest = grid.deepest[tile]
        if deepest < item.span[0]:
            return wp.vec2i(0, -1)
    edges = grid.rows[side * grid.tiles + row]
    between = grid.columns[side * grid.tiles + column]
    if item.test and not known and missed(between, edges, grid.stretch[side], s.n0, s.n1, s.n2, s.error):
        return wp.vec2i(0, -1)
    here = narrowed(grid, s, item.span, side, between, edges)
    last = here[0]
    if grid.every_slice:
        last = here[1]
    return wp.vec2i(here[0], wp.min(last, deepest))


@wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=80)
def bin_kernel(space: LightSpace, grid: LightTiles, mesh: Mesh, bins: Bins):
    """Write the pairs of one piece of work (:func:`..lists.binning.write_pairs`)."""
    p = piece_of(wp.tid(), bins)
    if p.item < 0:
        return
    span = grid.spans[p.item]
    triangle = p.item // grid.faces
    side = p.item % grid.faces
    box = bins.boxes[p.item]
    single = box[0] == box[2] and box[1] == box[3]
    s = LitTriangle()
    s.slope = wp.float64(-1.0)
    # One tile needs no test; one slice needs no plane.
    if span[0] < span[1] or not single:
        s = lit_triangle(space, grid, side, corners_of(mesh, triangle))
    item = LightItem(grid, s, span, side, s.oriented and not single)
    first = wp.vec2i(side * grid.tiles * grid.tiles, grid.tiles)
    write_pairs(slices_in_tile, item, p, first, grid.slices, triangle, bins.pairs)
