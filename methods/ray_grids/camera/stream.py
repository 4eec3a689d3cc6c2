"""Primary rays: one ray a pixel lies in the grid; triangles are streamed over it.

How a pixel is tested, and what is kept of it, is in :mod:`.camera.pixels`.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.geometry import Camera, Mesh, corners_of, ray_of, weld_of
from ....harness.frame.specialise import effects
from ...common.alpha import opaque_at_hit
from ...common.entries import entry, set_entry, set_entry_of_four
from ...common.reserve import reserve
from ...common.screen import camera_space, in_front, out_of_view, pixel_box
from ...common.triangle import hit_distance
from ..queues import DOUBTS, ITEMS, triangle_of
from .pixels import Planes, edge_planes, hit_word, inverse_depth, offer, offer_box, sign_bound

GROUP = wp.constant(32)
"""Rows or columns of a work item: the 32 lanes of the GPU's warp find the ends of one each."""

TALL = wp.constant(2)
"""A queued box so many times as high as wide is cut in columns: fewer of them, and longer ones."""

REGISTERS = 64
"""Registers a thread of the kernel that sees every triangle: eight blocks of 128 a multiprocessor."""


@wp.struct
class Lines:
    """The edge planes along a row of pixels: start + n . row[y] + x / inverse; inverse 0: as good as constant.

    Along a column likewise: start + n . column[x] + y / inverse.
    """

    start: wp.vec3f
    inverse: wp.vec3f


@wp.func
def plane_line(n: wp.vec3f, bound: wp.float32, first: wp.vec3f, last: wp.vec3f, length: wp.int32) -> wp.vec2f:
    """(start, inverse) of one plane. Four bounds of slack cover its own error, the table's rounding and the sum's."""
    start = wp.dot(n, first)
    slope = (wp.dot(n, last) - start) / wp.float32(length - 1)
    inverse = wp.float32(0.0)
    if wp.abs(slope) * wp.float32(length) > bound:
        inverse = 1.0 / slope
    return wp.vec2f(start + 4.0 * bound, inverse)


@wp.func
def lines_of(planes: Planes, bound: wp.float32, first: wp.vec3f, last: wp.vec3f, length: wp.int32) -> Lines:
    """Along rows, given the first and last column's part of a direction and their number; or along columns."""
    l0 = plane_line(planes.n0, bound, first, last, length)
    l1 = plane_line(planes.n1, bound, first, last, length)
    l2 = plane_line(planes.n2, bound, first, last, length)
    lines = Lines()
    lines.start = wp.vec3f(l0[0], l1[0], l2[0])
    lines.inverse = wp.vec3f(l0[1], l1[1], l2[1])
    return lines


@wp.func
def pixels_of_row(
    planes: Planes,
    bound: wp.float32,
    lines: Lines,
    d: wp.vec3f,
    first: wp.int32,
    last: wp.int32,
    length: wp.int32,
) -> wp.vec2i:
    """First and last pixel of first..last that are not certainly outside an edge plane, in the row of direction d.

    Or in the column; ``length``: pixels along the whole of it.
    The hair covers the rounding of the quotient. A plane that is not a number cuts nothing.
    """
    low = wp.float32(first)
    high = wp.float32(last)
    hair = 0.01 + 4.0e-7 * wp.float32(length)
    for k in range(3):
        n = planes.n0
        if k == 1:
            n = planes.n1
        if k == 2:
            n = planes.n2
        rest = lines.start[k] + wp.dot(n, d)
        x = -rest * lines.inverse[k]
        if lines.inverse[k] > 0.0:
            if x - hair > low:
                low = x - hair
        elif lines.inverse[k] < 0.0:
            if x + hair < high:
                high = x + hair
        elif rest + bound < 0.0:
            high = -1.0
    return wp.vec2i(
        wp.int32(wp.ceil(wp.min(low, wp.float32(length)))), wp.int32(wp.floor(wp.max(high, -1.0)))
    )


@wp.func
def queue_triangle(
    i: wp.int32,
    box: wp.vec4i,
    tall: wp.bool,
    planes: Planes,
    lines: Lines,
    m: wp.vec3d,
    counts: wp.array(dtype=wp.int32),
    records: wp.array2d(dtype=wp.vec4f),
    depths: wp.array(dtype=wp.vec3d),
    items: wp.array(dtype=wp.vec4i),
):
    """Queue a triangle's rows. An item is (triangle, first row and rows << 16, first column and last << 16, 0).

    Of a tall one its columns: (triangle, first column and columns << 16, first row and last << 16, 1).
    """
    set_entry_of_four(records, i, 0, wp.vec4f(planes.n0[0], planes.n0[1], planes.n0[2], lines.start[0]))
    set_entry_of_four(records, i, 1, wp.vec4f(planes.n1[0], planes.n1[1], planes.n1[2], lines.start[1]))
    set_entry_of_four(records, i, 2, wp.vec4f(planes.n2[0], planes.n2[1], planes.n2[2], lines.start[2]))
    set_entry_of_four(records, i, 3, wp.vec4f(lines.inverse[0], lines.inverse[1], lines.inverse[2], 0.0))
    depths[i] = m
    first = box[1]
    last = box[3]
    along = box[0] | (box[2] << 16)
    if tall:
        first = box[0]
        last = box[2]
        along = box[1] | (box[3] << 16)
    groups = (last - first + GROUP) // GROUP
    at = reserve(counts, ITEMS, groups)
    for g in range(groups):
        if at + g < items.shape[0]:
            y = first + g * GROUP
            rows = wp.min(GROUP, last - y + 1)
            set_entry(items, at + g, wp.vec4i(i, y | (rows << 16), along, wp.int32(tall)))


