"""Azimuth and elevation seen from a light, and the exact bounds of a triangle there. Float64.

Frame: x forward, y right, z up. azimuth = atan2(y, x), elevation = atan2(z, hypot(x, y)); asin(z / |d|) would lose
half the digits near the poles. A triangle's bounds are those of three great arcs and of the poles it may contain;
the box of its three vertices is not enough: great arcs bulge towards the poles (8 % of triangles 0.1 rad wide).
"""

import warp as wp

from ...exact.triangle import largest

PI = wp.constant(wp.float64(3.141592653589793))
TWO_PI = wp.constant(wp.float64(6.283185307179586))
HALF_PI = wp.constant(wp.float64(1.5707963267948966))
ROUNDING = wp.constant(wp.float64(1.0e-14))
"""Relative size of what float64 differences, rotations and products may be off by, with room to spare."""


@wp.func
def length2(x: wp.float64, y: wp.float64) -> wp.float64:
    return wp.sqrt(x * x + y * y)


@wp.func
def angles(q: wp.vec3d) -> wp.vec3d:
    """(azimuth, elevation, distance) of a point in the light's frame."""
    flat = length2(q[0], q[1])
    return wp.vec3d(wp.atan2(q[1], q[0]), wp.atan2(q[2], flat), wp.length(q))


@wp.func
def wrapped(delta: wp.float64) -> wp.float64:
    """``delta`` less the nearest multiple of 2 pi; exact near zero."""
    return delta - TWO_PI * wp.rint(delta / TWO_PI)


@wp.func
def arc_elevation(bounds: wp.vec4d, p: wp.vec3d, q: wp.vec3d, n: wp.vec3d) -> wp.vec4d:
    """Widen (.., .., lowest, highest) by the extremum inside the arc p-q of the great circle with normal n."""
    at_p = n[0] * p[1] - n[1] * p[0]
    at_q = n[0] * q[1] - n[1] * q[0]
    slack = ROUNDING * largest(n) * wp.max(largest(p), largest(q))
    if (at_p > slack and at_q > slack) or (at_p < -slack and at_q < -slack):
        return bounds
    peak = wp.atan2(length2(n[0], n[1]), wp.abs(n[2]))
    low = bounds[2]
    high = bounds[3]
    # The elevation's slope along the arc changes sign inside it; in doubt it does.
    if at_p > -slack and at_q < slack:
        high = wp.max(high, peak)
    if at_p < slack and at_q > -slack:
        low = wp.min(low, -peak)
    if wp.abs(at_p) <= slack and wp.abs(at_q) <= slack:
        low = wp.min(bounds[2], -peak)
        high = wp.max(bounds[3], peak)
    return wp.vec4d(bounds[0], bounds[1], low, high)


@wp.func
def small_arctangent(t: wp.float64) -> wp.float64:
    """atan(t) for |t| <= 0.1, to 1e-16."""
    s = t * t
    sum = wp.float64(1.0 / 13.0)
    sum = wp.float64(1.0 / 11.0) - s * sum
    sum = wp.float64(1.0 / 9.0) - s * sum
    sum = wp.float64(1.0 / 7.0) - s * sum
    sum = wp.float64(1.0 / 5.0) - s * sum
    sum = wp.float64(1.0 / 3.0) - s * sum
    return t * (wp.float64(1.0) - s * sum)


