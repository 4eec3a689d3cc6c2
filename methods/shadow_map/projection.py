"""From the scene to a light's depth map: which map fits, and where a point lies in it.

Map space is homogeneous: (w, x, y) with |x| <= w and |y| <= w inside, and a depth in 0..1 that is linear along the
map's axis. For an aimed map everything is relative to the middle of the scene's box, so that a light at 1e5 radii
still distinguishes texels; for a cube it is relative to the light.
"""

import warp as wp

from ..common.axes import axes_along
from ..common.bounds import box_high, box_low
from ..exact.triangle import largest, to_float32, to_float64

FACES = 6
WIDEST = wp.constant(1.7320508)
"""Tangent of 60 degrees: beyond it one flat map wastes most of its texels."""


@wp.struct
class LightMap:
    """One light's map.

    forward, right, up  axes; forward points from the light to the middle of the scene
    middle    what positions are relative to: the middle of the box (aimed), the light (cube)
    distance  from the light to ``middle``; 0 for a cube
    scale     what w is divided by: the distance (aimed), the scene's extent (cube)
    centre, half   middle and half width of the map's window in tangents
    near, far      along the axis from ``middle``: where depth is 0 and 1
    faces     1 or 6
    """

    forward: wp.vec3f
    right: wp.vec3f
    up: wp.vec3f
    middle: wp.vec3f
    distance: wp.float32
    scale: wp.float32
    centre: wp.vec2f
    half: wp.vec2f
    near: wp.float32
    far: wp.float32
    faces: wp.int32


@wp.kernel(enable_backward=False)
def fit_kernel(
    light: wp.int32,
    shape: wp.int32,
    size: wp.int32,
    slot: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    box: wp.array(dtype=wp.float32),
    light_map: wp.array(dtype=LightMap),
    needs: wp.array(dtype=wp.int64),
):
    """Choose the map of one light (one thread). shape: 0 auto, 1 aimed where possible, 2 cube.

    A light inside the box, or beside it so that the box reaches behind it, always gets a cube.
    """
    low = box_low(box)
    high = box_high(box)
    if not wp.isfinite(low):
        low = wp.vec3f(0.0, 0.0, 0.0)
        high = wp.vec3f(0.0, 0.0, 0.0)
    at = lights[light]
    middle = 0.5 * low + 0.5 * high
    way = to_float64(middle) - to_float64(at)
    far = largest(way)
    m = LightMap()
    aimed = shape != 2 and far > wp.float64(0.0)
    if aimed:
        axes = axes_along(wp.normalize(way / far))
        m.distance = wp.float32(wp.length(way / far) * far)
        m.forward = to_float32(axes[0])
        m.right = to_float32(axes[1])
        m.up = to_float32(axes[2])
        m.middle = middle
        m.scale = m.distance
        m.faces = 1
        first = wp.vec2f(wp.INF, wp.INF)
        last = wp.vec2f(-wp.INF, -wp.INF)
        m.near = wp.INF
        m.far = -wp.INF
        for k in range(8):
            q = high - middle
            for axis in range(3):
                if (k >> axis) & 1 == 0:
                    q[axis] = low[axis] - middle[axis]
            f = wp.dot(m.forward, q)
            z = m.distance + f
            if z > 1.0e-3 * m.distance:
                t = wp.vec2f(wp.dot(m.right, q) / z, wp.dot(m.up, q) / z)
                first = wp.min(first, t)
                last = wp.max(last, t)
            else:
                aimed = False
            m.near = wp.min(m.near, f)
            m.far = wp.max(m.far, f)
        m.centre = 0.5 * (first + last)
        # One texel of border, so that rounding puts no receiver outside.
        m.half = 0.5 * (last - first) * (1.0 + 2.0 / wp.float32(size))
        least = 1.0e-6 * wp.max(wp.max(m.half[0], m.half[1]), 1.0e-30)
        m.half = wp.max(m.half, wp.vec2f(least, least))
        if shape == 0 and wp.max(wp.max(-first[0], last[0]), wp.max(-first[1], last[1])) > WIDEST:
            aimed = False
    if not aimed:
        m.forward = wp.vec3f(1.0, 0.0, 0.0)
        m.right = wp.vec3f(0.0, 1.0, 0.0)
        m.up = wp.vec3f(0.0, 0.0, 1.0)
        m.middle = at
        m.distance = 0.0
        m.near = 0.0
        m.far = wp.max(largest(low - at), largest(high - at))
        m.scale = m.far
        m.centre = wp.vec2f(0.0, 0.0)
        m.half = wp.vec2f(1.0, 1.0)
        m.faces = FACES
    if not m.far > m.near:
        m.far = m.near + 1.0
    if not m.scale > 0.0:
        m.scale = 1.0
    light_map[0] = m
    needs[slot] = wp.int64(m.faces)


@wp.func
def face_axes(m: LightMap, face: wp.int32, v: wp.vec3f) -> wp.vec3f:
    """A vector as (along the face's axis, across, across). Face 0 of an aimed map is its axis."""
    a = wp.vec3f(wp.dot(m.forward, v), wp.dot(m.right, v), wp.dot(m.up, v))
    if face == 0:
        return a
    if face == 1:
        return wp.vec3f(-a[0], a[1], a[2])
    if face == 2:
        return wp.vec3f(a[1], a[0], a[2])
    if face == 3:
        return wp.vec3f(-a[1], a[0], a[2])
    if face == 4:
        return wp.vec3f(a[2], a[0], a[1])
    return wp.vec3f(-a[2], a[0], a[1])


@wp.func
def face_of(m: LightMap, p: wp.vec3f) -> wp.int32:
    """The face in whose pyramid a point lies."""
    if m.faces == 1:
        return 0
    q = p - m.middle
    x = wp.abs(q[0])
    y = wp.abs(q[1])
    z = wp.abs(q[2])
    if x >= y and x >= z:
        return wp.where(q[0] > 0.0, 0, 1)
    if y >= z:
        return wp.where(q[1] > 0.0, 2, 3)
    return wp.where(q[2] > 0.0, 4, 5)


@wp.func
def map_point(m: LightMap, face: wp.int32, p: wp.vec3f) -> wp.vec4f:
    """(w, x, y, depth) of a point."""
    q = face_axes(m, face, p - m.middle)
    z = m.distance + q[0]
    return wp.vec4f(
        z / m.scale,
        (q[1] - m.centre[0] * z) / (m.half[0] * m.scale),
        (q[2] - m.centre[1] * z) / (m.half[1] * m.scale),
        (q[0] - m.near) / (m.far - m.near),
    )
