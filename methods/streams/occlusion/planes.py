"""A triangle as shadow rays are tested against it: planes through the light in float32, with a bound on their error.

Each plane is n . p + c, with a bound on its float32 error at any hit point of the frame.
"""

import warp as wp

from ....harness.frame.geometry import Corners
from ...exact.planes import edge_plane, facing_to, plane_at
from ...exact.triangle import U32, largest
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
