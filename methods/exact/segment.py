"""The shadow test that all exact methods share: float32 rejects, float64 decides, as :mod:`.triangle` does for rays.

A shadow ray is the open segment from a hit point to a light. It is tested against planes through the light and each
edge, since all shadow rays of a light meet there, evaluated relative to an end of the edge, so that the test is valid at
any distance of the light. The hit point is float64 and rounded; each test states the error of it that its bound covers.
"""

import warp as wp

from ...harness.frame.digits import wide_side
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Corners
from .hit_point import hit_error, wide_hit_error
from .triangle import (
    CLOSED,
    FLOOR32,
    OVERFLOW,
    U32,
    U64,
    UNDERFLOW,
    certainly_outside,
    largest,
    to_float32,
    to_float64,
    total,
)  # fmt: skip


@wp.func
def may_occlude(h: wp.vec3f, light: wp.vec3f, corners: Corners, h_error: wp.float32) -> wp.bool:
    """False only if the open segment h-light certainly misses the triangle.

    Planes through the light and each edge, evaluated relative to an end of the edge: valid at any distance of the light.
    ``h_error`` bounds |h - the float64 hit point| in each coordinate.
    """
    la = corners.a - light
    lb = corners.b - light
    lc = corners.c - light
    ab = corners.b - corners.a
    bc = corners.c - corners.b
    ca = corners.a - corners.c
    ha = h - corners.a
    hb = h - corners.b
    hc = h - corners.c
    edge = wp.max(largest(ab), wp.max(largest(bc), largest(ca)))
    reach = wp.max(total(ha), wp.max(total(hb), total(hc)))
    from_light = wp.max(largest(la), wp.max(largest(lb), largest(lc)))
    # Where the normals of the planes lose digits, or vanish, that shows in proportion to the way to the hit point.
    normal = from_light * edge + UNDERFLOW
    if not (normal * reach < OVERFLOW):
        return True
    bound = normal * (16.0 * U32 * reach + 8.0 * h_error) + FLOOR32
    if certainly_outside(
        wp.dot(wp.cross(lb, bc), hb), wp.dot(wp.cross(lc, ca), hc), wp.dot(wp.cross(la, ab), ha), bound
    ):
        return False
    # Both ends certainly on the same side of the triangle's plane.
    n = wp.cross(ab, ca)
    side_h = wp.dot(n, ha)
    side_l = -wp.dot(n, la)
    square = edge * edge + UNDERFLOW
    bound_h = square * (16.0 * U32 * reach + 8.0 * h_error) + FLOOR32
    bound_l = square * 48.0 * U32 * from_light + FLOOR32
    if (side_h > bound_h and side_l > bound_l) or (side_h < -bound_h and side_l < -bound_l):
        return False
    return True


@wp.func
def side_of_light(light: wp.vec3f, corners: Corners) -> wp.float32:
    """On which side of a triangle's plane the light lies, 1 or -1 as the sign of (ab x ac) . (a - light); 0 if the plane
    contains it within rounding, so that the triangle occludes no ray.
    """
    a = to_float64(corners.a)
    ab = to_float64(corners.b) - a
    ac = to_float64(corners.c) - a
    la = a - to_float64(light)
    side = wp.dot(wp.cross(ab, ac), la)
    doubt = wp.float64(16.0) * U64 * largest(ab) * largest(ac) * total(la)
    if wp.static(effects.wide):
        side = -wide_side(corners.a, corners.b, corners.c, to_float64(light))
        doubt = wp.float64(0.0)
    if wp.abs(side) <= doubt:
        return 0.0
    return wp.where(side > wp.float64(0.0), 1.0, -1.0)


@wp.func
def plane_crosses_segment(h: wp.vec3d, light: wp.vec3f, corners: Corners, origin_size: wp.float64) -> wp.bool:
    """Whether the plane of the triangle crosses the open segment from the hit point h to the light.

    A plane that h may lie in, given the error of h (:func:`.hit_point.hit_error`), does not count as crossing, nor does
    one that contains the light within rounding. ``origin_size`` is the largest coordinate of the origin of the ray that
    found h.
    """
    a = to_float64(corners.a)
    ab = to_float64(corners.b) - a
    ac = to_float64(corners.c) - a
    n = wp.cross(ab, ac)
    ha = h - a
    la = to_float64(light) - a
    side_h = wp.dot(n, ha)
    side_l = wp.dot(n, la)
    rounding = wp.float64(16.0) * U64 * largest(ab) * largest(ac)
    own = total(n) * hit_error(h, origin_size)
    if wp.static(effects.wide):
        side_h = wide_side(corners.a, corners.b, corners.c, h)
        side_l = wide_side(corners.a, corners.b, corners.c, to_float64(light))
        rounding = wp.float64(0.0)
        own = wide_hit_error(n, h, origin_size)
    if wp.abs(side_h) <= own + rounding * total(ha):
        return False
    if wp.abs(side_l) <= rounding * total(la):
        return False
    return (side_h > wp.float64(0.0)) != (side_l > wp.float64(0.0))


