"""A plane through a point and an edge in float32, and the bound on its error, derived once.

The plane through o and the edge p q has the normal n = (p - o) x (q - p). With u = 2^-24, P = |p - o|_max and
Q = |q - p|_max: of a component, each of two products is off by 3 u P Q (two differences and the product), and their
difference by 2 u P Q more. So **n is known to 8 u P Q per component**; fused multiply-adds only round less. A sum
n . v of three products of components of at most 2 P Q adds at most 8 u P Q |v|_1: **n . v is known to 16 u P Q |v|_1**.

The difference form is right at any distance of o. A value relative to the scene, n . h + c with c = -n . p, is known to
8 u P Q |h - p|_1 and the rounding of the two sums; and two triangles at an edge compute the same plane if both take it
from the vertex with the lower weld index (:func:`edge_normal`), so that no ray is rejected by both.
"""

import warp as wp

from ...harness.frame.geometry import Corners
from ..gpu.division import about_inverse
from .segment import side_of_light
from .triangle import U32, largest


@wp.func
def normal_through(o: wp.vec3f, p: wp.vec3f, q: wp.vec3f) -> wp.vec3f:
    """The normal of the plane through o and the edge p q."""
    return wp.cross(p - o, q - p)


@wp.func
def edge_normal(o: wp.vec3f, p: wp.vec3f, q: wp.vec3f, weld_p: wp.int32, weld_q: wp.int32) -> wp.vec3f:
    """The same, taken from the vertex with the lower weld index."""
    if weld_p < weld_q:
        return normal_through(o, p, q)
    return -normal_through(o, q, p)


@wp.func
def plane_at(n: wp.vec3f, p: wp.vec3f) -> wp.vec4f:
    """The plane of normal n through p."""
    return wp.vec4f(n[0], n[1], n[2], -wp.dot(n, p))


@wp.func
def edge_plane(o: wp.vec3f, p: wp.vec3f, q: wp.vec3f, scale: wp.float32) -> wp.vec4f:
    """The plane through o and an edge p q. What a scale is off is the same for all parts of a plane, so it moves none."""
    return plane_at(normal_through(o, p, q) * scale, p)


@wp.func
def longest_edge(corners: Corners) -> wp.float32:
    """By the largest coordinate."""
    ab = corners.b - corners.a
    bc = corners.c - corners.b
    ca = corners.a - corners.c
    return wp.max(largest(ab), wp.max(largest(bc), largest(ca)))


@wp.func
def farthest_corner(o: wp.vec3f, corners: Corners) -> wp.float32:
    """From o, by the largest coordinate."""
    return wp.max(largest(corners.a - o), wp.max(largest(corners.b - o), largest(corners.c - o)))


@wp.struct
class Facing:
    """How a triangle lies to a light: the normal of its plane, positive on the light's side, and the factor that scales the
    planes through its edges and turns them inside. Zeros if float64 must decide. never: the plane contains the light, so
    that the triangle occludes no ray (:func:`.segment.occludes`).
    """

    normal: wp.vec3f
    toward: wp.float32
    never: wp.bool


@wp.func
def facing_to(light: wp.vec3f, corners: Corners, closely: wp.bool) -> Facing:
    """A :class:`Facing`, computed in float32; ``closely``: a triangle seen edge-on within its rounding in float64."""
    la = corners.a - light
    ab = corners.b - corners.a
    ca = corners.a - corners.c
    reach = farthest_corner(light, corners)
    edge = longest_edge(corners)
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
