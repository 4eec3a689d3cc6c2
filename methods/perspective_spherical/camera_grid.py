"""The perspective grid (paper, section 3): triangles in tiles of the image and slices of depth.

Camera space is (right, up, forward) from the eye. A pixel's ray is forward + sx right + sy up, so a triangle's
edge planes through the eye are linear in (sx, sy) and its depth is 1 / (m . (sx, sy, 1)).
All bounds are conservative: a tile is left out only if a float32 error bound says that no pixel centre in it can
see the triangle. A triangle that no pixel centre can see gets no pair at all.
"""

from __future__ import annotations

import warp as wp

from ..common.screen import camera_space
from ..common.triangle import FLOOR32, U32, largest
from .binning import INLINE_TILES
from .camera_bounds import widened


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
def screen_triangle(
    face: wp.vec3i,
    widening: wp.float32,
    eye: wp.vec3f,
    axes: wp.array(dtype=wp.vec3f),
    tangents: wp.array(dtype=wp.float32),
    points: wp.array(dtype=wp.vec3f),
) -> ScreenTriangle:
    a = camera_space(points[face[0]], eye, axes)
    b = camera_space(points[face[1]], eye, axes)
    c = camera_space(points[face[2]], eye, axes)
    middle = (a + b + c) / 3.0
    a = widened(a, middle, widening)
    b = widened(b, middle, widening)
    c = widened(c, middle, widening)
    ab = b - a
    bc = c - b
    ca = a - c
    n = wp.cross(ab, -ca)
    det = wp.dot(n, a)
    reach = wp.max(largest(a), wp.max(largest(b), largest(c)))
    edge = wp.max(largest(ab), wp.max(largest(bc), largest(ca)))
    # Camera-space coordinates carry about 4 roundings of |p - eye|; differences inherit twice that.
    slack = 16.0 * U32 * reach
    s = ScreenTriangle()
    s.n0 = wp.cross(b, bc)
    s.n1 = wp.cross(c, ca)
    s.n2 = wp.cross(a, ab)
    s.error = (1.0 + tangents[0] + tangents[1]) * (32.0 * U32 * reach * edge + 6.0 * reach * slack) + FLOOR32
    n_error = 16.0 * U32 * edge * edge + 6.0 * edge * slack
    det_error = 3.0 * n_error * reach + 16.0 * U32 * largest(n) * reach + 3.0 * largest(n) * slack + FLOOR32
    s.oriented = wp.abs(det) > det_error
    if det < 0.0:
        s.n0 = -s.n0
        s.n1 = -s.n1
        s.n2 = -s.n2
    s.refine = wp.abs(det) > 100.0 * det_error and largest(n) > 100.0 * n_error
    if s.refine:
        s.m = n / det
        s.m_error = 0.03 * largest(s.m) * (1.0 + tangents[0] + tangents[1])
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
def slice_scale(depth_range: wp.array(dtype=wp.float32), slices: wp.int32) -> wp.float32:
    """Slices a metre; 0 where all depths agree or there are none."""
    span = depth_range[1] - depth_range[0]
    if span > 0.0:
        return wp.float32(slices) / span
    return wp.float32(0.0)


