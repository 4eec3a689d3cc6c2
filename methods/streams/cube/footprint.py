"""Which cells of a face of the light's cube a triangle covers: float32, relative to the scene's middle.

Coordinates on a face are in bins, which become cells in the end (:mod:`.spacing`). Rays are placed in float64; a pad covers
the float32 rounding of a triangle's corners, so a cell is left out only if no ray in it can meet the triangle.
"""

from typing import Any

import warp as wp

from ....harness.frame.geometry import Corners
from ...exact.planes import longest_edge
from ...exact.triangle import U32, total
from ...gpu.division import LARGEST_DIVISOR, LEAST_DIVISOR, about_inverse
from ..camera.pixels import largest_of
from .cells import on_face
from .lights import Cube, turned
from .rectangle import BINS, max_coordinate_of
from .spacing import BIN_SLACK, CELL_SLACK, in_cells, row_between

FINEST = wp.constant(2.0**-31)
"""32 u of this are 2^-50: a ray's place is a difference of float64, known to 2^-50 of the way to the light. More than u
where a few vertices lie 2^26 times as far away as the others, and the light far beyond them.
"""


@wp.struct
class Flat:
    """A triangle projected to a face, in bins (:mod:`.spacing`). ``pad`` bounds the error of a coordinate.

    ``valid``: :func:`is_projected`.
    """

    a: wp.vec2f
    b: wp.vec2f
    c: wp.vec2f
    pad: wp.float32
    valid: wp.bool


@wp.func
def cube_space(p: wp.vec3f, cube: Cube) -> wp.vec3f:
    q = turned(p - cube.middle, cube)
    return wp.vec3f(q[0] + cube.distance, q[1], q[2])


@wp.func
def in_cube_space(corners: Corners, cube: Cube) -> Corners:
    return Corners(cube_space(corners.a, cube), cube_space(corners.b, cube), cube_space(corners.c, cube))


@wp.func
def corners_on(q: Corners, face: wp.int32) -> Corners:
    """Corners in the space of the cube, in the frame of a face: (along, across, up)."""
    return Corners(on_face(q.a, face), on_face(q.b, face), on_face(q.c, face))


@wp.func
def extent_from(middle: wp.vec3f, corners: Corners) -> wp.float32:
    """The largest |p - middle|_1 of the corners."""
    return wp.max(total(corners.a - middle), wp.max(total(corners.b - middle), total(corners.c - middle)))


@wp.func
def extent_with_rays(cube: Cube, corners: Corners, row: wp.vec4f) -> wp.float32:
    """:func:`extent_from`, enlarged so that bounds of 32 u extent cover four times what hit points are off by,
    which is at most u of their largest coordinate (:mod:`..rays.hit_points`).
    """
    return extent_from(cube.middle, corners) + 0.125 * max_coordinate_of(row)


@wp.func
def depth_slack(extent: wp.float32, cube: Cube) -> wp.float32:
    """Error bound of a corner's coordinate on the cube: depths are known to 8 u extent, and those of receivers to u of
    their own and what :func:`extent_with_rays` adds for them.
    """
    return 32.0 * U32 * (extent + cube.distance)


@wp.func
def is_projected(q: Corners) -> wp.bool:
    """Whether no corner on a face lies behind the centre of projection, or too near its plane to be projected."""
    nearest = wp.min(q.a[0], wp.min(q.b[0], q.c[0]))
    farthest = largest_of(q)
    return nearest > 0.01 * farthest and nearest > LEAST_DIVISOR and farthest < LARGEST_DIVISOR


@wp.func
def on_bins(q: Corners, extent: wp.float32, r: wp.vec4f) -> Flat:
    """The corners on a face (:func:`corners_on`) in bins; ``r``: the face's row of the table.

    ``extent`` bounds |p - middle|_1 of the corners: across and up are known to 8 u of it, so u = across / along to
    (1 + |u|) 16 u extent / along, and to 3 u of itself (:func:`...gpu.division.about_inverse`).
    """
    flat = Flat()
    flat.valid = is_projected(q)
    if flat.valid:
        low_u = r[0]
        low_v = r[1]
        per_u = r[2]
        per_v = r[3]
        near_a = about_inverse(q.a[0])
        near_b = about_inverse(q.b[0])
        near_c = about_inverse(q.c[0])
        ua = wp.vec2f(q.a[1] * near_a, q.a[2] * near_a)
        ub = wp.vec2f(q.b[1] * near_b, q.b[2] * near_b)
        uc = wp.vec2f(q.c[1] * near_c, q.c[2] * near_c)
        nearness = wp.max(near_a, wp.max(near_b, near_c))
        widest = wp.max(
            wp.max(wp.max(wp.abs(ua[0]), wp.abs(ua[1])), wp.max(wp.abs(ub[0]), wp.abs(ub[1]))),
            wp.max(wp.max(wp.abs(uc[0]), wp.abs(uc[1])), wp.max(wp.max(wp.abs(low_u), wp.abs(low_v)), FINEST)),
        )
        flat.a = wp.vec2f((ua[0] - low_u) * per_u, (ua[1] - low_v) * per_v)
        flat.b = wp.vec2f((ub[0] - low_u) * per_u, (ub[1] - low_v) * per_v)
        flat.c = wp.vec2f((uc[0] - low_u) * per_u, (uc[1] - low_v) * per_v)
        flat.pad = 32.0 * U32 * ((1.0 + widest) * extent * nearness + widest) * wp.max(per_u, per_v) + BIN_SLACK
    return flat


