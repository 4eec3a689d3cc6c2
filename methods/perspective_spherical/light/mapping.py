"""Three maps from directions at a light to rectangles: where a ray lands, and what a triangle may cover. Float64.

Light's frame: x forward, y right, z up. The maps, and the rectangle of each:

0 azimuth-elevation  (atan2(y, x), atan2(z, hypot(x, y))): one rectangle, seam at azimuth +-pi, two poles
                     (:mod:`.light.sphere`)
1 two-angle          (atan2(y, x), atan2(z, x)), as the paper words it: one rectangle; the circle x = 0 collapses to
                     four points, so that what crosses it covers the whole rectangle
2 cube               (y / x, z / x) in each of six faces (Hunt & Mark 2008): six rectangles, straight edges

A ray from the light has one place. Triangle bounds hold the place of every ray that meets the triangle, where the
rays' places are known to ``pad``: as a share of the distance, for directions.
"""

from __future__ import annotations

import warp as wp

from ...exact.triangle import largest, to_float32
from .sphere import HALF_PI, PI, ROUNDING, angles, triangle_angles, wrapped

AZIMUTH_ELEVATION, TWO_ANGLE, CUBE = 0, 1, 2

FLAT = wp.constant(wp.float64(1.0e-4))
"""A vertex less than this share of its distance in front of the plane x = 0 is not trusted to be in front."""


LEAST_SQUARED = wp.constant(wp.float64(1.0e-15))
MOST_SQUARED = wp.constant(wp.float64(1.0e15))


@wp.func
def face_frame(q: wp.vec3d, face: wp.int32) -> wp.vec3d:
    """Forward, right and up of one of six faces: +x, -x, +y, -y, +z, -z. A permutation of axes, exact."""
    if face == 1:
        return wp.vec3d(-q[0], -q[1], q[2])
    if face == 2:
        return wp.vec3d(q[1], -q[0], q[2])
    if face == 3:
        return wp.vec3d(-q[1], q[0], q[2])
    if face == 4:
        return wp.vec3d(q[2], q[1], -q[0])
    if face == 5:
        return wp.vec3d(-q[2], q[1], q[0])
    return q


@wp.func
def face_of(q: wp.vec3d) -> wp.int32:
    """The face whose pyramid holds a direction; 0 for none."""
    x = wp.abs(q[0])
    y = wp.abs(q[1])
    z = wp.abs(q[2])
    if x >= y and x >= z:
        if q[0] < wp.float64(0.0):
            return 1
        return 0
    if y >= z:
        if q[1] < wp.float64(0.0):
            return 3
        return 2
    if q[2] < wp.float64(0.0):
        return 5
    return 4


@wp.func
def ray_place(map: wp.int32, q: wp.vec3d) -> wp.vec4d:
    """(coordinates in the rectangle, distance, face) of a point in the light's frame."""
    if map == 1:
        return wp.vec4d(wp.atan2(q[1], q[0]), wp.atan2(q[2], q[0]), wp.length(q), wp.float64(0.0))
    if map == 2:
        face = face_of(q)
        p = face_frame(q, face)
        if p[0] <= wp.float64(0.0):
            return wp.vec4d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
        return wp.vec4d(p[1] / p[0], p[2] / p[0], wp.length(p), wp.float64(face))
    p = angles(q)
    return wp.vec4d(p[0], p[1], p[2], wp.float64(0.0))


@wp.func
def ray_place32(map: wp.int32, axes: wp.mat33d, away: wp.vec3d) -> wp.vec4d:
    """The same with every operation in float32, from the difference (hit - light) rounded to float32.

    What float32 cannot square is brought to a length of one first.
    """
    unit = unit_of(largest(away))
    v = to_float32(away / unit)
    q = wp.matrix(axes, shape=(3, 3), dtype=wp.float32) * v
    return place32(map, q, wp.float64(wp.length(q)) * unit)


@wp.func
def unit_of(size: wp.float64) -> wp.float64:
    """1, or a size beyond those whose squares float32 holds with all their digits."""
    if (size > LEAST_SQUARED and size < MOST_SQUARED) or size == wp.float64(0.0):
        return wp.float64(1.0)
    return size


