"""Which cells of a face of the light's cube a triangle covers: float32, relative to the scene's middle.

Rays are placed in float64; a pad covers what float32 does to a triangle's corners, so a cell is left out only if no
ray in it can pass the triangle.
"""

from __future__ import annotations

import warp as wp

from ..common.triangle import U32, largest
from .light_bins import Cube, on_face
from .spans import Flat, row_span


@wp.func
def turned(v: wp.vec3f, cube: Cube) -> wp.vec3f:
    return wp.vec3f(wp.dot(cube.forward, v), wp.dot(cube.right, v), wp.dot(cube.up, v))


@wp.func
def cube_space(p: wp.vec3f, cube: Cube) -> wp.vec3f:
    return turned(p - cube.middle, cube) + wp.vec3f(cube.distance, 0.0, 0.0)


@wp.func
def on_cells(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, reach: wp.float32, r: wp.vec4f) -> Flat:
    """Cell coordinates of the corners on a face (corners given as along, across, up).

    ``reach`` bounds |p - middle|_1 of the corners: across and up are known to 8 u of it, so u = across / along to
    (1 + |u|) 16 u reach / along, and the rounding of u itself; a thousandth of a cell covers the scaling. Of the
    factor 32 taken, 2 are what the rays of a directional light turn by, seen from its post (:mod:`.light_bins`).
    """
    flat = Flat()
    nearest = wp.min(a[0], wp.min(b[0], c[0]))
    flat.known = nearest > 0.01 * wp.max(largest(a), wp.max(largest(b), largest(c)))
    if flat.known:
        low_u = r[0]
        low_v = r[1]
        per_u = r[2]
        per_v = r[3]
        ua = wp.vec2f(a[1] / a[0], a[2] / a[0])
        ub = wp.vec2f(b[1] / b[0], b[2] / b[0])
        uc = wp.vec2f(c[1] / c[0], c[2] / c[0])
        widest = wp.max(
            wp.max(wp.max(wp.abs(ua[0]), wp.abs(ua[1])), wp.max(wp.abs(ub[0]), wp.abs(ub[1]))),
            wp.max(wp.max(wp.abs(uc[0]), wp.abs(uc[1])), wp.max(wp.abs(low_u), wp.abs(low_v))),
        )
        flat.a = wp.vec2f((ua[0] - low_u) * per_u, (ua[1] - low_v) * per_v)
        flat.b = wp.vec2f((ub[0] - low_u) * per_u, (ub[1] - low_v) * per_v)
        flat.c = wp.vec2f((uc[0] - low_u) * per_u, (uc[1] - low_v) * per_v)
        flat.pad = 32.0 * U32 * ((1.0 + widest) * reach / nearest + widest) * wp.max(per_u, per_v) + 1.0e-3
    return flat


@wp.func
def whole_cells(x: wp.float32, cells: wp.int32) -> wp.int32:
    return wp.int32(wp.clamp(x, 0.0, wp.float32(cells) - 0.5))


@wp.func
def flat_box(flat: Flat, cells: wp.int32) -> wp.vec4i:
    """First and last column and row of cells; empty if last < first."""
    x0 = wp.min(flat.a[0], wp.min(flat.b[0], flat.c[0])) - flat.pad
    y0 = wp.min(flat.a[1], wp.min(flat.b[1], flat.c[1])) - flat.pad
    x1 = wp.max(flat.a[0], wp.max(flat.b[0], flat.c[0])) + flat.pad
    y1 = wp.max(flat.a[1], wp.max(flat.b[1], flat.c[1])) + flat.pad
    n = wp.float32(cells)
    if x1 < 0.0 or y1 < 0.0 or x0 > n or y0 > n:
        return wp.vec4i(0, 0, -1, -1)
    return wp.vec4i(
        whole_cells(x0, cells), whole_cells(y0, cells), whole_cells(x1, cells), whole_cells(y1, cells)
    )


