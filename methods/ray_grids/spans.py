"""Which blocks of a grid a projected triangle touches, row by row: plain geometry in the plane of the grid."""

from __future__ import annotations

import warp as wp


@wp.struct
class Flat:
    """A triangle projected to grid coordinates, in cells or pixels. ``pad`` bounds the error of a coordinate.

    ``known`` is False where a corner lies behind the centre of projection, or too near its plane to be projected.
    """

    a: wp.vec2f
    b: wp.vec2f
    c: wp.vec2f
    pad: wp.float32
    known: wp.bool


@wp.func
def edge_span(span: wp.vec2f, p: wp.vec2f, q: wp.vec2f, low: wp.float32, high: wp.float32) -> wp.vec2f:
    """Widen (least x, most x) by the part of the edge p-q with low <= y <= high."""
    if wp.max(p[1], q[1]) < low or wp.min(p[1], q[1]) > high:
        return span
    px = p[0]
    qx = q[0]
    rise = q[1] - p[1]
    if wp.abs(rise) > 1.0e-6 * (wp.abs(q[0] - p[0]) + 1.0):
        slope = (q[0] - p[0]) / rise
        t0 = wp.clamp(low, wp.min(p[1], q[1]), wp.max(p[1], q[1]))
        t1 = wp.clamp(high, wp.min(p[1], q[1]), wp.max(p[1], q[1]))
        px = p[0] + (t0 - p[1]) * slope
        qx = p[0] + (t1 - p[1]) * slope
    return wp.vec2f(wp.min(span[0], wp.min(px, qx)), wp.max(span[1], wp.max(px, qx)))


@wp.func
def row_span(flat: Flat, low: wp.float32, high: wp.float32) -> wp.vec2f:
    """Least and most x of the triangle between two horizontal lines; least > most where it is not there.

    The corners of the clipped triangle all lie on its edges. Between two corners that are off by the pad an edge is
    off by no more, so the pad is added to the rows before the edge is cut, and to the columns after.
    """
    lo = low - flat.pad
    hi = high + flat.pad
    span = wp.vec2f(wp.INF, -wp.INF)
    span = edge_span(span, flat.a, flat.b, lo, hi)
    span = edge_span(span, flat.b, flat.c, lo, hi)
    span = edge_span(span, flat.c, flat.a, lo, hi)
    far = wp.max(wp.abs(flat.a[0]), wp.max(wp.abs(flat.b[0]), wp.abs(flat.c[0])))
    slack = flat.pad + 1.0e-5 * wp.max(far, 1.0)
    return wp.vec2f(span[0] - slack, span[1] + slack)
