"""A triangle against the shadow rays in some cells: planes through the light in float32, with a bound on their error.

Each plane is n . p + c, with a bound on what float32 does to it at any hit point of the frame. A set bit stays set, so
the order in which triangles arrive does not matter. What the planes cannot decide is left to ``occludes`` in float64
(:mod:`.light.queue`).
"""

from __future__ import annotations

import warp as wp

from ...common.entries import entry, set_entry
from ...common.reserve import number_in
from ...common.triangle import U32, largest
from ..queues import DOUBTS
from .bins import reach_of, span_of


@wp.struct
class Occluder:
    """Inward planes through the light and the edges, and the triangle's plane, positive on the light's side.

    Each is (n, c): signs of n . p + c beyond :func:`sign_bound` are certain for every hit point p of the frame. All
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
def bound_of(table: wp.array(dtype=wp.vec4f), a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.float32:
    """:func:`sign_bound` of a triangle and every hit point of a light."""
    return sign_bound(wp.max(reach_of(table), wp.max(largest(a), wp.max(largest(b), largest(c)))))


@wp.func
def value_at(plane: wp.vec4f, h: wp.vec4f) -> wp.float32:
    """n . h + c."""
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
            set_entry(doubts, place, wp.vec2i(i, pixel))


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
def set_record(records: wp.array2d(dtype=wp.vec4f), i: wp.int32, occluder: Occluder):
    """Keep the planes of a triangle that is queued, four words a plane."""
    set_entry(records, i, 0, occluder.e0)
    set_entry(records, i, 1, occluder.e1)
    set_entry(records, i, 2, occluder.e2)
    set_entry(records, i, 3, occluder.plane)


@wp.func
def occluder_at(records: wp.array2d(dtype=wp.vec4f), i: wp.int32) -> Occluder:
    """The planes that :func:`set_record` kept."""
    occluder = Occluder()
    occluder.e0 = entry(records, i, 0)
    occluder.e1 = entry(records, i, 1)
    occluder.e2 = entry(records, i, 2)
    occluder.plane = entry(records, i, 3)
    return occluder


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
            shade(i, entry(rays, at), index, occluder, bound, sure, triangle, visibility, counts, doubts)


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
            h = entry(rays, at)
            g = wp.vec4f()
            two = at + 1 < end
            if two:
                g = entry(rays, at + 1)
            at += 2
            said = verdict(h, occluder, bound, sure)
            other = wp.int32(NO)
            if two:
                other = verdict(g, occluder, bound, sure)
            if said != NO:
                settle(said, i, h, index, triangle, visibility, counts, doubts)
            if other != NO:
                settle(other, i, g, index, triangle, visibility, counts, doubts)
