"""The perspective grid (paper, section 3): triangles in tiles of the image and slices of depth.

Camera space is (right, up, forward) from the eye. A pixel's ray is forward + sx right + sy up, so a triangle's
edge planes through the eye are linear in (sx, sy) and its depth is 1 / (m . (sx, sy, 1)).
A first pass finds each triangle's box of tiles, range of depth and record; the second its pairs.
All bounds are conservative: a tile is left out only if a float32 error bound says that no pixel centre in it can
see the triangle. A triangle that no pixel centre can see gets no pair at all.
"""

import warp as wp

from ....harness.frame.geometry import Camera, Corners, Mesh, corners_of, value_struct, weld_of
from ...common.screen import in_camera_space, out_of_view, pixel_box
from ...exact.planes import farthest_corner, longest_edge, normal_through
from ...exact.triangle import FLOOR32, OVERFLOW, U32, UNDERFLOW, largest
from ...gpu.entries import set_entry
from ..culling import faces_away
from ..lists.binning import Bins, piece_of, queue_large, write_pairs
from ..lists.sorting import TileLists
from .ray_tests import MOLLER_TRUMBORE, plane_record, vertex_record


@wp.func
def widened(corners: Corners, widening: wp.float32) -> Corners:
    """A triangle grown about its middle by ``widening`` of its size."""
    middle = (corners.a + corners.b + corners.c) / 3.0
    return Corners(
        corners.a + (corners.a - middle) * widening,
        corners.b + (corners.b - middle) * widening,
        corners.c + (corners.c - middle) * widening,
    )


@wp.func
def pixels_of(camera: Camera, seen: Corners) -> wp.vec4i:
    """First and last column and row of the pixels that may see a triangle; empty if last < first."""
    tx = camera.tangents[0]
    ty = camera.tangents[1]
    if out_of_view(seen.a, seen.b, seen.c, tx, ty):
        return wp.vec4i(0, 0, -1, -1)
    return pixel_box(seen.a, seen.b, seen.c, tx, ty, camera.width, camera.height)


@wp.func
def depth_of(seen: Corners) -> wp.vec2f:
    """Range of depth, widened by what rounding may have moved it."""
    z = wp.vec3f(seen.a[2], seen.b[2], seen.c[2])
    slack = 1.0e-6 * farthest_corner(wp.vec3f(), seen)
    return wp.vec2f(wp.max(0.0, wp.min(z) - slack), wp.max(z) + slack)


@wp.struct
class ImageTiles:
    """The grid: side of a tile in pixels, tiles in a row, slices of depth; the triangles in it, and their lists.

    every_slice  lists in every slice that a triangle spans, not only in the first
    widening     growth of each triangle about its middle
    depths       vec2f [triangles]: range of depth of each    depth_range  float32 [2]: of all
    records      vec4f [3 * triangles], written where a triangle is in view: :mod:`.ray_tests`
    """

    tile: wp.int32
    across: wp.int32
    slices: wp.int32
    every_slice: wp.bool
    widening: wp.float32
    depths: wp.array(dtype=wp.vec2f)
    depth_range: wp.array(dtype=wp.float32)
    records: wp.array(dtype=wp.vec4f)
    lists: TileLists


