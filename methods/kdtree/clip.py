"""Boxes around the parts of a triangle on either side of a plane, rounded outwards."""

import warp as wp

from ...harness.frame.geometry import Mesh, corners_of
from ..exact.triangle import U32


@wp.struct
class Parts:
    """The boxes of both parts of a pair that a plane divides; ``below`` and ``above``: whether there is such a part."""

    below: wp.bool
    above: wp.bool
    below_low: wp.vec3f
    below_high: wp.vec3f
    above_low: wp.vec3f
    above_high: wp.vec3f


@wp.func
def with_edge(parts: Parts, a: wp.vec3f, b: wp.vec3f, plane: wp.float32, axis: wp.int32) -> Parts:
    """Take in corner a, and where the edge a b crosses the plane.

    The crossing is known to 11 u of the larger corner (u = 2^-24): a difference, a quotient of two, a product, a sum.
    """
    if a[axis] <= plane:
        parts.below_low = wp.min(parts.below_low, a)
        parts.below_high = wp.max(parts.below_high, a)
    if a[axis] >= plane:
        parts.above_low = wp.min(parts.above_low, a)
        parts.above_high = wp.max(parts.above_high, a)
    if (a[axis] < plane and b[axis] > plane) or (a[axis] > plane and b[axis] < plane):
        at = a + (b - a) * ((plane - a[axis]) / (b[axis] - a[axis]))
        pad = (16.0 * U32) * wp.max(wp.abs(a), wp.abs(b)) + wp.vec3f(1.0e-37, 1.0e-37, 1.0e-37)
        parts.below_low = wp.min(parts.below_low, at - pad)
        parts.below_high = wp.max(parts.below_high, at + pad)
        parts.above_low = wp.min(parts.above_low, at - pad)
        parts.above_high = wp.max(parts.above_high, at + pad)
    return parts


@wp.func
def is_box(low: wp.vec3f, high: wp.vec3f) -> wp.bool:
    return low[0] <= high[0] and low[1] <= high[1] and low[2] <= high[2]


@wp.func
def parts_of(mesh: Mesh, i: wp.int32, low: wp.vec3f, high: wp.vec3f, plane: wp.float32, axis: wp.int32) -> Parts:
    """Divide the pair of triangle i, whose box is (low, high). Every point of it within the box is in a part."""
    parts = Parts()
    far = wp.vec3f(wp.INF, wp.INF, wp.INF)
    parts.below_low = far
    parts.below_high = -far
    parts.above_low = far
    parts.above_high = -far
    corners = corners_of(mesh, i)
    parts = with_edge(parts, corners.a, corners.b, plane, axis)
    parts = with_edge(parts, corners.b, corners.c, plane, axis)
    parts = with_edge(parts, corners.c, corners.a, plane, axis)
    reach = parts.below_low + parts.below_high + parts.above_low + parts.above_high
    if not wp.isfinite(reach):
        # Beyond float32: both parts may be anywhere in the box.
        parts.below_low = low
        parts.above_low = low
        parts.below_high = high
        parts.above_high = high
    parts.below_low = wp.max(parts.below_low, low)
    parts.below_high = wp.min(parts.below_high, high)
    parts.above_low = wp.max(parts.above_low, low)
    parts.above_high = wp.min(parts.above_high, high)
    parts.below_high[axis] = wp.min(parts.below_high[axis], plane)
    parts.above_low[axis] = wp.max(parts.above_low[axis], plane)
    parts.below = is_box(parts.below_low, parts.below_high)
    parts.above = is_box(parts.above_low, parts.above_high)
    return parts
