"""A triangle as shadow rays are tested against it: planes through the light in float32, with a bound on their error.

Each plane is n . p + c, with a bound on its float32 error at any hit point of the frame.
"""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Corners
from ...exact.segment import side_of_light
from ...exact.triangle import U32, largest
from ...gpu.division import about_inverse
from ..cube.rectangle import max_coordinate_of


@wp.struct
class Occluder:
    """A triangle as rays are tested against it: inward planes through the light and the edges, and the triangle's plane,
    positive on the light's side.

    Each plane is (n, c): signs of n . p + c beyond ``bound`` are certain for every hit point p of the frame. All are zero
    where float64 must decide.

    i      the triangle                     bound  :func:`bound_of`
    sure   signs beyond it are a certain hit: the bound, or infinite where the triangle has holes
    """

    e0: wp.vec4f
    e1: wp.vec4f
    e2: wp.vec4f
    plane: wp.vec4f
    i: wp.int32
    bound: wp.float32
    sure: wp.float32


@wp.struct
class Facing:
    """How a triangle lies to a light: the normal of its plane, positive on the light's side, and the factor that scales the
    planes through its edges and turns them inside. Zeros if float64 must decide. never: the plane contains the light, so
    that the triangle occludes no ray (:func:`...exact.segment.occludes`)."""

    normal: wp.vec3f
    toward: wp.float32
    never: wp.bool


@wp.func
def facing_to(light: wp.vec3f, corners: Corners, closely: wp.bool) -> Facing:
    """A :class:`Facing`, computed in float32; ``closely``: a triangle seen edge-on within its rounding in float64."""
    la = corners.a - light
    lb = corners.b - light
    lc = corners.c - light
    ab = corners.b - corners.a
    bc = corners.c - corners.b
    ca = corners.a - corners.c
    reach = wp.max(largest(la), wp.max(largest(lb), largest(lc)))
    edge = wp.max(largest(ab), wp.max(largest(bc), largest(ca)))
    facing = Facing()
    if not (reach * edge > 1.0e-30 and reach * edge < 1.0e30 and edge * edge > 1.0e-30):
        return facing
    n = wp.cross(ca, ab) * about_inverse(edge * edge)
    det = wp.dot(n, la)
    if not (wp.abs(det) > 64.0 * U32 * reach):
        if not closely:
            return facing
        det = side_of_light(light, corners)
        facing.never = det == 0.0
        if facing.never:
            return facing
    toward = about_inverse(reach * edge)
    # Inside is positive, and so is the light's side of the triangle.
    facing.normal = wp.where(det > 0.0, -n, n)
    facing.toward = wp.where(det > 0.0, toward, -toward)
    return facing


@wp.func
def plane_at(n: wp.vec3f, p: wp.vec3f) -> wp.vec4f:
    """The plane of normal n through p."""
    return wp.vec4f(n[0], n[1], n[2], -wp.dot(n, p))


@wp.func
def edge_plane(light: wp.vec3f, p: wp.vec3f, q: wp.vec3f, toward: wp.float32) -> wp.vec4f:
    """The plane through the light and an edge p-q of a triangle, which is ``toward`` it (:class:`Facing`)."""
    return plane_at(wp.cross(p - light, q - p) * toward, p)


@wp.func
def set_planes(occluder: Occluder, light: wp.vec3f, corners: Corners, closely: wp.bool) -> Occluder:
    """Planes in float32: n = (p - light) x (q - p), scaled so that its parts are at most 2. What a scale is off is the same
    for all parts of a plane, so it moves none.

    A triangle that the light sees edge-on within rounding gets zeros: float64 decides all its candidates. With ``closely``
    it gets its planes, and one that every ray misses if float64 finds it edge-on, too. That is for large triangles: where
    the light stands in a surface, millions of pairs would be left to float64.
    """
    o = occluder
    facing = facing_to(light, corners, closely)
    o.e0 = edge_plane(light, corners.b, corners.c, facing.toward)
    o.e1 = edge_plane(light, corners.c, corners.a, facing.toward)
    o.e2 = edge_plane(light, corners.a, corners.b, facing.toward)
    o.plane = plane_at(facing.normal, corners.a)
    if facing.never:
        o.e0 = wp.vec4f(0.0, 0.0, 0.0, -wp.INF)
    return o


@wp.func
def occludes_none(o: Occluder) -> wp.bool:
    """Whether every ray misses a triangle because the light lies in its plane (:func:`set_planes`)."""
    return o.e0[3] == -wp.INF


@wp.func
def sign_bound(size: wp.float32) -> wp.float32:
    """Error of n . h + c, where ``size`` bounds every coordinate of the hit points and of the triangle.

    n is known to 8 u per component; over |h - p|_1 <= 6 size that is 48 u size, and n . h + c rounds by 78 u size more.
    A hit point may be off by u size more in each coordinate (:mod:`..rays.hit_points`), which is 6 u size.
    """
    return 134.0 * U32 * size + 1.0e-36


@wp.func
def bound_of(row: wp.vec4f, corners: Corners) -> wp.float32:
    """:func:`sign_bound` of a triangle and every hit point of a light (:func:`..cube.rectangle.last_row`)."""
    size = wp.max(largest(corners.a), wp.max(largest(corners.b), largest(corners.c)))
    return sign_bound(wp.max(max_coordinate_of(row), size))


@wp.func
def occluder_of(
    i: wp.int32, holes: wp.bool, light: wp.vec3f, corners: Corners, row: wp.vec4f, closely: wp.bool
) -> Occluder:
    """A triangle, which may have ``holes``, as a light's rays are tested against it; ``row``:
    :func:`..cube.rectangle.last_row`; ``closely``: :func:`set_planes`."""
    o = Occluder()
    o.i = i
    o.bound = bound_of(row, corners)
    o.sure = wp.where(holes, wp.INF, o.bound)
    return set_planes(o, light, corners, closely)