@wp.func
def small_angles(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.vec4d:
    """The bounds of a triangle less than 0.1 rad of azimuth from a, away from the poles; high < low for others.

    The tangent of the elevation along a great arc is K cos(azimuth - phi): inside an arc of azimuth w it exceeds
    the larger end, if that is positive, by a factor of at most 1 / cos(w / 2) <= 1 + 0.13 w^2.
    """
    none = wp.vec4d(wp.float64(1.0), wp.float64(-1.0), wp.float64(0.0), wp.float64(0.0))
    most = wp.float64(0.1)
    steep = wp.float64(3.0)
    ab = a[0] * b[0] + a[1] * b[1]
    ac = a[0] * c[0] + a[1] * c[1]
    cross_b = a[0] * b[1] - a[1] * b[0]
    cross_c = a[0] * c[1] - a[1] * c[0]
    if not (wp.abs(cross_b) < most * ab and wp.abs(cross_c) < most * ac):
        return none
    flat_a = length2(a[0], a[1])
    flat_b = length2(b[0], b[1])
    flat_c = length2(c[0], c[1])
    if not (wp.abs(a[2]) < steep * flat_a and wp.abs(b[2]) < steep * flat_b and wp.abs(c[2]) < steep * flat_c):
        return none
    to_b = small_arctangent(cross_b / ab)
    to_c = small_arctangent(cross_c / ac)
    first = wp.min(wp.float64(0.0), wp.min(to_b, to_c))
    last = wp.max(wp.float64(0.0), wp.max(to_b, to_c))
    up_a = a[2] / flat_a
    up_b = b[2] / flat_b
    up_c = c[2] / flat_c
    low = wp.min(up_a, wp.min(up_b, up_c))
    high = wp.max(up_a, wp.max(up_b, up_c))
    bulge = wp.float64(1.0) + wp.float64(0.13) * (last - first) * (last - first)
    if high > wp.float64(0.0):
        high = high * bulge
    if low < wp.float64(0.0):
        low = low * bulge
    at = wp.atan2(a[1], a[0])
    # Differences and rotations off by ROUNDING of the distance, which is at most 3.2 of what is flat.
    pad = wp.float64(32.0) * ROUNDING
    return wp.vec4d(at + first - pad, at + last + pad, wp.atan(low) - pad, wp.atan(high) + pad)


@wp.func
def triangle_angles(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.vec4d:
    """Bounds (azimuth low, high, elevation low, high) of a triangle whose plane does not hold the light.

    Azimuths are unwrapped from vertex a: high - low is at most 2 pi, and the interval may reach beyond +-pi.
    Conservative: rounding widens, never narrows. Full circle where a pole is or may be inside.
    """
    small = small_angles(a, b, c)
    if small[1] >= small[0]:
        return small
    pa = angles(a)
    pb = angles(b)
    pc = angles(c)
    na = wp.cross(a, b - a)
    nb = wp.cross(b, c - b)
    nc = wp.cross(c, a - c)
    dab = wrapped(pb[0] - pa[0])
    dbc = wrapped(pc[0] - pb[0])
    dca = wrapped(pa[0] - pc[0])
    az1 = pa[0] + dab
    az2 = az1 + dbc
    low = wp.min(pa[0], wp.min(az1, az2))
    high = wp.max(pa[0], wp.max(az1, az2))
    bounds = wp.vec4d(low, high, wp.min(pa[1], wp.min(pb[1], pc[1])), wp.max(pa[1], wp.max(pb[1], pc[1])))
    bounds = arc_elevation(bounds, a, b, na)
    bounds = arc_elevation(bounds, b, c, nb)
    bounds = arc_elevation(bounds, c, a, nc)

    # How far a vertex is from the poles' axis, as a share of its distance: azimuths are known to ROUNDING / this.
    axis = wp.min(length2(a[0], a[1]) / pa[2], wp.min(length2(b[0], b[1]) / pb[2], length2(c[0], c[1]) / pc[2]))
    doubt = wp.float64(8.0) * ROUNDING / wp.max(axis, ROUNDING)
    widest = wp.max(wp.abs(dab), wp.max(wp.abs(dbc), wp.abs(dca)))
    pole = wp.abs(dab + dbc + dca) > PI or widest > PI - wp.float64(1.0e-6) - doubt or axis < wp.float64(1.0e-12)
    # All three planes have the poles' axis on one side (zeros allowed): a pole is inside.
    slack_a = ROUNDING * largest(a) * largest(b - a)
    slack_b = ROUNDING * largest(b) * largest(c - b)
    slack_c = ROUNDING * largest(c) * largest(a - c)
    reaches = wp.max(wp.abs(bounds[2]), wp.abs(bounds[3])) + wp.float64(1.6) * wp.max(
        largest(b - a), wp.max(largest(c - b), largest(a - c))
    ) * wp.float64(1.75) / wp.min(pa[2], wp.min(pb[2], pc[2]))
    if reaches >= HALF_PI:
        if (na[2] >= -slack_a and nb[2] >= -slack_b and nc[2] >= -slack_c) or (
            na[2] <= slack_a and nb[2] <= slack_b and nc[2] <= slack_c
        ):
            pole = True
    if pole:
        normal = wp.cross(b - a, c - a)
        side = wp.dot(normal, a)
        # Which pole it is: either where the normal is level, or the plane so near the light that rounding hides its side.
        product = ROUNDING * largest(b - a) * largest(c - a)
        either = wp.abs(normal[2]) <= product or wp.abs(side) <= wp.float64(8.0) * product * largest(a)
        low_b = bounds[2]
        high_b = bounds[3]
        if side * normal[2] > wp.float64(0.0) or either:
            high_b = HALF_PI
        if side * normal[2] < wp.float64(0.0) or either:
            low_b = -HALF_PI
        return wp.vec4d(-PI, PI, low_b, high_b)
    pad = wp.float64(4.0) * ROUNDING
    return wp.vec4d(bounds[0] - doubt, bounds[1] + doubt, bounds[2] - pad, bounds[3] + pad)
