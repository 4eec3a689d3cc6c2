"""Bounds of a triangle that only the ablation uses: in the map of two angles, as section 4.1 words it, and of its vertices
instead of great arcs, which lose shadows; to show how many.
"""

import warp as wp

from ..light.mapping import FLAT, TWO_ANGLE, box_of, shares_ahead, whole
from ..light.sphere import PI, ROUNDING, angles, wrapped


@wp.func
def two_angle_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Vertex box, exact where all of the triangle is in front of x = 0, or all behind (unwrapped beyond pi there)."""
    shares = shares_ahead(a, b, c)
    share = wp.min(shares)
    turn = wp.float64(0.0)
    sign = wp.float64(1.0)
    if wp.max(shares) < -FLAT:
        turn = PI
        share = -wp.max(shares)
        sign = wp.float64(-1.0)
    elif not (share > FLAT):
        return whole(TWO_ANGLE)
    # atan2 of both coordinates negated is the angle less pi, without a seam in the back hemisphere.
    x = sign * wp.vec3d(a[0], b[0], c[0])
    y = sign * wp.vec3d(a[1], b[1], c[1])
    z = sign * wp.vec3d(a[2], b[2], c[2])
    u = wp.vec3d(wp.atan2(y[0], x[0]), wp.atan2(y[1], x[1]), wp.atan2(y[2], x[2]))
    v = wp.vec3d(wp.atan2(z[0], x[0]), wp.atan2(z[1], x[1]), wp.atan2(z[2], x[2]))
    # Every point of the triangle is at least ``share`` of its distance from x = 0, as its vertices are.
    spread = wp.float64(2.0) * (pad + wp.float64(8.0) * ROUNDING) / share
    turned = wp.vec3d(turn, turn, turn)
    return box_of(u + turned, v + turned, spread)


@wp.func
def vertex_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """Azimuth and elevation of the three vertices as they are: wrong across the seam, at poles and for large arcs."""
    pa = angles(a)
    pb = angles(b)
    pc = angles(c)
    return box_of(wp.vec3d(pa[0], pb[0], pc[0]), wp.vec3d(pa[1], pb[1], pc[1]), pad)


@wp.func
def seam_bounds(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """The same with azimuths unwrapped from vertex to vertex: wrong at poles and for large arcs."""
    pa = angles(a)
    pb = angles(b)
    pc = angles(c)
    second = pa[0] + wrapped(pb[0] - pa[0])
    third = second + wrapped(pc[0] - pb[0])
    return box_of(wp.vec3d(pa[0], second, third), wp.vec3d(pa[1], pb[1], pc[1]), pad)