@wp.func
def occludes(h: wp.vec3d, light: wp.vec3f, corners: Corners, weld: wp.vec3i, origin_size: wp.float64) -> wp.bool:
    """Whether the triangle meets the open segment from the hit point h to the light. Float64.

    A triangle whose plane passes h within its error contains it (its own triangle, duplicates, neighbours at an edge)
    and does not count: see :func:`plane_crosses_segment`.
    """
    if not plane_crosses_segment(h, light, corners, origin_size):
        return False
    l64 = to_float64(light)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    e = light_edge_functions(l64, h, a64, b64, c64, weld)
    if wp.static(effects.wide):
        # The light may be near one edge and far from the others: each has its own doubt.
        doubt = light_edge_errors(h, l64, a64, b64, c64, origin_size)
        share = wp.abs(e[0] + e[1] + e[2]) * CLOSED
        for k in range(3):
            if wp.abs(e[k]) <= wp.min(share, doubt[k]):
                e[k] = wp.float64(0.0)
        return wp.min(e[0], wp.min(e[1], e[2])) >= wp.float64(0.0) or (
            wp.max(e[0], wp.max(e[1], e[2])) <= wp.float64(0.0)
        )
    low = wp.min(e[0], wp.min(e[1], e[2]))
    high = wp.max(e[0], wp.max(e[1], e[2]))
    slack = wp.abs(e[0] + e[1] + e[2]) * CLOSED
    if low < wp.float64(0.0) and high > wp.float64(0.0) and (low >= -slack or high <= slack):
        slack = wp.min(slack, light_edge_error(h, l64, a64, b64, c64, origin_size))
    else:
        slack = wp.float64(0.0)
    return low >= -slack or high <= slack


@wp.func
def light_edge_error(
    h: wp.vec3d, light: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, origin_size: wp.float64
) -> wp.float64:
    """Bound on the error of :func:`light_edge_functions`: their own rounding, and that of h."""
    edge = wp.max(largest(b - a), wp.max(largest(c - b), largest(a - c)))
    reach = wp.max(total(h - a), wp.max(total(h - b), total(h - c)))
    from_light = wp.max(largest(a - light), wp.max(largest(b - light), largest(c - light)))
    if wp.static(effects.wide):
        return largest(light_edge_errors(h, light, a, b, c, origin_size))
    return from_light * edge * (wp.float64(16.0) * U64 * reach + wp.float64(6.0) * hit_error(h, origin_size))


@wp.func
def light_edge_errors(
    h: wp.vec3d, light: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, origin_size: wp.float64
) -> wp.vec3d:
    """What the error of h does to each of :func:`light_edge_functions`, in a wide frame."""
    return wp.vec3d(
        wide_hit_error(wp.cross(b - light, c - b), h, origin_size),
        wide_hit_error(wp.cross(c - light, a - c), h, origin_size),
        wide_hit_error(wp.cross(a - light, b - a), h, origin_size),
    )


@wp.func
def light_edge_function(
    light: wp.vec3d, h: wp.vec3d, p: wp.vec3d, q: wp.vec3d, weld_p: wp.int32, weld_q: wp.int32
) -> wp.float64:
    """(h - p) . ((p - light) x (q - p)), taken from the vertex with the lower weld index."""
    ordered = weld_p < weld_q
    first = wp.where(ordered, p, q)
    value = wp.dot(wp.cross(first - light, wp.where(ordered, q, p) - first), h - first)
    return wp.where(ordered, value, -value)


@wp.func
def wide_light_edge(light: wp.vec3d, h: wp.vec3d, p: wp.vec3d, q: wp.vec3d) -> wp.float64:
    """:func:`light_edge_function` to 2^-51 of itself; all but h are float32 numbers."""
    return wide_side(to_float32(light), to_float32(p), to_float32(q), h)


@wp.func
def light_edge_functions(
    light: wp.vec3d, h: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, weld: wp.vec3i
) -> wp.vec3d:
    """The planes through the light and the edges opposite to a, b and c, evaluated at h."""
    if wp.static(effects.wide):
        return wp.vec3d(
            wide_light_edge(light, h, b, c), wide_light_edge(light, h, c, a), wide_light_edge(light, h, a, b)
        )
    return wp.vec3d(
        light_edge_function(light, h, b, c, weld[1], weld[2]),
        light_edge_function(light, h, c, a, weld[2], weld[0]),
        light_edge_function(light, h, a, b, weld[0], weld[1]),
    )
