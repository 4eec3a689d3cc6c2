"""The longest axis of a vector; a light's space: from where it looks, and its axes, given where to."""

from typing import Any

import warp as wp

from ..exact.triangle import largest


@wp.func
def longest_axis(v: Any) -> wp.int32:
    """The first axis along which v is longest."""
    axis = wp.int32(0)
    if v[1] > v[0]:
        axis = 1
    if v[2] > v[axis]:
        axis = 2
    return axis


@wp.func
def brought_nearer(place: wp.vec3f, most: wp.float32) -> wp.vec3f:
    """A light's place, or if a coordinate of it is beyond ``most``, a point between it and the origin: the place times a
    power of a quarter, so that no direction is rounded. Nothing brings an infinite place nearer.
    """
    near = place
    while largest(near) > most and largest(near) < wp.INF:
        near = 0.25 * near
    return near


@wp.func
def axes_along(forward: wp.vec3d) -> wp.mat33d:
    """Rows: forward (of length 1), right and up.

    Any axis far from parallel to forward serves as "up"; world axes keep y up as the paper's figure does.
    """
    up = wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0))
    if wp.abs(forward[1]) > wp.float64(0.8):
        up = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
    right = wp.normalize(wp.cross(forward, up))
    return wp.matrix_from_rows(forward, right, wp.cross(right, forward))