@wp.func
def ray_place_centred(
    map: wp.int32, axes: wp.mat33d, beside: wp.vec3d, distance: wp.float64, away: wp.vec3d
) -> wp.vec4d:
    """The same from the difference (hit - middle), the middle being ``distance`` forward; the length in float64."""
    unit = unit_of(distance)
    v = to_float32(beside / unit)
    q = wp.matrix(axes, shape=(3, 3), dtype=wp.float32) * v
    return place32(map, wp.vec3f(wp.float32(distance / unit) + q[0], q[1], q[2]), wp.length(away))


@wp.func
def place32(map: wp.int32, q: wp.vec3f, distance: wp.float64) -> wp.vec4d:
    """Coordinates of a float32 point in the light's frame, in float32."""
    if map == 1:
        return wp.vec4d(
            wp.float64(wp.atan2(q[1], q[0])), wp.float64(wp.atan2(q[2], q[0])), distance, wp.float64(0.0)
        )
    if map == 2:
        q64 = wp.vec3d(wp.float64(q[0]), wp.float64(q[1]), wp.float64(q[2]))
        face = face_of(q64)
        p = face_frame(q64, face)
        if p[0] <= wp.float64(0.0):
            return wp.vec4d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
        x = wp.float32(p[1]) / wp.float32(p[0])
        y = wp.float32(p[2]) / wp.float32(p[0])
        return wp.vec4d(wp.float64(x), wp.float64(y), distance, wp.float64(face))
    flat = wp.sqrt(q[0] * q[0] + q[1] * q[1])
    return wp.vec4d(
        wp.float64(wp.atan2(q[1], q[0])), wp.float64(wp.atan2(q[2], flat)), distance, wp.float64(0.0)
    )


@wp.func
def whole(map: wp.int32) -> wp.vec4d:
    """The rectangle of all directions: lowest and highest first, lowest and highest second coordinate."""
    one = wp.float64(1.0)
    if map == 1:
        return wp.vec4d(-PI, PI, -PI, PI)
    if map == 2:
        return wp.vec4d(-one, one, -one, one)
    return wp.vec4d(-PI, PI, -HALF_PI, HALF_PI)


@wp.func
def spherical_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Azimuth and elevation; a direction known to ``pad`` has an azimuth known to pad / cos(elevation)."""
    bounds = triangle_angles(a, b, c)
    low = bounds[2] - pad
    high = bounds[3] + pad
    flattest = wp.cos(wp.min(HALF_PI, wp.max(wp.abs(low), wp.abs(high))))
    if flattest < wp.float64(16.0) * pad:
        return wp.vec4d(-PI, PI, low, high)
    spread = wp.float64(2.0) * pad / flattest
    return wp.vec4d(bounds[0] - spread, bounds[1] + spread, low, high)


@wp.func
def vertex_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Azimuth and elevation of the three vertices as they are: wrong across the seam, at poles and for large arcs."""
    pa = angles(a)
    pb = angles(b)
    pc = angles(c)
    return wp.vec4d(
        wp.min(pa[0], wp.min(pb[0], pc[0])) - pad,
        wp.max(pa[0], wp.max(pb[0], pc[0])) + pad,
        wp.min(pa[1], wp.min(pb[1], pc[1])) - pad,
        wp.max(pa[1], wp.max(pb[1], pc[1])) + pad,
    )


@wp.func
def seam_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """The same with azimuths unwrapped from vertex to vertex: wrong at poles and for large arcs."""
    pa = angles(a)
    pb = angles(b)
    pc = angles(c)
    az1 = pa[0] + wrapped(pb[0] - pa[0])
    az2 = az1 + wrapped(pc[0] - pb[0])
    return wp.vec4d(
        wp.min(pa[0], wp.min(az1, az2)) - pad,
        wp.max(pa[0], wp.max(az1, az2)) + pad,
        wp.min(pa[1], wp.min(pb[1], pc[1])) - pad,
        wp.max(pa[1], wp.max(pb[1], pc[1])) + pad,
    )