@wp.kernel(enable_backward=False, grid_stride=False)
def project_kernel(test: wp.int32, outward: wp.float64, camera: Camera, mesh: Mesh, grid: ImageTiles, bins: Bins):
    """Each triangle's box of tiles, range of depth and record; queue the large ones; range of all depths.

    ``outward``: see :func:`~.culling.faces_away`. The range is reduced in each block: one atomic per triangle would cost
    more than everything else here.
    """
    i = wp.tid()
    depth = wp.vec2f(wp.INF, -wp.INF)
    if i < bins.boxes.shape[0]:
        set_entry(bins.boxes, i, wp.vec4i(0, 0, -1, -1))
        if mesh.valid[i] != wp.uint8(0):
            corners = corners_of(mesh, i)
            seen = widened(in_camera_space(camera, corners), grid.widening)
            pixels = pixels_of(camera, seen)
            if pixels[2] >= pixels[0] and pixels[3] >= pixels[1]:
                if not faces_away(outward, camera.eye[0], corners):
                    box = wp.vec4i(
                        pixels[0] // grid.tile, pixels[1] // grid.tile, pixels[2] // grid.tile, pixels[3] // grid.tile
                    )
                    set_entry(bins.boxes, i, box)
                    queue_large(i, box, bins.queue)
                    r = plane_record(camera.eye[0], corners, weld_of(mesh, i))
                    if test == MOLLER_TRUMBORE:
                        r = vertex_record(camera.eye[0], corners, weld_of(mesh, i))
                    set_entry(grid.records, 3 * i, r.q0)
                    set_entry(grid.records, 3 * i + 1, r.q1)
                    set_entry(grid.records, 3 * i + 2, r.q2)
                    depth = depth_of(seen)
            grid.depths[i] = depth
    low = wp.tile_extract(wp.tile_min(wp.tile(depth[0])), 0)
    high = wp.tile_extract(wp.tile_max(wp.tile(depth[1])), 0)
    if i % wp.block_dim() == 0:
        if low < grid.depth_range[0]:
            wp.atomic_min(grid.depth_range, 0, low)
        if high > grid.depth_range[1]:
            wp.atomic_max(grid.depth_range, 1, high)


@wp.struct
class ScreenTriangle:
    """A triangle's edge planes and depth plane in camera space.

    n0, n1, n2: edge planes, turned so that inside is positive if ``oriented``; ``error`` bounds their value's error
    m: 1 / depth = m . (sx, sy, 1), known to ``m_error``; only if ``refine``
    """

    n0: wp.vec3f
    n1: wp.vec3f
    n2: wp.vec3f
    error: wp.float32
    oriented: wp.bool
    m: wp.vec3f
    m_error: wp.float32
    refine: wp.bool


@wp.func
def screen_triangle(camera: Camera, corners: Corners, widening: wp.float32) -> ScreenTriangle:
    """The planes of a triangle that is widened about its middle."""
    seen = widened(in_camera_space(camera, corners), widening)
    origin = wp.vec3f()
    n = wp.cross(seen.b - seen.a, seen.c - seen.a)
    det = wp.dot(n, seen.a)
    reach = farthest_corner(origin, seen)
    edge = longest_edge(seen)
    # Camera-space coordinates carry about 4 roundings of |p - eye|; differences inherit twice that.
    slack = 16.0 * U32 * reach
    s = ScreenTriangle()
    s.n0 = normal_through(origin, seen.b, seen.c)
    s.n1 = normal_through(origin, seen.c, seen.a)
    s.n2 = normal_through(origin, seen.a, seen.b)
    longest = 1.0 + camera.tangents[0] + camera.tangents[1]  # |d|_1 of a pixel's direction, at most
    s.error = longest * (32.0 * U32 * reach * edge + 6.0 * reach * slack) + FLOOR32
    n_error = 16.0 * U32 * (edge * edge + UNDERFLOW) + 6.0 * edge * slack
    det_error = 3.0 * n_error * reach + 16.0 * U32 * largest(n) * reach + 3.0 * largest(n) * slack + FLOOR32
    # A det that overflows may have either sign: where the compiler fuses, inf takes the place of inf - inf.
    known = wp.abs(det) < OVERFLOW
    s.oriented = known and wp.abs(det) > det_error
    if det < 0.0:
        s.n0 = -s.n0
        s.n1 = -s.n1
        s.n2 = -s.n2
    s.refine = known and wp.abs(det) > 100.0 * det_error and largest(n) > 100.0 * n_error
    if s.refine:
        s.m = n / det
        s.m_error = 0.03 * largest(s.m) * longest
    return s


