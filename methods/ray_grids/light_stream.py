"""Shadow rays: triangles streamed over the rays in the cells of the light's cube.

The planes through the light and each edge are stored as n . p + c in float32 with a bound on their error over the
whole scene; what they cannot decide goes to ``occludes`` in float64. A set bit stays set, so the order in which
triangles arrive does not matter. Which cells a triangle covers is reckoned relative to the scene's middle in
float32, with a pad that covers its rounding; rays are placed in float64.
"""

from __future__ import annotations

import functools

import warp as wp

from ...harness.alpha import Alpha
from ...harness.specialise import effects
from ..common.reserve import number_in
from ..common.triangle import U32, largest, total
from ..common.wide import read_wide, write_wide
from .entries import entry
from .light_bins import EMPTY, FACES, Cube, cell_index, cells_of, on_face, reach_of
from .light_cells import (
    beyond_face,
    cells_of_row,
    cube_space,
    flat_box,
    on_cells,
    sides_of_flat,
    sides_of_planes,
)
from .light_reach import all_end_before
from .queue import DOUBTS, LARGE


@wp.struct
class Occluder:
    """Inward planes through the light and the edges, and the triangle's plane, positive on the light's side.

    Each is (n, c): signs of n . p + c beyond :func:`sign_bound` are certain for every hit point p of the scene. All
    are zero where float64 must decide.
    """

    e0: wp.vec4f
    e1: wp.vec4f
    e2: wp.vec4f
    plane: wp.vec4f


@wp.func
def occluder_of(light: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> Occluder:
    """Planes in float32: n = (p - light) x (q - p), scaled so that its parts are at most 2.

    A triangle that the light sees edge-on within rounding gets zeros: float64 decides all its candidates.
    """
    la = a - light
    lb = b - light
    lc = c - light
    ab = b - a
    bc = c - b
    ca = a - c
    reach = wp.max(largest(la), wp.max(largest(lb), largest(lc)))
    edge = wp.max(largest(ab), wp.max(largest(bc), largest(ca)))
    o = Occluder()
    if not (reach * edge > 1.0e-30 and reach * edge < 1.0e30 and edge * edge > 1.0e-30):
        return o
    n = wp.cross(ca, ab) / (edge * edge)
    det = wp.dot(n, la)
    if not (wp.abs(det) > 64.0 * U32 * reach):
        return o
    toward = 1.0 / (reach * edge)
    # Inside is positive, and so is the light's side of the triangle.
    if det > 0.0:
        n = -n
    else:
        toward = -toward
    n0 = wp.cross(lb, bc) * toward
    n1 = wp.cross(lc, ca) * toward
    n2 = wp.cross(la, ab) * toward
    o.e0 = wp.vec4f(n0[0], n0[1], n0[2], -wp.dot(n0, b))
    o.e1 = wp.vec4f(n1[0], n1[1], n1[2], -wp.dot(n1, c))
    o.e2 = wp.vec4f(n2[0], n2[1], n2[2], -wp.dot(n2, a))
    o.plane = wp.vec4f(n[0], n[1], n[2], -wp.dot(n, a))
    return o


@wp.func
def sign_bound(size: wp.float32) -> wp.float32:
    """Error of n . h + c, where ``size`` bounds every coordinate of the hit points and of the triangle.

    n is known to 8 u a part; over |h - p|_1 <= 6 size that is 48 u size, and n . h + c rounds by 78 u size more.
    """
    return 128.0 * U32 * size + 1.0e-36


@wp.func
def value_at(plane: wp.vec4f, h: wp.vec4f) -> wp.float32:
    return plane[0] * h[0] + plane[1] * h[1] + plane[2] * h[2] + plane[3]


NO, YES, DOUBTFUL = wp.constant(0), wp.constant(1), wp.constant(2)
"""Verdicts of float32 on a (triangle, ray) pair."""


@wp.func
def verdict(h: wp.vec4f, occluder: Occluder, bound: wp.float32, sure: wp.float32) -> wp.int32:
    """What float32 says of a ray (hit point and pixel) and a triangle.

    A hit beyond ``sure`` is one: the bound, or infinite where the triangle has holes. A ray's own triangle passes
    through its hit point, so it is always among the doubtful.
    """
    low = wp.min(value_at(occluder.e0, h), wp.min(value_at(occluder.e1, h), value_at(occluder.e2, h)))
    side = value_at(occluder.plane, h)
    said = wp.int32(DOUBTFUL)
    if low < -bound or side > bound:
        said = NO
    elif low > sure and side < -sure:
        said = YES
    return said


@wp.func
def left_open(
    said: wp.int32,
    i: wp.int32,
    pixel: wp.int32,
    index: wp.int32,
    triangle: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
) -> wp.bool:
    """Act on a verdict that is not NO: set the ray's bit, or say that the pair is to be left to float64."""
    if said == YES:
        visibility[index, pixel] = wp.uint8(1)
        return False
    return entry(triangle, pixel) != i and visibility[index, pixel] == wp.uint8(0)


@wp.func
def settle(
    said: wp.int32,
    i: wp.int32,
    h: wp.vec4f,
    index: wp.int32,
    triangle: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
):
    """Act on a verdict that is not NO: set the ray's bit, or leave the pair to float64.

    Few pairs are doubtful, but nearly every warp meets one; deciding them on the spot would hold up all its lanes.
    """
    pixel = wp.cast(h[3], wp.int32)
    if left_open(said, i, pixel, index, triangle, visibility):
        place = number_in(counts, DOUBTS)
        if place < doubts.shape[0]:
            write_wide(doubts, place, wp.vec2i(i, pixel))


@wp.func
def shade(
    i: wp.int32,
    h: wp.vec4f,
    index: wp.int32,
    occluder: Occluder,
    bound: wp.float32,
    sure: wp.float32,
    triangle: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
):
    """Test a ray against the triangle and act on what float32 says."""
    said = verdict(h, occluder, bound, sure)
    if said != NO:
        settle(said, i, h, index, triangle, visibility, counts, doubts)


@wp.func
def span_of(
    offset: wp.array(dtype=wp.int32), face: wp.int32, x0: wp.int32, x1: wp.int32, y: wp.int32, cells: wp.int32
) -> wp.vec2i:
    """First ray and end of cells x0..x1 of a row."""
    first = cell_index(face, x0, y, cells)
    return wp.vec2i(entry(offset, first), entry(offset, first + (x1 - x0) + 1))


@wp.func
def set_record(records: wp.array2d(dtype=wp.vec4f), i: wp.int32, occluder: Occluder):
    write_wide(records, i, 0, occluder.e0)
    write_wide(records, i, 1, occluder.e1)
    write_wide(records, i, 2, occluder.e2)
    write_wide(records, i, 3, occluder.plane)


@wp.func
def shade_row(
    i: wp.int32,
    face: wp.int32,
    first: wp.int32,
    last: wp.int32,
    y: wp.int32,
    cells: wp.int32,
    index: wp.int32,
    occluder: Occluder,
    bound: wp.float32,
    sure: wp.float32,
    offset: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec4f),
    triangle: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
):
    """Test the rays in cells first..last of a row."""
    if last >= first:
        span = span_of(offset, face, first, last, y, cells)
        for at in range(span[0], span[1]):
            shade(i, read_wide(rays, at), index, occluder, bound, sure, triangle, visibility, counts, doubts)


