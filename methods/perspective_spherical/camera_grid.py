"""The perspective grid (paper, section 3): triangles in tiles of the image and slices of depth.

Camera space is (right, up, forward) from the eye. A pixel's ray is forward + sx right + sy up, so a triangle's
edge planes through the eye are linear in (sx, sy) and its depth is 1 / (m . (sx, sy, 1)).
All bounds are conservative: a tile is left out only if a float32 error bound says that no pixel centre in it can
see the triangle. A triangle that no pixel centre can see gets no pair at all.
"""

from __future__ import annotations

import warp as wp

from ..common.triangle import FLOOR32, U32, largest, weld_of
from .binning import INLINE_TILES, queue_rows
from .culling import faces_away
from .ray_tests import plane_record, vertex_record


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
def camera_space(p: wp.vec3f, eye: wp.vec3f, axes: wp.array(dtype=wp.vec3f)) -> wp.vec3f:
    v = p - eye
    return wp.vec3f(wp.dot(axes[0], v), wp.dot(axes[1], v), wp.dot(axes[2], v))


@wp.func
def beside(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, plane: wp.vec3f) -> wp.bool:
    """Whether the whole triangle lies certainly outside a plane through the eye."""
    slack = 32.0 * U32 * (wp.abs(plane[0]) + wp.abs(plane[1]) + wp.abs(plane[2]))
    return (
        wp.dot(plane, a) > slack * largest(a)
        and wp.dot(plane, b) > slack * largest(b)
        and wp.dot(plane, c) > slack * largest(c)
    )


@wp.kernel(enable_backward=False)
def project_kernel(
    triangle_count: wp.int32,
    width: wp.int32,
    height: wp.int32,
    tile: wp.int32,
    widening: wp.float32,
    outward: wp.float64,
    test: wp.int32,
    eye: wp.array(dtype=wp.vec3f),
    axes: wp.array(dtype=wp.vec3f),
    tangents: wp.array(dtype=wp.float32),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
    valid: wp.array(dtype=wp.uint8),
    boxes: wp.array(dtype=wp.vec4i),
    depths: wp.array(dtype=wp.vec2f),
    depth_range: wp.array(dtype=wp.float32),
    records: wp.array(dtype=wp.vec4f),
    rows: wp.array(dtype=wp.vec2i),
    row_count: wp.array(dtype=wp.int64),
):
    """Each triangle's box of tiles, range of depth and record; queue the rows of large ones; range of all depths.

    widening  growth of each triangle about its middle; outward  see :func:`~.culling.faces_away`
    records   vec4f [3 * triangle_count], written where the box is not empty
    """
    i = wp.tid()
    boxes[i] = wp.vec4i(0, 0, -1, -1)
    if i >= triangle_count or valid[i] == wp.uint8(0):
        return
    face = triangles[i]
    o = eye[0]
    a = camera_space(points[face[0]], o, axes)
    b = camera_space(points[face[1]], o, axes)
    c = camera_space(points[face[2]], o, axes)
    middle = (a + b + c) / 3.0
    a = widened(a, middle, widening)
    b = widened(b, middle, widening)
    c = widened(c, middle, widening)
    tx = tangents[0]
    ty = tangents[1]
    if beside(a, b, c, wp.vec3f(1.0, 0.0, -tx)) or beside(a, b, c, wp.vec3f(-1.0, 0.0, -tx)):
        return
    if beside(a, b, c, wp.vec3f(0.0, 1.0, -ty)) or beside(a, b, c, wp.vec3f(0.0, -1.0, -ty)):
        return
    if beside(a, b, c, wp.vec3f(0.0, 0.0, -1.0)):
        return
    x0 = wp.int32(0)
    y0 = wp.int32(0)
    x1 = width - 1
    y1 = height - 1
    # A vertex behind the eye, or so near its plane that its projection is not known, leaves the box at full screen.
    if a[2] > 1.0e-4 * largest(a) and b[2] > 1.0e-4 * largest(b) and c[2] > 1.0e-4 * largest(c):
        kx = 0.5 * wp.float32(width) / tx
        ky = 0.5 * wp.float32(height) / ty
        mx = 0.5 * wp.float32(width) - 0.5
        my = 0.5 * wp.float32(height) - 0.5
        ax = mx + kx * (a[0] / a[2])
        bx = mx + kx * (b[0] / b[2])
        cx = mx + kx * (c[0] / c[2])
        ay = my - ky * (a[1] / a[2])
        by = my - ky * (b[1] / b[2])
        cy = my - ky * (c[1] / c[2])
        pad_x = 0.01 + 4.0e-6 * (1.0 + tx) * kx + 1.0e-6 * wp.float32(width)
        pad_y = 0.01 + 4.0e-6 * (1.0 + ty) * ky + 1.0e-6 * wp.float32(height)
        x0 = wp.int32(wp.ceil(wp.clamp(wp.min(ax, wp.min(bx, cx)) - pad_x, 0.0, wp.float32(width))))
        x1 = wp.int32(wp.floor(wp.clamp(wp.max(ax, wp.max(bx, cx)) + pad_x, -1.0, wp.float32(width - 1))))
        y0 = wp.int32(wp.ceil(wp.clamp(wp.min(ay, wp.min(by, cy)) - pad_y, 0.0, wp.float32(height))))
        y1 = wp.int32(wp.floor(wp.clamp(wp.max(ay, wp.max(by, cy)) + pad_y, -1.0, wp.float32(height - 1))))
    if x1 < x0 or y1 < y0:
        return
    if faces_away(outward, o, points[face[0]], points[face[1]], points[face[2]]):
        return
    box = wp.vec4i(x0 // tile, y0 // tile, x1 // tile, y1 // tile)
    boxes[i] = box
    reach = wp.max(largest(a), wp.max(largest(b), largest(c)))
    low = wp.max(0.0, wp.min(a[2], wp.min(b[2], c[2])) - 1.0e-6 * reach)
    high = wp.max(a[2], wp.max(b[2], c[2])) + 1.0e-6 * reach
    depths[i] = wp.vec2f(low, high)
    if low < depth_range[0]:
        wp.atomic_min(depth_range, 0, low)
    if high > depth_range[1]:
        wp.atomic_max(depth_range, 1, high)
    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) > INLINE_TILES:
        queue_rows(i, box, rows, row_count)
    r = plane_record(o, points[face[0]], points[face[1]], points[face[2]], weld_of(weld, face))
    if test == 2:  # Moeller-Trumbore
        r = vertex_record(o, points[face[0]], points[face[1]], points[face[2]], weld_of(weld, face))
    records[3 * i] = r.q0
    records[3 * i + 1] = r.q1
    records[3 * i + 2] = r.q2


@wp.func
def widened(p: wp.vec3f, middle: wp.vec3f, widening: wp.float32) -> wp.vec3f:
    return p + (p - middle) * widening


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