@wp.func
def tile_missed(s: ScreenTriangle, x0: wp.float32, x1: wp.float32, y0: wp.float32, y1: wp.float32) -> wp.bool:
    """Whether the rectangle of directions certainly misses the triangle."""
    high0 = wp.max(s.n0[0] * x0, s.n0[0] * x1) + wp.max(s.n0[1] * y0, s.n0[1] * y1) + s.n0[2]
    high1 = wp.max(s.n1[0] * x0, s.n1[0] * x1) + wp.max(s.n1[1] * y0, s.n1[1] * y1) + s.n1[2]
    high2 = wp.max(s.n2[0] * x0, s.n2[0] * x1) + wp.max(s.n2[1] * y0, s.n2[1] * y1) + s.n2[2]
    return s.oriented and (high0 < -s.error or high1 < -s.error or high2 < -s.error)


@wp.func
def slice_of(depth: wp.float32, near: wp.float32, per_slice: wp.float32, slices: wp.int32) -> wp.int32:
    return wp.int32(wp.clamp((depth - near) * per_slice, 0.0, wp.float32(slices) - 0.5))


@wp.func
def slice_scale(grid: ImageTiles) -> wp.float32:
    """Slices per unit of depth; 0 where all depths are equal or there are none."""
    span = grid.depth_range[1] - grid.depth_range[0]
    if span > 0.0:
        return wp.float32(grid.slices) / span
    return wp.float32(0.0)


@value_struct
class ImageItem:
    """A triangle that is put into tiles, and its range of depth."""

    camera: Camera
    grid: ImageTiles
    s: ScreenTriangle
    depth: wp.vec2f


@wp.func
def slices_in_tile(item: ImageItem, column: wp.int32, row: wp.int32, known: wp.bool) -> wp.vec2i:
    """First and last slice that the triangle is listed in within a tile; last < first where it is missed."""
    camera = item.camera
    grid = item.grid
    s = item.s
    depth = item.depth
    tx = camera.tangents[0]
    ty = camera.tangents[1]
    pad = 4.0e-6 * (1.0 + wp.max(tx, ty))
    left = wp.float32(column * grid.tile)
    right = wp.float32(wp.min(column * grid.tile + grid.tile, camera.width) - 1)
    top = wp.float32(row * grid.tile)
    bottom = wp.float32(wp.min(row * grid.tile + grid.tile, camera.height) - 1)
    x0 = (2.0 * (left + 0.5) / wp.float32(camera.width) - 1.0) * tx - pad
    x1 = (2.0 * (right + 0.5) / wp.float32(camera.width) - 1.0) * tx + pad
    y1 = (1.0 - 2.0 * (top + 0.5) / wp.float32(camera.height)) * ty + pad
    y0 = (1.0 - 2.0 * (bottom + 0.5) / wp.float32(camera.height)) * ty - pad
    if tile_missed(s, x0, x1, y0, y1):
        return wp.vec2i(0, -1)
    low = depth[0]
    high = depth[1]
    if s.refine:
        inverse_high = wp.max(s.m[0] * x0, s.m[0] * x1) + wp.max(s.m[1] * y0, s.m[1] * y1) + s.m[2] + s.m_error
        inverse_low = wp.min(s.m[0] * x0, s.m[0] * x1) + wp.min(s.m[1] * y0, s.m[1] * y1) + s.m[2] - s.m_error
        if inverse_high > 0.0:
            low = wp.max(low, 1.0 / inverse_high)
        if inverse_low > 0.0:
            high = wp.min(high, 1.0 / inverse_low)
    per_slice = slice_scale(grid)
    near = grid.depth_range[0]
    first = slice_of(low * 0.99999, near, per_slice, grid.slices)
    last = first
    if grid.every_slice:
        last = wp.max(first, slice_of(high * 1.00001, near, per_slice, grid.slices))
    return wp.vec2i(first, last)


@wp.kernel(enable_backward=False, grid_stride=False)
def bin_kernel(camera: Camera, mesh: Mesh, grid: ImageTiles, bins: Bins):
    """Write the pairs of one piece of work (:func:`..lists.binning.write_pairs`)."""
    p = piece_of(wp.tid(), bins)
    if p.item < 0:
        return
    triangle = screen_triangle(camera, corners_of(mesh, p.item), grid.widening)
    item = ImageItem(camera, grid, triangle, grid.depths[p.item])
    write_pairs(slices_in_tile, item, p, wp.vec2i(0, grid.across), grid.slices, p.item, bins.pairs)