INLINE_ROWS = wp.constant(16)
"""A triangle of more rows of cells is queued: its thread would look them up one after the other."""


@wp.func
def shade_box(
    i: wp.int32,
    face: wp.int32,
    box: wp.vec4i,
    cells: wp.int32,
    index: wp.int32,
    occluder: Occluder,
    bound: wp.float32,
    sure: wp.float32,
    offset: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec4f),
    triangle: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
):
    """Test the rays in a box of cells.

    One loop over the rays of all rows, two at a time: in a loop of its own for each row, the lanes of a warp would
    wait for the longest row every time, and for memory at every ray.
    """
    y = wp.int32(box[1])
    span = span_of(offset, face, box[0], box[2], y, cells)
    at = wp.int32(span[0])
    end = wp.int32(span[1])
    while at < end or y < box[3]:
        if at >= end:
            y += 1
            span = span_of(offset, face, box[0], box[2], y, cells)
            at = span[0]
            end = span[1]
        if at < end:
            h = read_wide(rays, at)
            g = wp.vec4f()
            two = at + 1 < end
            if two:
                g = read_wide(rays, at + 1)
            at += 2
            said = verdict(h, occluder, bound, sure)
            other = wp.int32(NO)
            if two:
                other = verdict(g, occluder, bound, sure)
            if said != NO:
                settle(said, i, h, index, triangle, visibility, counts, doubts)
            if other != NO:
                settle(other, i, g, index, triangle, visibility, counts, doubts)


