"""Boxes around the parts of a triangle on either side of a plane, rounded outwards."""

import warp as wp

from ...harness.frame.geometry import Mesh, corners_of, value_struct
from ..exact.triangle import U32


@value_struct
class Box:
    low: wp.vec3f
    high: wp.vec3f


@value_struct
class Parts:
    """The boxes of both parts of a pair that a plane divides; one of a part that does not exist is none (:func:`is_box`)."""

    below: Box
    above: Box


@wp.func
def is_box(box: Box) -> wp.bool:
    return box.low[0] <= box.high[0] and box.low[1] <= box.high[1] and box.low[2] <= box.high[2]


@wp.func
def taking_in(box: Box, at: wp.vec3f, pad: wp.vec3f) -> Box:
    return Box(wp.min(box.low, at - pad), wp.max(box.high, at + pad))


@wp.func
def with_edge(parts: Parts, a: wp.vec3f, b: wp.vec3f, plane: wp.float32, axis: wp.int32) -> Parts:
    """Take in corner a, and where the edge a b crosses the plane.

    The crossing is known to 11 u of the larger corner (u = 2^-24): a difference, a quotient of two, a product, a sum.
    """
    none = wp.vec3f()
    if a[axis] <= plane:
        parts.below = taking_in(parts.below, a, none)
    if a[axis] >= plane:
        parts.above = taking_in(parts.above, a, none)
    if (a[axis] < plane and b[axis] > plane) or (a[axis] > plane and b[axis] < plane):
        at = a + (b - a) * ((plane - a[axis]) / (b[axis] - a[axis]))
        pad = (16.0 * U32) * wp.max(wp.abs(a), wp.abs(b)) + wp.vec3f(1.0e-37, 1.0e-37, 1.0e-37)
        parts.below = taking_in(parts.below, at, pad)
        parts.above = taking_in(parts.above, at, pad)
    return parts


@wp.func
def parts_of(mesh: Mesh, i: wp.int32, box: Box, plane: wp.float32, axis: wp.int32) -> Parts:
    """Divide the pair of triangle i, whose box is given. Every point of it within the box is in a part."""
    far = wp.vec3f(wp.INF, wp.INF, wp.INF)
    parts = Parts(Box(far, -far), Box(far, -far))
    corners = corners_of(mesh, i)
    parts = with_edge(parts, corners.a, corners.b, plane, axis)
    parts = with_edge(parts, corners.b, corners.c, plane, axis)
    parts = with_edge(parts, corners.c, corners.a, plane, axis)
    if not wp.isfinite(parts.below.low + parts.below.high + parts.above.low + parts.above.high):
        parts = Parts(box, box)  # beyond float32: both parts may be anywhere in the box
    below = Box(wp.max(parts.below.low, box.low), wp.min(parts.below.high, box.high))
    above = Box(wp.max(parts.above.low, box.low), wp.min(parts.above.high, box.high))
    below.high[axis] = wp.min(below.high[axis], plane)
    above.low[axis] = wp.max(above.low[axis], plane)
    return Parts(below, above)
