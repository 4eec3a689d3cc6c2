"""Closed surfaces: triangles that face away from the light decide no shadow bit, and the stream leaves them out.

Of a part that the harness proves closed (:mod:`......harness.scene.closed`) with the eye and the light outside its box, let
w(x) be how often its triangles wind around x: 0 at the eye and at the light. Going to the light, w falls by one where a
triangle is crossed that faces the light (from its back to its front), and rises by one where it faces away. A triangle whose
plane holds the light is not crossed. The nearest hit h of a pixel's ray lies on the triangle that the ray meets first, so
w = 0 on the way from the eye, up to a point e just before h. On the way on from e over h to the light, as many triangles
are therefore crossed that face the light as triangles that face away. So:

    If the open segment from h to the light meets a triangle that faces away, then it also meets one that faces the light,
    unless the turn at h itself crosses one that faces the light: it holds h, e is behind it, the light before it.

A segment through edges or corners is moved a little at h, the light staying where it is, until it crosses triangles inside;
what it crosses then meets it before, too, since triangles are closed sets and none of them holds the light. Nothing is asked
of the part but its edges: it may cross and touch itself and others, and triangles without area may be in it. So leaving out
what faces away changes no bit of a pixel, except in the case named last, of which there are two kinds:

* The hit triangle itself is seen from its back and faces the light. Where a surface is wound outward and does not cross
  itself, no visible triangle is seen from its back. The pass that resolves the answers counts all that are.
* Another triangle holds h: the eye sees it from behind, at an edge of the outline or where two sheets lie in one another. It
  faces the light, so it is streamed. Neither float32 nor float64 can tell on which side of it h lies, so the pair is
  among the undecided ones, and the pass that decides these counts it (:func:`touches`).

If either is counted, the frame is discarded and made again without this (:meth:`..method.StreamedMethod.grow`). So no
answer rests on an assumption on the mesh. What the harness proves, it proves of each frame's float32 positions.

The other rule that suggests itself, that a ray whose own triangle has eye and light on opposite sides is shadowed, holds
only where no other triangle of the part holds h. A sheet folded on itself has two there, both of which hold h and
shadow nothing; nothing that is streamed would tell. So it is not used.
"""

import warp as wp

from ....harness.frame.geometry import Corners, Mesh
from ....harness.scene.closed import CLOSED, TOUCHED, TURNED
from ...exact.hit_point import hit_error
from ...exact.planes import farthest_corner, longest_edge
from ...exact.segment import light_edge_error, light_edge_functions
from ...exact.triangle import CLOSED as INSIDE
from ...exact.triangle import U32, U64, largest, to_float64, total
from ...gpu.entries import entry, set_entry

CLOSED_BIT = wp.constant(wp.uint8(CLOSED))
TURNED_BIT = wp.constant(wp.uint8(TURNED))
TOUCHED_BIT = wp.constant(wp.uint8(TOUCHED))

TIE = wp.constant(wp.float64(2.0**-28))
"""Twice the share of their way in which two hits may differ whose keys are the same, of meshes that leave no bit of an
index to spare (:func:`...exact.triangle.nearness_key`).
"""


@wp.func
def outward(flags: wp.uint8) -> wp.float32:
    """1 where the corners of a triangle are listed as its part is wound, so that its normal points outward; or -1."""
    return wp.where((flags & TURNED_BIT) != wp.uint8(0), -1.0, 1.0)


@wp.func
def turned_away(flags: wp.uint8, light: wp.vec3f, corners: Corners) -> wp.bool:
    """Whether a triangle with such ``flags`` (:class:`......harness.frame.frame.Frame`) is of a closed part and certainly
    faces away from the light. The bound is that of :func:`...exact.planes.facing_to`.
    """
    if (flags & CLOSED_BIT) == wp.uint8(0):
        return False
    n = wp.cross(corners.a - corners.c, corners.b - corners.a)
    edge = longest_edge(corners)
    reach = farthest_corner(light, corners)
    square = edge * edge
    away = outward(flags) * wp.dot(n, corners.a - light)
    size = square * reach
    return away > 64.0 * U32 * size and square > 1.0e-30 and size > 1.0e-30 and size < 1.0e30


@wp.func
def refuse(mesh: Mesh, i: wp.int32, touched: wp.array(dtype=wp.int32)):
    """Note that the part of triangle i must count as open, and that the frame must be made again."""
    set_entry(mesh.valid, i, entry(mesh.valid, i) | TOUCHED_BIT)
    set_entry(touched, 0, 1)


@wp.func
def seen_from_back(flags: wp.uint8, direction: wp.vec3f, corners: Corners) -> wp.bool:
    """Whether a triangle with such ``flags`` that a ray hits is of a closed part, and seen from its back."""
    if (flags & CLOSED_BIT) == wp.uint8(0):
        return False
    a = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a, to_float64(corners.c) - a)
    return wp.float64(outward(flags)) * wp.dot(n, to_float64(direction)) >= wp.float64(0.0)


@wp.func
def touches(
    flags: wp.uint8, h: wp.vec3d, eye: wp.vec3f, light: wp.vec3f, corners: Corners, weld: wp.vec3i, spare: wp.int32
) -> wp.bool:
    """Whether a triangle with such ``flags`` is of a closed part, may hold a hit point, and may face the light and turn
    its back to the eye, of a triangle that does not occlude. spare: :func:`...exact.triangle.spare_bits`.
    """
    if (flags & CLOSED_BIT) == wp.uint8(0):
        return False
    a = to_float64(corners.a)
    b = to_float64(corners.b)
    c = to_float64(corners.c)
    l64 = to_float64(light)
    e64 = to_float64(eye)
    n = wp.cross(b - a, c - a) * wp.float64(outward(flags))
    rounding = wp.float64(16.0) * U64 * largest(b - a) * largest(c - a)
    if wp.dot(n, e64 - a) > rounding * total(e64 - a) or wp.dot(n, l64 - a) < -rounding * total(l64 - a):
        return False
    tie = TIE / wp.float64(1 << spare)
    error = hit_error(h, wp.float64(largest(eye))) + tie * largest(h - e64)
    if wp.abs(wp.dot(n, h - a)) > total(n) * error + rounding * total(h - a):
        return False
    e = light_edge_functions(l64, h, a, b, c, weld)
    edge = wp.max(largest(b - a), wp.max(largest(c - b), largest(a - c)))
    from_light = wp.max(largest(a - l64), wp.max(largest(b - l64), largest(c - l64)))
    slack = wp.abs(e[0] + e[1] + e[2]) * INSIDE
    slack += light_edge_error(h, l64, a, b, c, wp.float64(largest(eye))) + wp.float64(6.0) * from_light * edge * error
    return wp.min(e) >= -slack or wp.max(e) <= slack
