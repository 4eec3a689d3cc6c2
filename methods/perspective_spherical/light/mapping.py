"""Three maps from directions at a light to rectangles: where a ray lands, and what a triangle may cover. Float64.

Light's frame: x forward, y right, z up. The maps, and the rectangle of each:

0 azimuth-elevation  (atan2(y, x), atan2(z, hypot(x, y))): one rectangle, seam at azimuth +-pi, two poles
                     (:mod:`.light.sphere`)
1 two-angle          (atan2(y, x), atan2(z, x)), as the paper words it: one rectangle; the circle x = 0 collapses to
                     four points, so that what crosses it covers the whole rectangle
2 cube               (y / x, z / x) in each of six faces (Hunt & Mark 2008): six rectangles, straight edges

A ray from the light has one place; :mod:`.light.bounds` has those of all rays that meet a triangle.
"""

from typing import Any

import warp as wp

from ...exact.triangle import largest, to_float32, to_float64
from .sphere import HALF_PI, PI

AZIMUTH_ELEVATION, TWO_ANGLE, CUBE = wp.constant(0), wp.constant(1), wp.constant(2)

FLAT = wp.constant(wp.float64(1.0e-4))
"""A vertex less than this share of its distance in front of the plane x = 0 is not trusted to be in front."""

LEAST_SQUARED = wp.constant(wp.float64(1.0e-15))
MOST_SQUARED = wp.constant(wp.float64(1.0e15))


@wp.struct
class LightSpace:
    """Light ``index`` and its axes.

    map, single   which map; whether rays are placed in float32
    aimed         whether the axes look at the middle of the hit points, or along the spot
    lights, proxy_positions  vec3f [light_count]: the lights, and what their grids look from (:class:`.frame.frame.Frame`)
    axes          mat33d [1], rows: forward, right, up
    pads          float64 [2]: error bound of a ray's direction, relative to its length; see ``rays.aim_kernel``
    distance_pad  relative error bound of a ray's distance
    eye           vec3f [1]: bounds the coordinates of the eye
    box           float64 [6]: of the hit points, or of the scene where the rectangle is the scene's
    """

    index: wp.int32
    map: wp.int32
    single: wp.bool
    aimed: wp.bool
    lights: wp.array(dtype=wp.vec3f)
    proxy_positions: wp.array(dtype=wp.vec3f)
    axes: wp.array(dtype=wp.mat33d)
    pads: wp.array(dtype=wp.float64)
    distance_pad: wp.float64
    eye: wp.array(dtype=wp.vec3f)
    box: wp.array(dtype=wp.float64)


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
    size = wp.abs(q)
    if size[0] >= size[1] and size[0] >= size[2]:
        return wp.where(q[0] < wp.float64(0.0), 1, 0)
    if size[1] >= size[2]:
        return wp.where(q[1] < wp.float64(0.0), 3, 2)
    return wp.where(q[2] < wp.float64(0.0), 5, 4)


@wp.func
def coordinates(map: wp.int32, p: Any) -> wp.vec2d:
    """The place of a direction in its rectangle, in the precision of p, which is in the frame of the rectangle's face."""
    if map == CUBE:
        return wp.vec2d(wp.float64(p[1] / p[0]), wp.float64(p[2] / p[0]))
    flat = p[0]
    if map == AZIMUTH_ELEVATION:
        flat = wp.sqrt(p[0] * p[0] + p[1] * p[1])
    return wp.vec2d(wp.float64(wp.atan2(p[1], p[0])), wp.float64(wp.atan2(p[2], flat)))


@wp.func
def place_of(map: wp.int32, single: wp.bool, q: wp.vec3d, distance: wp.float64) -> wp.vec4d:
    """(coordinates in the rectangle, distance, face) of a point in the light's frame; ``single``: computed in float32."""
    face = wp.int32(0)
    p = q
    if map == CUBE:
        face = face_of(q)
        p = face_frame(q, face)
        if p[0] <= wp.float64(0.0):
            return wp.vec4d()
    at = wp.vec2d()
    if single:
        at = coordinates(map, to_float32(p))
    else:
        at = coordinates(map, p)
    return wp.vec4d(at[0], at[1], distance, wp.float64(face))


@wp.func
def turned32(axes: wp.mat33d, v: wp.vec3d) -> wp.vec3f:
    """A point in the light's frame, all in float32."""
    return wp.matrix(axes, shape=(3, 3), dtype=wp.float32) * to_float32(v)


@wp.func
def squarable(size: wp.float64) -> wp.float64:
    """A unit in which float32 holds the squares of lengths of this size with all their digits."""
    if (size > LEAST_SQUARED and size < MOST_SQUARED) or size == wp.float64(0.0):
        return wp.float64(1.0)
    return size


@wp.func
def ray_place(space: LightSpace, hit: wp.vec3d, middle: wp.vec3d) -> wp.vec4d:
    """The place of the ray to a hit point; ``space.single``: every operation in float32, from the rounded difference to the
    light, or where ``space.pads[1]`` says how far it is, to the ``middle`` of the hit points, which lies forward.
    """
    map = space.map
    axes = space.axes[0]
    away = hit - to_float64(space.proxy_positions[space.index])
    if not space.single:
        q = axes * away
        return place_of(map, False, q, wp.length(q))
    distance = space.pads[1]
    if distance > wp.float64(0.0):
        unit = squarable(distance)
        v = turned32(axes, (hit - middle) / unit)
        v[0] = wp.float32(distance / unit) + v[0]
        return place_of(map, True, to_float64(v), wp.length(away))
    unit = squarable(largest(away))
    v = turned32(axes, away / unit)
    return place_of(map, True, to_float64(v), wp.float64(wp.length(v)) * unit)


@wp.func
def whole(map: wp.int32) -> wp.vec4d:
    """The rectangle of all directions: lowest and highest first, lowest and highest second coordinate."""
    one = wp.float64(1.0)
    if map == TWO_ANGLE:
        return wp.vec4d(-PI, PI, -PI, PI)
    if map == CUBE:
        return wp.vec4d(-one, one, -one, one)
    return wp.vec4d(-PI, PI, -HALF_PI, HALF_PI)


@wp.func
def box_of(u: wp.vec3d, v: wp.vec3d, pad: wp.float64) -> wp.vec4d:
    """The rectangle of three vertices' coordinates, widened by ``pad``."""
    return wp.vec4d(wp.min(u) - pad, wp.max(u) + pad, wp.min(v) - pad, wp.max(v) + pad)


@wp.func
def shares_ahead(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.vec3d:
    """How far in front of the plane x = 0 each vertex is, as a share of its distance."""
    return wp.vec3d(a[0] / wp.length(a), b[0] / wp.length(b), c[0] / wp.length(c))
