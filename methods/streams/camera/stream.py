"""Primary rays: one ray per pixel lies in the grid; triangles are streamed over it.

How a pixel is tested, and what is stored for it, is in :mod:`.pixels`.
"""

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Corners, Mesh
from ...common.reads import corners_at, ray_of_pixel, weld_at
from ...common.screen import camera_space, in_front, out_of_view, pixel_box
from ...exact.holes import opaque_at_hit
from ...exact.triangle import hit_distance, spare_bits, to_float64
from ...gpu.entries import entry, raise_entry, set_entry, set_entry_of_four
from ...gpu.reserve import reserve
from ..queues import ITEMS, Queue, Share, held_undecided, triangle_of
from .pixels import Candidate, Planes, candidate_of, hit_word, inverse_depth, test_box
from .queued import store_candidate

GROUP = wp.constant(32)
"""Rows or columns of a work item: the 32 lanes of the GPU's warp find the ends of one each."""

TALL = wp.constant(2)
"""A queued box whose height is this multiple of its width is cut into columns, which are fewer and longer than its
rows."""

REGISTERS = 64
"""Registers per thread of the kernel over all triangles, for eight blocks of 128 per multiprocessor."""


@wp.struct
class Lines:
    """The edge planes along a row of pixels: start + n . row[y] + x / inverse; inverse 0: practically constant.

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
    planes: Planes, bound: wp.float32, lines: Lines, d: wp.vec3f, first: wp.int32, last: wp.int32, length: wp.int32
) -> wp.vec2i:
    """First and last pixel of first..last that are not certainly outside an edge plane, in the row of direction d.

    Or in the column; ``length``: pixels along the whole of it.
    ``margin`` covers the rounding of the quotient. A plane that is not a number leaves nothing out.
    """
    low = wp.float32(first)
    high = wp.float32(last)
    margin = 0.01 + 4.0e-7 * wp.float32(length)
    for k in range(3):
        n = planes.n0
        if k == 1:
            n = planes.n1
        if k == 2:
            n = planes.n2
        rest = lines.start[k] + wp.dot(n, d)
        x = -rest * lines.inverse[k]
        if lines.inverse[k] > 0.0:
            if x - margin > low:
                low = x - margin
        elif lines.inverse[k] < 0.0:
            if x + margin < high:
                high = x + margin
        elif rest + bound < 0.0:
            high = -1.0
    return wp.vec2i(wp.int32(wp.ceil(wp.min(low, wp.float32(length)))), wp.int32(wp.floor(wp.max(high, -1.0))))


@wp.func
def queue_triangle(queue: Queue, box: wp.vec4i, tall: wp.bool, candidate: Candidate, lines: Lines):
    """Queue a triangle's rows. An item is (triangle, first row and rows << 16, first column and last << 16, 0).

    For a tall triangle its columns: (triangle, first column and columns << 16, first row and last << 16, 1).
    """
    i = candidate.i
    store_candidate(queue, candidate, lines.start)
    set_entry_of_four(queue.records, i, 3, wp.vec4f(lines.inverse[0], lines.inverse[1], lines.inverse[2], 0.0))
    first = box[1]
    last = box[3]
    along = box[0] | (box[2] << 16)
    if tall:
        first = box[0]
        last = box[2]
        along = box[1] | (box[3] << 16)
    groups = (last - first + GROUP) // GROUP
    at = reserve(queue.counts, ITEMS, groups)
    for g in range(groups):
        if at + g < queue.items.shape[0]:
            y = first + g * GROUP
            rows = wp.min(GROUP, last - y + 1)
            set_entry(queue.items, at + g, wp.vec4i(i, y | (rows << 16), along, wp.int32(tall)))


@wp.func
def box_of(corners: Corners, o: wp.vec3f, camera: Camera) -> wp.vec4i:
    """First and last column and row of the pixels that may see the triangle; empty if last < first."""
    a = camera_space(corners.a, o, camera.axes)
    b = camera_space(corners.b, o, camera.axes)
    c = camera_space(corners.c, o, camera.axes)
    # A triangle in front of the eye but outside the view has an empty box.
    if not in_front(a, b, c):
        if out_of_view(a, b, c, camera.tangents[0], camera.tangents[1]):
            return wp.vec4i(0, 0, -1, -1)
    return pixel_box(a, b, c, camera.tangents[0], camera.tangents[1], camera.width, camera.height)


@functools.cache
def make_stream_kernel() -> wp.Kernel:
    """One thread per triangle. Small triangles test their pixels here; larger ones are queued."""

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def stream_kernel(
        share: Share,
        inline_pixels: wp.int32,
        camera: Camera,
        mesh: Mesh,
        alpha: Alpha,
        nearest: wp.array(dtype=wp.uint64),
        exact_path: wp.array(dtype=wp.uint8),
        queue: Queue,
    ):
        i = triangle_of(wp.tid(), share)
        if i >= share.triangles:
            return
        # All loads that a box needs come before the first branch: many loads take no longer than one.
        face = entry(mesh.triangles, i)
        counted = entry(mesh.valid, i) != wp.uint8(0)
        o = entry(camera.eye, 0)
        corners = Corners(entry(mesh.points, face[0]), entry(mesh.points, face[1]), entry(mesh.points, face[2]))
        box = box_of(corners, o, camera)
        if not counted or box[2] < box[0] or box[3] < box[1]:
            return
        candidate = candidate_of(i, o, corners, camera, alpha, share.triangles, exact_path)
        if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= inline_pixels:
            test_box(nearest, queue, box, candidate, camera)
            return
        tall = box[3] - box[1] >= TALL * (box[2] - box[0] + 1)
        start = entry(camera.column, 0)
        end = entry(camera.column, camera.width - 1)
        length = camera.width
        if tall:
            start = entry(camera.row, 0)
            end = entry(camera.row, camera.height - 1)
            length = camera.height
        lines = lines_of(candidate.planes, candidate.bound, start, end, length)
        queue_triangle(queue, box, tall, candidate, lines)

    return stream_kernel


@wp.kernel(enable_backward=False, grid_stride=False)
def undecided_kernel(
    threads: wp.int32, camera: Camera, mesh: Mesh, alpha: Alpha, nearest: wp.array(dtype=wp.uint64), queue: Queue
):
    """(triangle, pixel) pairs that float32 could not decide."""
    k = wp.tid()
    stop = held_undecided(queue, k)
    spare = spare_bits(mesh.triangles.shape[0])
    while k < stop:
        pair = entry(queue.undecided, k)
        i = pair[0]
        ray = ray_of_pixel(camera, pair[1])
        corners = corners_at(mesh, i)
        weld = weld_at(mesh, i)
        t = hit_distance(ray, corners, weld)
        hits = t > wp.float64(0.0)
        inverse = wp.float64(1.0) / t
        if wp.static(effects.alpha):
            if hits:
                hits = opaque_at_hit(alpha, i, ray, corners, weld)
                # To the last bit as of a duplicate without holes, which float32 decides.
                inverse = wp.dot(inverse_depth(ray.origin, corners), to_float64(ray.direction))
        if hits:
            # The pair is read again: if registers held it until here, one block of threads fewer would fit.
            again = entry(queue.undecided, k)
            raise_entry(nearest, again[1], hit_word(inverse, again[0], spare))
        k += threads