@wp.func
def first_cell(cells: Any, axis: wp.int32, face: wp.int32, t: wp.float32, along: wp.int32) -> wp.int32:
    """The first column or row that may hold a ray at t (in bins) or beyond."""
    return wp.int32(wp.max(in_cells(cells, axis, face, t, along) - CELL_SLACK, 0.0))


@wp.func
def last_cell(cells: Any, axis: wp.int32, face: wp.int32, t: wp.float32, along: wp.int32) -> wp.int32:
    """The last column or row that may hold a ray at t (in bins) or before."""
    return wp.min(wp.int32(in_cells(cells, axis, face, t, along) + CELL_SLACK), along - 1)


@wp.func
def flat_box(flat: Flat, face: wp.int32, along: wp.int32, cells: Any) -> wp.vec4i:
    """First and last column and row of cells, ``along`` on the face; empty if last < first. All cells if corners cannot be
    projected.
    """
    if not flat.valid:
        return wp.vec4i(0, 0, along - 1, along - 1)
    x0 = wp.min(flat.a[0], wp.min(flat.b[0], flat.c[0])) - flat.pad
    y0 = wp.min(flat.a[1], wp.min(flat.b[1], flat.c[1])) - flat.pad
    x1 = wp.max(flat.a[0], wp.max(flat.b[0], flat.c[0])) + flat.pad
    y1 = wp.max(flat.a[1], wp.max(flat.b[1], flat.c[1])) + flat.pad
    n = wp.float32(BINS)
    if x1 < 0.0 or y1 < 0.0 or x0 > n or y0 > n:
        return wp.vec4i(0, 0, -1, -1)
    return wp.vec4i(
        first_cell(cells, 0, face, x0, along),
        first_cell(cells, 1, face, y0, along),
        last_cell(cells, 0, face, x1, along),
        last_cell(cells, 1, face, y1, along),
    )


@wp.func
def beyond_face(q: Corners, slack: wp.float32) -> wp.bool:
    """Whether the whole triangle lies certainly behind a face's centre or beyond one of its four sides."""
    a = q.a
    b = q.b
    c = q.c
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
def leaves_out(several: wp.bool, q: Corners, slack: wp.float32) -> wp.bool:
    """Whether a triangle lies certainly :func:`beyond_face`. Where only one of the faces has rays (not ``several``) that is
    asked only if the box of its cells cannot tell.
    """
    if several or not is_projected(q):
        return beyond_face(q, slack)
    return False


@wp.struct
class Sides:
    """Lines that bound a triangle on a face, in bins: at height y, line[0] + (y - line[1]) line[2] is a lower bound where
    line[3] > 0, an upper bound where it is < 0, and no bound where it is 0.
    """

    line0: wp.vec4f
    line1: wp.vec4f
    line2: wp.vec4f


@wp.func
def side_of(p: wp.vec2f, q: wp.vec2f, other: wp.vec2f, pad: wp.float32) -> wp.vec4f:
    """The line of an edge p-q; ``other`` lies on the inner side.

    A point of the triangle is a mean of corners, so it is off by no more than the pad of a corner, up and across. The
    rounding of the line is small compared with the slack.
    """
    rise = q[1] - p[1]
    if not (wp.abs(rise) > 1.0e-6 * (wp.abs(q[0] - p[0]) + 1.0)):
        return wp.vec4f(0.0, 0.0, 0.0, 0.0)
    slope = (q[0] - p[0]) / rise
    side = wp.float32(1.0)
    if other[0] < p[0] + (other[1] - p[1]) * slope:
        side = -1.0
    far = wp.max(wp.abs(p[0]), wp.max(wp.abs(q[0]), wp.abs(other[0])))
    slack = pad + wp.abs(slope) * (pad + BIN_SLACK) + 1.0e-5 * wp.max(far, 1.0)
    return wp.vec4f(p[0] - side * slack, p[1], slope, side)


