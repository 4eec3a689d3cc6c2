"""Where a triangle lies on the image: its box of tiles, its range of depth, its record. The perspective grid's first pass.

Camera space is (right, up, forward) from the eye.
"""

from __future__ import annotations

import warp as wp

from ..common.triangle import U32, largest, weld_of
from .binning import INLINE_TILES, queue_rows
from .culling import faces_away
from .ray_tests import plane_record, vertex_record


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


@wp.func
def longest(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.float32:
    return wp.max(largest(b - a), wp.max(largest(c - b), largest(a - c)))


@wp.func
def widened(p: wp.vec3f, middle: wp.vec3f, widening: wp.float32) -> wp.vec3f:
    return p + (p - middle) * widening


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
        # Rounding, and the 2^-30 of its size that a closed triangle reaches beyond itself.
        beyond = 8.0e-9 * longest(a, b, c) / wp.min(a[2], wp.min(b[2], c[2]))
        pad_x = 0.01 + (4.0e-6 + beyond) * (1.0 + tx) * kx + 1.0e-6 * wp.float32(width)
        pad_y = 0.01 + (4.0e-6 + beyond) * (1.0 + ty) * ky + 1.0e-6 * wp.float32(height)
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
