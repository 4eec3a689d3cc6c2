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
from ...gpu.entries import entry, entry_now, entry_of_four, raise_entry, set_entry, set_entry_of_four
from ...gpu.reserve import reserve
from ..queues import ITEMS, Queue, Share, held_undecided, triangle_of
from .pixels import Candidate, Planes, candidate_of, hit_word, inverse_depth, sure_of, test_box

GROUP = wp.constant(32)
"""Rows or columns of a work item: the 32 lanes of the GPU's warp find the ends of one each."""

TALL = wp.constant(2)
"""A queued box whose height is this multiple of its width is cut into columns, which are fewer and longer than its
rows.
"""

REGISTERS = 64
"""Registers per thread of the kernel over all triangles, for eight blocks of 128 per multiprocessor."""


@wp.struct
class Lines:
    """A triangle's edge planes along a row of pixels: start + n . row[y] + x / inverse; inverse 0: practically constant.

    Along a column, where rows are ``tall``, likewise: start + n . column[x] + y / inverse. bound: of the planes' error.
    """

    planes: Planes
    bound: wp.float32
    start: wp.vec3f
    inverse: wp.vec3f
    tall: wp.bool


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
def lines_of(planes: Planes, bound: wp.float32, tall: wp.bool, camera: Camera) -> Lines:
    """Along rows, or where ``tall`` along columns."""
    first = entry(camera.column, 0)
    last = entry(camera.column, camera.width - 1)
    length = camera.width
    if tall:
        first = entry(camera.row, 0)
        last = entry(camera.row, camera.height - 1)
        length = camera.height
    l0 = plane_line(planes.n0, bound, first, last, length)
    l1 = plane_line(planes.n1, bound, first, last, length)
    l2 = plane_line(planes.n2, bound, first, last, length)
    lines = Lines()
    lines.planes = planes
    lines.bound = bound
    lines.start = wp.vec3f(l0[0], l1[0], l2[0])
    lines.inverse = wp.vec3f(l0[1], l1[1], l2[1])
    lines.tall = tall
    return lines


@wp.func
def ends_of_line(lines: Lines, line: wp.int32, first: wp.int32, last: wp.int32, camera: Camera) -> wp.vec2i:
    """First and last pixel of first..last in a row, or column, that are not certainly outside an edge plane.

    ``margin`` covers the rounding of the quotient. A plane that is not a number leaves nothing out.
    """
    d = wp.vec3f()
    if lines.tall:
        d = entry(camera.column, line)
    else:
        d = entry(camera.row, line)
    length = wp.where(lines.tall, camera.height, camera.width)
    low = wp.float32(first)
    high = wp.float32(last)
    margin = 0.01 + 4.0e-7 * wp.float32(length)
    for k in range(3):
        n = lines.planes.n0
        if k == 1:
            n = lines.planes.n1
        if k == 2:
            n = lines.planes.n2
        rest = lines.start[k] + wp.dot(n, d)
        x = -rest * lines.inverse[k]
        if lines.inverse[k] > 0.0:
            if x - margin > low:
                low = x - margin
        elif lines.inverse[k] < 0.0:
            if x + margin < high:
                high = x + margin
        elif rest + lines.bound < 0.0:
            high = -1.0
    return wp.vec2i(wp.int32(wp.ceil(wp.min(low, wp.float32(length)))), wp.int32(wp.floor(wp.max(high, -1.0))))


@wp.func
def store_candidate(queue: Queue, candidate: Candidate, more: wp.vec3f):
    """Store the planes of a queued triangle and its 1 / t, and a number ``more`` of each plane."""
    n0 = candidate.planes.n0
    n1 = candidate.planes.n1
    n2 = candidate.planes.n2
    set_entry_of_four(queue.records, candidate.i, 0, wp.vec4f(n0[0], n0[1], n0[2], more[0]))
    set_entry_of_four(queue.records, candidate.i, 1, wp.vec4f(n1[0], n1[1], n1[2], more[1]))
    set_entry_of_four(queue.records, candidate.i, 2, wp.vec4f(n2[0], n2[1], n2[2], more[2]))
    queue.depths[candidate.i] = candidate.m


@wp.func
def stored_planes(queue: Queue, i: wp.int32) -> tuple[Planes, wp.vec3f]:
    """What :func:`store_candidate` stored of the planes."""
    r0 = entry_of_four(queue.records, i, 0)
    r1 = entry_of_four(queue.records, i, 1)
    r2 = entry_of_four(queue.records, i, 2)
    planes = Planes()
    planes.n0 = wp.vec3f(r0[0], r0[1], r0[2])
    planes.n1 = wp.vec3f(r1[0], r1[1], r1[2])
    planes.n2 = wp.vec3f(r2[0], r2[1], r2[2])
    return planes, wp.vec3f(r0[3], r1[3], r2[3])


@wp.func
def stored_candidate(
    queue: Queue, i: wp.int32, planes: Planes, spare: wp.int32, bound: wp.float32, alpha: Alpha
) -> Candidate:
    """A queued triangle as pixels are tested against it, with its :func:`stored_planes`."""
    candidate = Candidate()
    candidate.i = i
    candidate.spare = spare
    candidate.bound = bound
    candidate.sure = sure_of(i, bound, alpha)
    candidate.m = entry_now(queue.depths, i)
    candidate.planes = planes
    return candidate


@wp.func
def queue_rows(queue: Queue, box: wp.vec4i, candidate: Candidate, camera: Camera):
    """Queue a triangle's rows. An item is (triangle, first row and rows << 16, first column and last << 16, 0), or of
    columns (triangle, first column and columns << 16, first row and last << 16, 1).
    """
    i = candidate.i
    tall = box[3] - box[1] >= TALL * (box[2] - box[0] + 1)
    lines = lines_of(candidate.planes, candidate.bound, tall, camera)
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
def make_stream_kernel(queue_larger: wp.Function = queue_rows, registers: int | None = REGISTERS) -> wp.Kernel:
    """One thread per triangle. Small triangles test their pixels here; larger ones are queued."""

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
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
        queue_larger(queue, box, candidate, camera)

    return stream_kernel


@wp.func
def hit_of(pair: wp.vec2i, camera: Camera, mesh: Mesh, alpha: Alpha) -> tuple[wp.bool, wp.float64]:
    """Whether a triangle is hit by the ray of a pixel, which float32 could not decide; and 1 / t."""
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
    return hits, inverse


@wp.kernel(enable_backward=False, grid_stride=False)
def undecided_kernel(
    threads: wp.int32, camera: Camera, mesh: Mesh, alpha: Alpha, nearest: wp.array(dtype=wp.uint64), queue: Queue
):
    """(triangle, pixel) pairs that float32 could not decide."""
    k = wp.tid()
    stop = held_undecided(queue, k)
    spare = spare_bits(mesh.triangles.shape[0])
    while k < stop:
        hits, inverse = hit_of(entry(queue.undecided, k), camera, mesh, alpha)
        if hits:
            # The pair is read again: if registers held it until here, one block of threads fewer would fit.
            again = entry(queue.undecided, k)
            raise_entry(nearest, again[1], hit_word(inverse, again[0], spare))
        k += threads
