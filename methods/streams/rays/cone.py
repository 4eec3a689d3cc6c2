"""The region of a spot's rays: that of the triangles in view (:mod:`.region`), without what lies outside its cone.

So a spot's rays, too, are counted in their cells by the pass that places them and marks the receivers.

Whether a hit point lies in the cone the harness decides, in plain float64. On a triangle seen edge-on, or next to the
light, that may be off by more than the slack. Such a ray may lie outside the region. It is then an outside ray, and is
tested against every triangle in float64 instead (:mod:`..occlusion.undecided`). All other rays are placed to 2^-18 of their
direction.
"""

import math

import warp as wp

from ..cube.aim import CONE
from ..cube.faces import FACES, on_face
from ..cube.lights import Light
from ..cube.rectangle import EMPTY, FACE, HIGH_U, HIGH_V, LOW_U, LOW_V, from_ordered, ordered

SLACK = 1.0e-4
"""Added to the angle of a cone: a ray that the camera's words place is right to 2^-18 of its direction
(:mod:`.hit_points`), and the proxy turns it by less."""

COS_SLACK, SIN_SLACK = wp.constant(wp.float64(math.cos(SLACK))), wp.constant(wp.float64(math.sin(SLACK)))

WIDEST = wp.constant(wp.float64(-0.999))
"""A cone with a lesser cosine leaves nothing out: its angle with the slack must stay below 180 degrees."""


@wp.func
def edge_cosine(p: wp.float64, q: wp.float64) -> wp.float64:
    """The greatest cosine of an axis and the directions of an edge of a face: (p + q b) / sqrt(2 + b^2) for b in -1..1."""
    corner = wp.max(p + q, p - q) / wp.sqrt(wp.float64(3.0))
    if p > wp.float64(0.0):
        b = wp.clamp(wp.float64(2.0) * q / p, wp.float64(-1.0), wp.float64(1.0))
        corner = wp.max(corner, (p + q * b) / wp.sqrt(wp.float64(2.0) + b * b))
    return corner


@wp.func
def face_cosine(a: wp.vec3d) -> wp.float64:
    """The cosine of the least angle between an axis (unit length; in the frame of a face) and a direction on the face.

    Where the axis does not meet the face, the nearest direction lies on one of its edges.
    """
    if a[0] > wp.float64(0.0) and wp.abs(a[1]) <= a[0] and wp.abs(a[2]) <= a[0]:
        return wp.float64(1.0)
    across = wp.max(edge_cosine(a[0] + a[1], a[2]), edge_cosine(a[0] - a[1], a[2]))
    up = wp.max(edge_cosine(a[0] + a[2], a[1]), edge_cosine(a[0] - a[2], a[1]))
    return wp.max(across, up)


@wp.func
def cone_sides(f: wp.float64, r: wp.float64, sine: wp.float64) -> wp.vec2d:
    """What a cone that lies before a face's centre (f > sine) covers of one coordinate of the face: the planes r / f = k
    that touch it, which are at the angle of the cone from its axis."""
    before = f * f - sine * sine
    half = sine * wp.sqrt(before + r * r)
    return wp.vec2d((f * r - half) / before, (f * r + half) / before)


@wp.func
def raise_side(rectangle: wp.array(dtype=wp.int32), k: wp.int32, x: wp.float64):
    """Move a side of the rectangle inwards to x, if it is not there yet."""
    rectangle[k] = wp.max(rectangle[k], ordered(wp.float32(x)))


@wp.kernel(enable_backward=False, grid_stride=False)
def cone_kernel(light: Light, rectangle: wp.array(dtype=wp.int32), outside_rays: wp.array(dtype=wp.int32)):
    """Take from what the triangles cover the faces that a light's cone does not meet, and of face 0 what lies beside a cone
    that is wholly before its centre. One thread. A spot of another kind, or of nearly all directions, keeps all. Empties
    the list of ``outside_rays``."""
    outside_rays[0] = 0
    cosine = light.spot[light.index, 10]
    if light.spot[light.index, 0] != CONE or cosine < WIDEST:
        return
    sine = wp.sqrt(wp.max(wp.float64(1.0) - cosine * cosine, wp.float64(0.0)))
    wider = cosine * COS_SLACK - sine * SIN_SLACK
    axis = light.axes[light.index] * wp.vec3d(
        light.spot[light.index, 1], light.spot[light.index, 2], light.spot[light.index, 3]
    )
    for face in range(FACES):
        if face_cosine(on_face(axis, face)) < wider:
            rectangle[FACE + face] = EMPTY
    sine = sine * COS_SLACK + cosine * SIN_SLACK
    if cosine > wp.float64(0.0) and axis[0] > sine and rectangle[FACE] == 0:
        across = cone_sides(axis[0], axis[1], sine)
        up = cone_sides(axis[0], axis[2], sine)
        raise_side(rectangle, LOW_U, across[0])
        raise_side(rectangle, HIGH_U, -across[1])
        raise_side(rectangle, LOW_V, up[0])
        raise_side(rectangle, HIGH_V, -up[1])
        wide = from_ordered(rectangle[LOW_U]) < -from_ordered(rectangle[HIGH_U])
        if not (wide and from_ordered(rectangle[LOW_V]) < -from_ordered(rectangle[HIGH_V])):
            rectangle[FACE] = EMPTY  # the cone misses what the triangles cover