@wp.func
def beyond_face(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, slack: wp.float32) -> wp.bool:
    """Whether the whole triangle lies certainly behind a face's centre or beyond one of its four sides."""
    least = wp.min(a[0], wp.min(b[0], c[0]))
    most = wp.max(a[0], wp.max(b[0], c[0]))
    return (
        most < -slack
        or (a[1] - a[0] > slack and b[1] - b[0] > slack and c[1] - c[0] > slack)
        or (-a[1] - a[0] > slack and -b[1] - b[0] > slack and -c[1] - c[0] > slack)
        or (a[2] - a[0] > slack and b[2] - b[0] > slack and c[2] - c[0] > slack)
        or (-a[2] - a[0] > slack and -b[2] - b[0] > slack and -c[2] - c[0] > slack)
    ) and least < wp.INF


@wp.func
def between_planes(
    light: wp.vec3f,
    cube: Cube,
    face: wp.int32,
    a: wp.vec3f,
    b: wp.vec3f,
    c: wp.vec3f,
    r: wp.vec4f,
    y0: wp.int32,
    y1: wp.int32,
    cells: wp.int32,
) -> wp.vec2i:
    """First and last cell of rows y0..y1 that a triangle reaching behind the face's centre may cover.

    On a face the planes through the light and the edges are lines n0 + n1 u + n2 v >= 0; they hold for triangles
    that cannot be projected, too. Such a triangle is near the light for its size, so corners relative to the
    light are precise enough.
    """
    qa = on_face(turned(a - light, cube), face)
    qb = on_face(turned(b - light, cube), face)
    qc = on_face(turned(c - light, cube), face)
    ab = qb - qa
    bc = qc - qb
    ca = qa - qc
    det = wp.dot(wp.cross(ca, ab), qa)
    reach = wp.max(largest(qa), wp.max(largest(qb), largest(qc)))
    edge = wp.max(largest(ab), wp.max(largest(bc), largest(ca)))
    if not (wp.abs(det) > 256.0 * U32 * edge * edge * reach):
        return wp.vec2i(0, cells - 1)
    sign = wp.sign(det)
    hair = 0.01
    v0 = r[1] + (wp.float32(y0) - hair) / r[3]
    v1 = r[1] + (wp.float32(y1 + 1) + hair) / r[3]
    error = 256.0 * U32 * reach * edge
    low = wp.float32(-2.0)
    high = wp.float32(2.0)
    for k in range(3):
        n = wp.cross(qb, bc) * sign
        if k == 1:
            n = wp.cross(qc, ca) * sign
        if k == 2:
            n = wp.cross(qa, ab) * sign
        rest = n[0] + wp.max(n[2] * v0, n[2] * v1) + error
        if wp.abs(n[1]) > error:
            u = -rest / n[1]
            if n[1] > 0.0:
                low = wp.max(low, u - 1.0e-5)
            else:
                high = wp.min(high, u + 1.0e-5)
        elif rest + 2.0 * error < 0.0:
            high = wp.float32(-2.0)
    first = wp.floor(wp.clamp((low - r[0]) * r[2] - 0.1, 0.0, wp.float32(cells)))
    last = wp.floor(wp.clamp((high - r[0]) * r[2] + 0.1, -1.0, wp.float32(cells - 1)))
    return wp.vec2i(wp.int32(first), wp.int32(last))


@wp.func
def row_cells(
    flat: Flat,
    light: wp.vec3f,
    cube: Cube,
    face: wp.int32,
    a: wp.vec3f,
    b: wp.vec3f,
    c: wp.vec3f,
    r: wp.vec4f,
    y0: wp.int32,
    y1: wp.int32,
    cells: wp.int32,
) -> wp.vec2i:
    """First and last cell of rows y0..y1 that the triangle may cover; none if last < first."""
    if not flat.known:
        return between_planes(light, cube, face, a, b, c, r, y0, y1, cells)
    span = row_span(flat, wp.float32(y0), wp.float32(y1 + 1))
    if span[1] < 0.0 or span[0] > wp.float32(cells):
        return wp.vec2i(0, -1)
    return wp.vec2i(whole_cells(span[0], cells), whole_cells(span[1], cells))