@wp.func
def side_of_plane(n: wp.vec3f, error: wp.float32, r: wp.vec4f) -> wp.vec4f:
    """The line n0 + n1 u + n2 v >= -error in bins, taken from the middle of the face."""
    middle = 0.5 * wp.float32(BINS)
    # A line along the row is replaced by a very steep one: |u| <= 1, so the difference is at most three errors. One is for
    # the line, and one for what a hit point may be off in v (:mod:`..rays.hit_points`).
    across = n[1]
    if not (wp.abs(across) > error):
        across = 2.0 * error
    v = r[1] + middle / r[3]
    u = -(n[0] + n[2] * v) / across
    slope = -(n[2] / across) * (r[2] / r[3])
    if not (wp.abs(slope) < 1.0e9 and wp.abs(u) < 1.0e9):
        return wp.vec4f(0.0, 0.0, 0.0, 0.0)
    side = wp.sign(across)
    slack = 0.004 + wp.abs(slope) * (4.0 * BIN_SLACK) + (5.0 * error / wp.abs(across) + 2.0e-5) * r[2]
    return wp.vec4f((u - r[0]) * r[2] - side * slack, middle, slope, side)


@wp.func
def sides_of_planes(light: wp.vec3f, cube: Cube, face: wp.int32, corners: Corners, r: wp.vec4f) -> Sides:
    """Lines of a triangle that reaches behind the face's centre.

    On a face the planes through the light and the edges are lines n0 + n1 u + n2 v >= 0; they hold for triangles
    that cannot be projected, too. Such a triangle is near the light for its size, so corners relative to the
    light are precise enough. They are brought to a size of 1, since products of three lengths leave float32.
    """
    sides = Sides()
    qa = on_face(turned(corners.a - light, cube), face)
    qb = on_face(turned(corners.b - light, cube), face)
    qc = on_face(turned(corners.c - light, cube), face)
    size = largest_of(Corners(qa, qb, qc))
    if not (size > LEAST_DIVISOR and size < LARGEST_DIVISOR):
        return sides
    scale = about_inverse(size)
    qa *= scale
    qb *= scale
    qc *= scale
    ab = qb - qa
    bc = qc - qb
    ca = qa - qc
    det = wp.dot(wp.cross(ca, ab), qa)
    edge = longest_edge(Corners(qa, qb, qc))
    if not (wp.abs(det) > 256.0 * U32 * edge * edge):
        return sides
    sign = wp.sign(det)
    error = 256.0 * U32 * edge
    sides.line0 = side_of_plane(wp.cross(qb, bc) * sign, error, r)
    sides.line1 = side_of_plane(wp.cross(qc, ca) * sign, error, r)
    sides.line2 = side_of_plane(wp.cross(qa, ab) * sign, error, r)
    return sides


@wp.func
def sides_on_face(flat: Flat, light: wp.vec3f, cube: Cube, face: wp.int32, corners: Corners, r: wp.vec4f) -> Sides:
    """The lines that bound a triangle's cells on a face, from its projection if that is known."""
    if not flat.valid:
        return sides_of_planes(light, cube, face, corners, r)
    sides = Sides()
    sides.line0 = side_of(flat.a, flat.b, flat.c, flat.pad)
    sides.line1 = side_of(flat.b, flat.c, flat.a, flat.pad)
    sides.line2 = side_of(flat.c, flat.a, flat.b, flat.pad)
    return sides


@wp.func
def cells_of_row(
    sides: Sides, face: wp.int32, y: wp.int32, first: wp.int32, last: wp.int32, along: wp.int32, cells: Any
) -> wp.vec2i:
    """First and last cell of first..last in row y that the triangle may cover; none if last < first."""
    row = row_between(cells, face, y, along)
    low = wp.float32(0.0)
    high = wp.float32(BINS)
    for k in range(3):
        line = sides.line0
        if k == 1:
            line = sides.line1
        if k == 2:
            line = sides.line2
        # A line bounds the row by what it is where the row begins or ends.
        at = wp.where(line[2] * line[3] > 0.0, row[0], row[1])
        x = line[0] + (at - line[1]) * line[2]
        # A line that is not a number leaves nothing out.
        if line[3] > 0.0 and x > low:
            low = x
        if line[3] < 0.0 and x < high:
            high = x
    if low > high:
        return wp.vec2i(0, -1)
    return wp.vec2i(
        wp.max(first, first_cell(cells, 0, face, low, along)), wp.min(last, last_cell(cells, 0, face, high, along))
    )