@functools.cache
def make_stream_kernel(queued: bool) -> wp.Kernel:
    """One thread a triangle: few rays are tested here; more are queued, or tested here all the same (CPU).

    A large triangle is (triangle, face, first cell and last << 16, first row and last << 16).
    """

    # 64 registers: a triangle waits for memory more than it reckons, so more of them at a time pays.
    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=64)
    def stream_kernel(
        triangle_count: wp.int32,
        index: wp.int32,
        inline_cells: wp.int32,
        inline_rays: wp.int32,
        lights: wp.array(dtype=wp.vec3f),
        cubes: wp.array(dtype=Cube),
        table: wp.array(dtype=wp.vec4f),
        points: wp.array(dtype=wp.vec3f),
        triangles: wp.array(dtype=wp.vec3i),
        valid: wp.array(dtype=wp.uint8),
        offset: wp.array(dtype=wp.int32),
        rays: wp.array(dtype=wp.vec4f),
        farthest: wp.array(dtype=wp.int32),
        triangle: wp.array(dtype=wp.int32),
        alpha: Alpha,
        visibility: wp.array2d(dtype=wp.uint8),
        counts: wp.array(dtype=wp.int32),
        records: wp.array2d(dtype=wp.vec4f),
        large: wp.array(dtype=wp.vec4i),
        doubts: wp.array(dtype=wp.vec2i),
    ):
        i = wp.tid()
        if i >= triangle_count:
            return
        # Asked for together, no branch between: what is invalid has corners, too, but no face is large enough for it.
        smallest = wp.where(entry(valid, i) != wp.uint8(0), wp.float32(0.0), wp.INF)
        corners = entry(triangles, i)
        a = entry(points, corners[0])
        b = entry(points, corners[1])
        c = entry(points, corners[2])
        cube = cubes[index]
        cells = cells_of(table)
        qa = cube_space(a, cube)
        qb = cube_space(b, cube)
        qc = cube_space(c, cube)
        reach = wp.max(total(a - cube.middle), wp.max(total(b - cube.middle), total(c - cube.middle)))
        slack = 32.0 * U32 * (reach + cube.distance)
        bound = sign_bound(wp.max(reach_of(table), wp.max(largest(a), wp.max(largest(b), largest(c)))))
        sure = bound
        if wp.static(effects.alpha):
            if alpha.masked[i] != wp.uint8(0):
                sure = wp.INF
        # What is tested here is tested after the loop, by all lanes at once whichever their faces. Few triangles have
        # little to do on two faces: the second is queued.
        here = wp.int32(-1)
        box_here = wp.vec4i()
        queued_too = wp.bool(False)
        face = wp.int32(-1)
        while face < FACES - 1:
            face += 1
            r = read_wide(table, face)
            if r[2] > smallest:
                fa = on_face(qa, face)
                fb = on_face(qb, face)
                fc = on_face(qc, face)
                if not beyond_face(fa, fb, fc, slack):
                    flat = on_cells(fa, fb, fc, reach, r)
                    box = wp.vec4i(0, 0, cells - 1, cells - 1)
                    if flat.known:
                        box = flat_box(flat, cells)
                    number = wp.int32(0)
                    # Depths of corners are known to 8 u reach, and receivers' to u of theirs.
                    least = wp.min(fa[0], wp.min(fb[0], fc[0])) - slack
                    if box[2] >= box[0] and not all_end_before(least, farthest, face, box, cells):
                        number = wp.int32(EMPTY)
                        rows = box[3] - box[1] + 1
                        if (box[2] - box[0] + 1) * rows <= inline_cells and rows <= INLINE_ROWS:
                            number = wp.int32(0)
                            for y in range(box[1], box[3] + 1):
                                span = span_of(offset, face, box[0], box[2], y, cells)
                                number += span[1] - span[0]
                    if number > 0:
                        if number <= inline_rays and here < 0:
                            here = face
                            box_here = box
                        else:
                            if wp.static(queued):
                                queued_too = True
                                place = number_in(counts, LARGE)
                                if place < large.shape[0]:
                                    work = wp.vec4i(i, face, box[0] | (box[2] << 16), box[1] | (box[3] << 16))
                                    write_wide(large, place, work)
                            else:
                                if flat.known:
                                    sides = sides_of_flat(flat)
                                else:
                                    sides = sides_of_planes(lights[index], cube, face, a, b, c, r, cells)
                                occluder = occluder_of(lights[index], a, b, c)
                                for y in range(box[1], box[3] + 1):
                                    ends = cells_of_row(sides, y, box[0], box[2])
                                    shade_row(
                                        i, face, ends[0], ends[1], y, cells, index, occluder, bound, sure, offset, rays,
                                        triangle, visibility, counts, doubts,
                                    )  # fmt: skip
        if here >= 0 or queued_too:
            # Corners are read again: kept, they would take the registers of the loop.
            again = entry(triangles, i)
            occluder = occluder_of(
                lights[index], entry(points, again[0]), entry(points, again[1]), entry(points, again[2])
            )
            if queued_too:
                set_record(records, i, occluder)
            if here >= 0:
                shade_box(
                    i, here, box_here, cells, index, occluder, bound, sure, offset, rays, triangle, visibility, counts,
                    doubts,
                )  # fmt: skip

    return stream_kernel
