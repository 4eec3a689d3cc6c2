"""The faces of a light's cube, and where a point lies on them.

On a face, planes through the light are lines, so bounds computed there are exact.
"""

from typing import Any

import warp as wp

from ...exact.triangle import to_float64

FACES = wp.constant(6)


@wp.func
def face_of(q: wp.vec3d) -> wp.int32:
    """Face of the largest coordinate: 0 +x, 1 -x, 2 +y, 3 -y, 4 +z, 5 -z."""
    x = wp.abs(q[0])
    y = wp.abs(q[1])
    z = wp.abs(q[2])
    face = wp.int32(0)
    along = q[0]
    if y > x and y >= z:
        face = 2
        along = q[1]
    elif z > x and z > y:
        face = 4
        along = q[2]
    if along < wp.float64(0.0):
        face += 1
    return face


@wp.func
def on_face(q: Any, face: wp.int32) -> Any:
    """(along, across, up) of a point in the frame of a face."""
    r = q
    if face >> 1 == 1:
        r = type(q)(q[1], q[2], q[0])
    elif face >> 1 == 2:
        r = type(q)(q[2], q[0], q[1])
    if face & 1 == 1:
        r = type(q)(-r[0], r[1], r[2])
    return r


@wp.func
def place_of(hit: wp.vec3d, light: wp.vec3f, axes: wp.mat33d) -> wp.vec4f:
    """(u, v, face, depth) of a hit point; computed in float64, so that u and v keep a float's digits at any distance.

    The depth is taken along the face's axis; infinite where the point is the light.
    """
    q = axes * (hit - to_float64(light))
    face = face_of(q)
    r = on_face(q, face)
    u = wp.float32(0.0)
    v = wp.float32(0.0)
    depth = wp.float32(wp.INF)
    if r[0] > wp.float64(0.0):
        scale = wp.float64(1.0) / r[0]
        u = wp.float32(r[1] * scale)
        v = wp.float32(r[2] * scale)
        depth = wp.float32(r[0])
    return wp.vec4f(u, v, wp.float32(face), depth)
