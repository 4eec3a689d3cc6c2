"""Primary rays of larger triangles: rows of blocks cut to the triangle, then (triangle, block) items, pixel by pixel."""

from __future__ import annotations

import warp as wp

from ...harness.alpha import Alpha
from ...harness.specialise import effects
from ..common.alpha import hit_counts
from ..common.reserve import reserve
from ..common.screen import camera_space, screen_scale
from ..common.triangle import largest, weld_of
from .camera_stream import BLOCK, Planes, keep, offered, write_item
from .queue import ITEMS, STRIPS
from .spans import Flat, row_span


@wp.func
def recorded(records: wp.array2d(dtype=wp.vec4f), i: wp.int32) -> Planes:
    planes = Planes()
    r0 = records[i, 0]
    r1 = records[i, 1]
    r2 = records[i, 2]
    planes.n0 = wp.vec3f(r0[0], r0[1], r0[2])
    planes.n1 = wp.vec3f(r1[0], r1[1], r1[2])
    planes.n2 = wp.vec3f(r2[0], r2[1], r2[2])
    planes.bound = r0[3]
    return planes


@wp.func
def between_planes(
    planes: Planes,
    y0: wp.int32,
    y1: wp.int32,
    width: wp.int32,
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
) -> wp.vec2i:
    """First and last pixel of rows y0..y1 that are not certainly outside one of the edge planes.

    A plane is linear along a row; four bounds of slack cover its own error, the table's rounding and the sum's.
    """
    low = wp.float32(0.0)
    high = wp.float32(width - 1)
    if planes.bound < wp.INF and width > 1:
        for k in range(3):
            n = planes.n0
            if k == 1:
                n = planes.n1
            if k == 2:
                n = planes.n2
            start = wp.dot(n, column[0])
            slope = (wp.dot(n, column[width - 1]) - start) / wp.float32(width - 1)
            rest = start + wp.max(wp.dot(n, row[y0]), wp.dot(n, row[y1])) + 4.0 * planes.bound
            if wp.abs(slope) * wp.float32(width) > planes.bound:
                x = -rest / slope
                if slope > 0.0:
                    low = wp.max(low, x - 1.0)
                else:
                    high = wp.min(high, x + 1.0)
            elif rest + planes.bound < 0.0:
                high = -1.0
    return wp.vec2i(
        wp.int32(wp.ceil(wp.clamp(low, 0.0, wp.float32(width)))),
        wp.int32(wp.floor(wp.clamp(high, -1.0, wp.float32(width - 1)))),
    )


@wp.func
def on_screen(
    a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, tx: wp.float32, ty: wp.float32, width: wp.int32, height: wp.int32
) -> Flat:
    """Pixel coordinates of the corners (camera space given); within the pad for all that lies in view."""
    flat = Flat()
    flat.known = a[2] > 0.01 * largest(a) and b[2] > 0.01 * largest(b) and c[2] > 0.01 * largest(c)
    if flat.known:
        s = screen_scale(tx, ty, width, height)
        flat.a = wp.vec2f(s[2] + s[0] * (a[0] / a[2]), s[3] - s[1] * (a[1] / a[2]))
        flat.b = wp.vec2f(s[2] + s[0] * (b[0] / b[2]), s[3] - s[1] * (b[1] / b[2]))
        flat.c = wp.vec2f(s[2] + s[0] * (c[0] / c[2]), s[3] - s[1] * (c[1] / c[2]))
        flat.pad = (
            0.05
            + 1.0e-4 * wp.float32(wp.max(width, height))
            + 4.0e-6 * ((1.0 + tx) * s[0] + (1.0 + ty) * s[1])
        )
    return flat


@wp.kernel(enable_backward=False, grid_stride=False)
def strip_kernel(
    threads: wp.int32,
    width: wp.int32,
    height: wp.int32,
    eye: wp.array(dtype=wp.vec3f),
    axes: wp.array(dtype=wp.vec3f),
    tangents: wp.array(dtype=wp.float32),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    records: wp.array2d(dtype=wp.vec4f),
    strips: wp.array(dtype=wp.vec4i),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
):
    """One row of blocks of a large triangle a thread: queue the blocks between its edges.

    Where a corner cannot be projected, the edge planes say what lies between them.
    """
    k = wp.tid()
    stop = wp.min(counts[STRIPS], strips.shape[0])
    while k < stop:
        strip = strips[k]
        k += threads
        i = strip[0]
        by = strip[1]
        box = wp.vec4i(strip[3] & 65535, strip[2] & 65535, strip[3] >> 16, strip[2] >> 16)
        face = triangles[i]
        flat = on_screen(
            camera_space(points[face[0]], eye[0], axes),
            camera_space(points[face[1]], eye[0], axes),
            camera_space(points[face[2]], eye[0], axes),
            tangents[0], tangents[1], width, height,
        )  # fmt: skip
        if flat.known:
            span = row_span(flat, wp.float32(box[1]), wp.float32(box[3]))
            box[0] = wp.max(box[0], wp.int32(wp.ceil(wp.clamp(span[0], 0.0, 65535.0))))
            box[2] = wp.min(box[2], wp.int32(wp.floor(wp.clamp(span[1], -1.0, 65535.0))))
        else:
            planes = recorded(records, i)
            ends = between_planes(planes, box[1], box[3], width, column, row)
            box[0] = wp.max(box[0], ends[0])
            box[2] = wp.min(box[2], ends[1])
        if box[2] >= box[0]:
            first = box[0] // BLOCK
            number = box[2] // BLOCK - first + 1
            at = reserve(counts, ITEMS, number)
            for j in range(number):
                write_item(at + j, i, box, first + j, by, items)


@wp.kernel(enable_backward=False, grid_stride=False)
def item_kernel(
    threads: wp.int32,
    width: wp.int32,
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
    records: wp.array2d(dtype=wp.vec4f),
    depths: wp.array(dtype=wp.vec3d),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
    alpha: Alpha,
    nearest: wp.array(dtype=wp.uint64),
):
    """Queued items: 64 threads each, one a pixel of the block."""
    k = wp.tid()
    stop = wp.min(counts[ITEMS], items.shape[0])
    o = eye[0]
    item = k // 64
    dx = k % BLOCK
    dy = (k % 64) // BLOCK
    while item < stop:
        work = items[item]
        if dx <= work[3] % BLOCK and dy <= work[3] // BLOCK:
            x = work[1] + dx
            y = work[2] + dy
            i = work[0]
            d = column[x] + row[y]
            word = offered(i, o, d, recorded(records, i), depths[i], points, triangles, weld)
            if wp.static(effects.alpha):
                if word != wp.uint64(0):
                    face = triangles[i]
                    if not hit_counts(
                        alpha, i, o, d, points[face[0]], points[face[1]], points[face[2]], weld_of(weld, face)
                    ):
                        word = wp.uint64(0)
            keep(y * width + x, word, nearest)
        item += threads // 64