@wp.func
def bin_row(
    emit: wp.int32,
    i: wp.int32,
    s: ScreenTriangle,
    depth: wp.vec2f,
    row: wp.int32,
    first: wp.int32,
    last: wp.int32,
    width: wp.int32,
    height: wp.int32,
    tile: wp.int32,
    slices: wp.int32,
    spans: wp.bool,
    tangents: wp.array(dtype=wp.float32),
    depth_range: wp.array(dtype=wp.float32),
    place: wp.int64,
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
) -> wp.int64:
    """Count (or write from ``place``) the cells of triangle i in tiles first..last of one row."""
    tx = tangents[0]
    ty = tangents[1]
    pad = 4.0e-6 * (1.0 + wp.max(tx, ty))
    per_slice = slice_scale(depth_range, slices)
    near = depth_range[0]
    across = (width + tile - 1) // tile
    capacity = wp.int64(keys.shape[0] // 2)
    top = wp.float32(row * tile)
    bottom = wp.float32(wp.min(row * tile + tile, height) - 1)
    y1 = (1.0 - 2.0 * (top + 0.5) / wp.float32(height)) * ty + pad
    y0 = (1.0 - 2.0 * (bottom + 0.5) / wp.float32(height)) * ty - pad
    number = wp.int64(0)
    for column in range(first, last + 1):
        left = wp.float32(column * tile)
        right = wp.float32(wp.min(column * tile + tile, width) - 1)
        x0 = (2.0 * (left + 0.5) / wp.float32(width) - 1.0) * tx - pad
        x1 = (2.0 * (right + 0.5) / wp.float32(width) - 1.0) * tx + pad
        if not tile_missed(s, x0, x1, y0, y1):
            low = depth[0]
            high = depth[1]
            if s.refine:
                inverse_high = (
                    wp.max(s.m[0] * x0, s.m[0] * x1) + wp.max(s.m[1] * y0, s.m[1] * y1) + s.m[2] + s.m_error
                )
                inverse_low = (
                    wp.min(s.m[0] * x0, s.m[0] * x1) + wp.min(s.m[1] * y0, s.m[1] * y1) + s.m[2] - s.m_error
                )
                if inverse_high > 0.0:
                    low = wp.max(low, 1.0 / inverse_high)
                if inverse_low > 0.0:
                    high = wp.min(high, 1.0 / inverse_low)
            s0 = slice_of(low * 0.99999, near, per_slice, slices)
            s1 = s0
            if spans:
                s1 = wp.max(s0, slice_of(high * 1.00001, near, per_slice, slices))
            if emit != 0:
                cell = (row * across + column) * slices
                for slice in range(s0, s1 + 1):
                    at = place + number + wp.int64(slice - s0)
                    if at < capacity:
                        keys[wp.int32(at)] = cell + slice
                        values[wp.int32(at)] = i
            number += wp.int64(s1 - s0 + 1)
    return number


@wp.kernel(enable_backward=False)
def bin_triangles_kernel(
    emit: wp.int32,
    width: wp.int32,
    height: wp.int32,
    tile: wp.int32,
    slices: wp.int32,
    spans: wp.bool,
    widening: wp.float32,
    eye: wp.array(dtype=wp.vec3f),
    axes: wp.array(dtype=wp.vec3f),
    tangents: wp.array(dtype=wp.float32),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    boxes: wp.array(dtype=wp.vec4i),
    depths: wp.array(dtype=wp.vec2f),
    depth_range: wp.array(dtype=wp.float32),
    count: wp.array(dtype=wp.int64),
    scan: wp.array(dtype=wp.int64),
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
):
    """Small triangles: all their tiles."""
    i = wp.tid()
    box = boxes[i]
    number = wp.int64(0)
    if box[2] >= box[0] and (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= INLINE_TILES:
        s = screen_triangle(triangles[i], widening, eye[0], axes, tangents, points)
        place = scan[i] - count[i]
        for row in range(box[1], box[3] + 1):
            number += bin_row(
                emit, i, s, depths[i], row, box[0], box[2], width, height, tile, slices, spans, tangents,
                depth_range, place + number, keys, values,
            )  # fmt: skip
    if emit == 0:
        count[i] = number


@wp.kernel(enable_backward=False)
def bin_rows_kernel(
    emit: wp.int32,
    offset: wp.int32,
    width: wp.int32,
    height: wp.int32,
    tile: wp.int32,
    slices: wp.int32,
    spans: wp.bool,
    widening: wp.float32,
    eye: wp.array(dtype=wp.vec3f),
    axes: wp.array(dtype=wp.vec3f),
    tangents: wp.array(dtype=wp.float32),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    boxes: wp.array(dtype=wp.vec4i),
    depths: wp.array(dtype=wp.vec2f),
    depth_range: wp.array(dtype=wp.float32),
    rows: wp.array(dtype=wp.vec2i),
    row_count: wp.array(dtype=wp.int64),
    count: wp.array(dtype=wp.int64),
    scan: wp.array(dtype=wp.int64),
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
):
    """Large triangles: one queued row of tiles a thread. ``offset`` is where rows begin in count and scan."""
    k = wp.tid()
    number = wp.int64(0)
    if wp.int64(k) < row_count[0]:
        i = rows[k][0]
        box = boxes[i]
        s = screen_triangle(triangles[i], widening, eye[0], axes, tangents, points)
        place = scan[offset + k] - count[offset + k]
        number = bin_row(
            emit, i, s, depths[i], rows[k][1], box[0], box[2], width, height, tile, slices, spans, tangents,
            depth_range, place, keys, values,
        )  # fmt: skip
    if emit == 0:
        count[offset + k] = number
