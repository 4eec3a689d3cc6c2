"""Float32 tests of a shadow segment against a triangle, on a record made once per frame and light.

The same three tests as :mod:`.camera.ray_tests`. The verdict is NO, YES, or UNDECIDED, which float64 decides; only the
exact test returns YES. Which side of the triangle's plane the ends lie on is never decided by float32 in doubt.

exact        four planes n . h + c, the bound on their rounding the same for all: 16 multiply-adds
edge_planes  planes through the light and each edge, evaluated relative to the scene, n . (h - p) with p the edge's
             vertex of lower weld index: right at any distance of the light
"""

import warp as wp

from ....harness.frame.geometry import Corners
from ...exact.planes import edge_plane, facing_to, farthest_corner, longest_edge, normal_through, plane_at
from ...exact.segment import light_edge_functions, occludes, plane_crosses_segment
from ...exact.triangle import FLOOR32, U32, certainly_outside, largest, to_float64, total
from ...gpu.entries import set_entry
from ..camera.ray_tests import EDGE_PLANES, EXACT, MOLLER_TRUMBORE, dot3, first3, joined, moller_trumbore, near_inside

USED = (4, 6, 3)
"""By test: how many vec4f of a triangle's record it reads, of 6."""

NO = wp.constant(0)
UNDECIDED = wp.constant(1)
YES = wp.constant(2)

PLANE_BOUND = wp.constant(160.0 * 2.0**-24)
"""Bound on the rounding of the exact test's planes, which are scaled to it: see :func:`segment_exact`."""


@wp.struct
class SegmentRecord:
    """Exact: q0, q1, q2 inward planes (n, c) through the light and the edges; q3 the triangle's, positive at the light.
    All zero where float32 does not know which side is inward, so that everything is in doubt.

    Edge planes: vertices in weld order v0, v1, v2
    q0: v0, scale of the plane values' error     q1: v1, square of the longest edge
    q2, q3, q4: planes through the light and v0-v1, v0-v2, v1-v2; q2.w: side of the light, 0 where not certain
    q5: normal of the triangle

    Moeller-Trumbore, vertices in their own order: q0: v0   q1: v1 - v0, square of the longest edge   q2: v2 - v0
    """

    q0: wp.vec4f
    q1: wp.vec4f
    q2: wp.vec4f
    q3: wp.vec4f
    q4: wp.vec4f
    q5: wp.vec4f


@wp.func
def segment_exact(light: wp.vec3f, corners: Corners, size: wp.float32) -> SegmentRecord:
    """``size`` bounds every coordinate of the hit points.

    Normals are scaled so that their parts are at most 2, and known to 8 u per component (:mod:`...exact.planes`). Where all
    coordinates are at most s, |h - p|_1 <= 6 s: that is 48 u s. Rounding h moves the value by 6 u s, and n . h + c rounds
    by 60 u s; dividing all by s costs 18 u more. So 132 u bounds the error of the scaled planes, relative to the scene
    and right at any distance of the light. The triangle's own plane is known as well.
    """
    within = wp.max(size, wp.max(largest(corners.a), wp.max(largest(corners.b), largest(corners.c))))
    facing = facing_to(light, corners, False)
    r = SegmentRecord()
    if facing.toward == 0.0 or not (within < 1.0e30):
        return r
    scale = 1.0 / within
    r.q0 = edge_plane(light, corners.b, corners.c, facing.toward) * scale
    r.q1 = edge_plane(light, corners.c, corners.a, facing.toward) * scale
    r.q2 = edge_plane(light, corners.a, corners.b, facing.toward) * scale
    r.q3 = plane_at(facing.normal, corners.a) * scale
    return r


@wp.func
def segment_planes(light: wp.vec3f, corners: Corners, weld: wp.vec3i) -> SegmentRecord:
    v0 = corners.a
    v1 = corners.b
    v2 = corners.c
    w0 = weld[0]
    w1 = weld[1]
    if w1 < w0:
        v0 = corners.b
        v1 = corners.a
        w0 = weld[1]
        w1 = weld[0]
    if weld[2] < w1:
        v2 = v1
        v1 = corners.c
        w1 = weld[2]
    if w1 < w0:
        swapped = v0
        v0 = v1
        v1 = swapped
    n = wp.cross(v1 - v0, v2 - v0)
    edge = longest_edge(corners)
    reach = farthest_corner(light, corners)
    side = -wp.dot(n, v0 - light)
    bound = edge * edge * 48.0 * U32 * reach + FLOOR32
    certain = wp.float32(0.0)
    if side > bound:
        certain = 1.0
    if side < -bound:
        certain = -1.0
    r = SegmentRecord()
    r.q0 = joined(v0, reach * edge)
    r.q1 = joined(v1, edge * edge)
    r.q2 = joined(normal_through(light, v0, v1), certain)
    r.q3 = joined(normal_through(light, v0, v2), 0.0)
    r.q4 = joined(normal_through(light, v1, v2), 0.0)
    r.q5 = joined(n, 0.0)
    return r