@wp.func
def box_of(
    a: wp.vec3f,
    b: wp.vec3f,
    c: wp.vec3f,
    o: wp.vec3f,
    axes: wp.array(dtype=wp.vec3f),
    tangents: wp.array(dtype=wp.float32),
    width: wp.int32,
    height: wp.int32,
) -> wp.vec4i:
    """First and last column and row of the pixels that may see the triangle; empty if last < first."""
    ca = camera_space(a, o, axes)
    cb = camera_space(b, o, axes)
    cc = camera_space(c, o, axes)
    # What lies in front of the eye and beside the view has an empty box.
    if not in_front(ca, cb, cc):
        if out_of_view(ca, cb, cc, tangents[0], tangents[1]):
            return wp.vec4i(0, 0, -1, -1)
    return pixel_box(ca, cb, cc, tangents[0], tangents[1], width, height)


@functools.cache
def make_stream_kernel(queued: bool) -> wp.Kernel:
    """One thread a triangle. Small ones test their pixels here; larger ones are queued, or tested all the same (CPU)."""

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def stream_kernel(
        triangle_count: wp.int32,
        share: wp.int32,
        shares: wp.int32,
        width: wp.int32,
        height: wp.int32,
        inline_pixels: wp.int32,
        eye: wp.array(dtype=wp.vec3f),
        axes: wp.array(dtype=wp.vec3f),
        tangents: wp.array(dtype=wp.float32),
        column: wp.array(dtype=wp.vec3f),
        row: wp.array(dtype=wp.vec3f),
        points: wp.array(dtype=wp.vec3f),
        triangles: wp.array(dtype=wp.vec3i),
        valid: wp.array(dtype=wp.uint8),
        alpha: Alpha,
        nearest: wp.array(dtype=wp.uint64),
        counts: wp.array(dtype=wp.int32),
        records: wp.array2d(dtype=wp.vec4f),
        depths: wp.array(dtype=wp.vec3d),
        items: wp.array(dtype=wp.vec4i),
        doubts: wp.array(dtype=wp.vec2i),
    ):
        i = triangle_of(wp.tid(), share, shares)
        if i >= triangle_count:
            return
        # No branch before all is asked for that a box needs: memory answers one load as soon as many.
        face = entry(triangles, i)
        counted = entry(valid, i) != wp.uint8(0)
        o = entry(eye, 0)
        a = entry(points, face[0])
        b = entry(points, face[1])
        c = entry(points, face[2])
        box = box_of(a, b, c, o, axes, tangents, width, height)
        if not counted or box[2] < box[0] or box[3] < box[1]:
            return
        bound = sign_bound(tangents)
        planes = edge_planes(o, a, b, c)
        m = inverse_depth(o, a, b, c)
        sure = bound
        if wp.static(effects.alpha):
            if alpha.masked[i] != wp.uint8(0):
                sure = wp.INF
        if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= inline_pixels:
            offer_box(i, box, planes, bound, sure, m, width, column, row, nearest, counts, doubts)
            return
        tall = wp.bool(False)
        if wp.static(queued):
            tall = box[3] - box[1] >= TALL * (box[2] - box[0] + 1)
        start = entry(column, 0)
        end = entry(column, width - 1)
        length = width
        if tall:
            start = entry(row, 0)
            end = entry(row, height - 1)
            length = height
        lines = lines_of(planes, bound, start, end, length)
        if wp.static(not queued):
            for y in range(box[1], box[3] + 1):
                ends = pixels_of_row(planes, bound, lines, entry(row, y), box[0], box[2], width)
                for x in range(ends[0], ends[1] + 1):
                    offer(
                        y * width + x,
                        i,
                        entry(column, x) + entry(row, y),
                        planes,
                        bound,
                        sure,
                        m,
                        nearest,
                        counts,
                        doubts,
                    )
            return
        queue_triangle(i, box, tall, planes, lines, m, counts, records, depths, items)

    return stream_kernel


@wp.kernel(enable_backward=False, grid_stride=False)
def doubt_kernel(
    threads: wp.int32,
    camera: Camera,
    mesh: Mesh,
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
    alpha: Alpha,
    nearest: wp.array(dtype=wp.uint64),
):
    """(triangle, pixel) pairs that float32 could not decide."""
    k = wp.tid()
    stop = wp.min(counts[DOUBTS], doubts.shape[0])
    while k < stop:
        pair = doubts[k]
        k += threads
        ray = ray_of(camera, pair[1])
        corners = corners_of(mesh, pair[0])
        weld = weld_of(mesh, pair[0])
        t = hit_distance(ray, corners, weld)
        hits = t > wp.float64(0.0)
        if wp.static(effects.alpha):
            if hits:
                hits = opaque_at_hit(alpha, pair[0], ray, corners, weld)
        if hits:
            wp.atomic_max(nearest, pair[1], hit_word(wp.float64(1.0) / t, pair[0]))