@wp.func
def two_angle_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Vertex box, exact where all of the triangle is in front of x = 0, or all behind (unwrapped beyond pi there)."""
    ahead = wp.min(a[0] / wp.length(a), wp.min(b[0] / wp.length(b), c[0] / wp.length(c)))
    behind = wp.max(a[0] / wp.length(a), wp.max(b[0] / wp.length(b), c[0] / wp.length(c)))
    turn = wp.float64(0.0)
    share = ahead
    sign = wp.float64(1.0)
    if behind < -FLAT:
        turn = PI
        share = -behind
        sign = wp.float64(-1.0)
    elif not (ahead > FLAT):
        return whole(1)
    # atan2 of both coordinates negated is the angle less pi, without a seam in the back hemisphere.
    ua = wp.atan2(sign * a[1], sign * a[0])
    ub = wp.atan2(sign * b[1], sign * b[0])
    uc = wp.atan2(sign * c[1], sign * c[0])
    va = wp.atan2(sign * a[2], sign * a[0])
    vb = wp.atan2(sign * b[2], sign * b[0])
    vc = wp.atan2(sign * c[2], sign * c[0])
    # Every point of the triangle is at least ``share`` of its distance from x = 0, as its vertices are.
    spread = wp.float64(2.0) * (pad + wp.float64(8.0) * ROUNDING) / share
    return wp.vec4d(
        turn + wp.min(ua, wp.min(ub, uc)) - spread,
        turn + wp.max(ua, wp.max(ub, uc)) + spread,
        turn + wp.min(va, wp.min(vb, vc)) - spread,
        turn + wp.max(va, wp.max(vb, vc)) + spread,
    )


@wp.func
def all_outside(a: wp.float64, b: wp.float64, c: wp.float64, slack: wp.float64) -> wp.bool:
    return a > slack and b > slack and c > slack


@wp.func
def cube_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Bounds in the face whose forward is x; high < low where the triangle certainly misses its pyramid."""
    reach = wp.max(wp.length(a), wp.max(wp.length(b), wp.length(c)))
    slack = wp.float64(4.0) * (pad + ROUNDING) * reach
    empty = wp.vec4d(wp.float64(1.0), wp.float64(-1.0), wp.float64(1.0), wp.float64(-1.0))
    if all_outside(-a[0], -b[0], -c[0], slack):
        return empty
    if all_outside(a[1] - a[0], b[1] - b[0], c[1] - c[0], slack):
        return empty
    if all_outside(-a[1] - a[0], -b[1] - b[0], -c[1] - c[0], slack):
        return empty
    if all_outside(a[2] - a[0], b[2] - b[0], c[2] - c[0], slack):
        return empty
    if all_outside(-a[2] - a[0], -b[2] - b[0], -c[2] - c[0], slack):
        return empty
    share = wp.min(a[0] / wp.length(a), wp.min(b[0] / wp.length(b), c[0] / wp.length(c)))
    if not (share > FLAT):
        return whole(2)
    spread = wp.float64(4.0) * (pad + wp.float64(8.0) * ROUNDING) / (share * share)
    u = wp.vec3d(a[1] / a[0], b[1] / b[0], c[1] / c[0])
    v = wp.vec3d(a[2] / a[0], b[2] / b[0], c[2] / c[0])
    one = wp.float64(1.0) + wp.float64(4.0) * pad
    low_u = wp.max(-one, wp.min(u) - spread)
    high_u = wp.min(one, wp.max(u) + spread)
    low_v = wp.max(-one, wp.min(v) - spread)
    high_v = wp.min(one, wp.max(v) + spread)
    if low_u > high_u or low_v > high_v:
        return empty
    return wp.vec4d(low_u, high_u, low_v, high_v)


@wp.func
def map_bounds(map: wp.int32, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Bounds of a triangle in one rectangle, in the face's frame; may reach beyond +-pi where a coordinate wraps."""
    if map == 1:
        return two_angle_bounds(a, b, c, pad)
    if map == 2:
        return cube_bounds(a, b, c, pad)
    return spherical_bounds(a, b, c, pad)


@wp.func
def wraps(map: wp.int32) -> wp.vec2i:
    """Whether the first and the second coordinate are angles with a seam at +-pi."""
    if map == 1:
        return wp.vec2i(1, 1)
    if map == 2:
        return wp.vec2i(0, 0)
    return wp.vec2i(1, 0)


BOUNDS = (spherical_bounds, two_angle_bounds, cube_bounds)
WRAPS = ((1, 0), (1, 1), (0, 0))
"""By map: bounds of a triangle, and which of the two coordinates have a seam."""

LOOSE_BOUNDS = {"exact": None, "seam": (seam_bounds, (1, 0)), "vertices": (vertex_bounds, (0, 0))}
"""Alternatives to the exact bounds of azimuth and elevation, by name."""