@wp.func
def segment_vertices(corners: Corners) -> SegmentRecord:
    edge = longest_edge(corners)
    r = SegmentRecord()
    r.q0 = joined(corners.a, 0.0)
    r.q1 = joined(corners.b - corners.a, edge * edge)
    r.q2 = joined(corners.c - corners.a, 0.0)
    return r


@wp.func
def write_record(
    records: wp.array(dtype=wp.vec4f), i: wp.int32, test: wp.int32, light: wp.vec3f, corners: Corners, weld: wp.vec3i,
    size: wp.float32,
):  # fmt: skip
    """The record of triangle i for a test; ``size``: see :func:`segment_exact`."""
    r = SegmentRecord()
    if test == EXACT:
        r = segment_exact(light, corners, size)
    elif test == EDGE_PLANES:
        r = segment_planes(light, corners, weld)
    else:
        r = segment_vertices(corners)
    set_entry(records, 6 * i, r.q0)
    set_entry(records, 6 * i + 1, r.q1)
    set_entry(records, 6 * i + 2, r.q2)
    if test != MOLLER_TRUMBORE:
        set_entry(records, 6 * i + 3, r.q3)
    if test == EDGE_PLANES:
        set_entry(records, 6 * i + 4, r.q4)
        set_entry(records, 6 * i + 5, r.q5)


@wp.func
def value_at(plane: wp.vec4f, h: wp.vec3f) -> wp.float32:
    return dot3(plane, h) + plane[3]


@wp.func
def segment_bounded(h: wp.vec3f, light: wp.vec3f, h_error: wp.float32, r: SegmentRecord) -> wp.int32:
    """Whether the open segment h-light meets the triangle: where no plane is in doubt, float32 is enough."""
    low = wp.min(value_at(r.q0, h), wp.min(value_at(r.q1, h), value_at(r.q2, h)))
    side = value_at(r.q3, h)
    if low < -PLANE_BOUND or side > PLANE_BOUND:
        return NO
    if low > PLANE_BOUND and side < -PLANE_BOUND:
        return YES
    return UNDECIDED


@wp.func
def segment_plain(h: wp.vec3f, light: wp.vec3f, h_error: wp.float32, r: SegmentRecord) -> wp.int32:
    """Plain signs at the edges; at the ends only sides that are certain."""
    h0 = h - first3(r.q0)
    h1 = h - first3(r.q1)
    if certainly_outside(dot3(r.q2, h0), -dot3(r.q3, h0), dot3(r.q4, h1), 0.0):
        return NO
    doubt = 20.0 * U32 * wp.max(total(h0), total(h1)) + 8.0 * h_error
    side = dot3(r.q5, h0) * r.q2[3]
    if side > r.q1[3] * doubt + FLOOR32:
        return NO
    return UNDECIDED


@wp.func
def segment_moller_trumbore(h: wp.vec3f, light: wp.vec3f, h_error: wp.float32, r: SegmentRecord) -> wp.int32:
    """From the surface to the light. Hits slightly beyond the light, and those near the start, are left to float64."""
    s = h - first3(r.q0)
    inside, det, start = moller_trumbore(s, light - h, first3(r.q1), first3(r.q2))
    if not inside:
        return NO
    if det < 0.0:
        start = -start
    if start < -(r.q1[3] * (20.0 * U32 * total(s) + 8.0 * h_error) + FLOOR32):
        return NO
    if start > 1.001 * wp.abs(det):
        return NO
    return UNDECIDED


@wp.func
def occludes_near(h: wp.vec3d, light: wp.vec3f, corners: Corners, weld: wp.vec3i, origin_size: wp.float64) -> wp.bool:
    """As ``occludes``, but within the tolerance of the triangle rather than in it."""
    l64 = to_float64(light)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    if not plane_crosses_segment(h, light, corners, origin_size):
        return False
    return near_inside(light_edge_functions(l64, h, a64, b64, c64, weld))


SEGMENT_PASSES = (segment_bounded, segment_plain, segment_moller_trumbore)
SEGMENT_DECIDES = (occludes, occludes_near, occludes_near)
"""By test: judge in float32, decide the doubtful in float64."""
