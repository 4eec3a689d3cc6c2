"""Records of triangles for an origin that many rays share: a test is then a few multiplications and additions.

For the eye: three edge planes through it, n_k . d > 0 inside, and m with 1 / t = m . d on the triangle's plane; 48 bytes.
For a light: three planes through it and the edges, n_k . p + c_k > 0 inside, and the triangle's plane, positive on the
light's side, for hit points p; 48 bytes, and 16 in an array apart, which few tests read. With the light as origin a test
would be as short as the eye's, but wrong where the light is far. Here all errors are relative to the size of the scene.

Planes are computed in float64, rounded, and scaled in float32: two roundings. Each is scaled by its own largest part, or by
a little more where the slack that closed triangles have (:func:`..exact.triangle.hit_distance`: 2^-30 of the sum s of the
unscaled edge functions) would otherwise be more than a part of the bound, or where float64's own rounding would show. So
with u = 2^-24, of directions d, and of hit points and corners whose coordinates the scene's box bounds by M:

* n . d is known to 4 u |d|_1 (two roundings of n; two of products and sums that are fused, and one in proportion to the
  result, which cannot change its sign), or to 5 u |d|_1 where they are not fused. The slack is at most
  2^-30 |n|_1 |d|_1 / (2^-6 |n|_1) = u |d|_1: beyond :data:`EYE_UNITS` = 5.5 or 6.5 units its sign is that of float64's
  verdict.
* n . p + c is known to 25.1 u M (6 for n, 6 for c, 3 for p's own rounding, 1 for its error before
  (:func:`..exact.hit_point.is_vague`), 9 for fused products and sums from c on, 0.1 for a light that is brought nearer), or
  to 34.1 u M where they are not fused. The
  sum s is at most |n|_1 (M + |light|), so that here planes are scaled by at least 2^-6 |n|_1 (M + |light|) / M, and the
  slack is at most u M again: :data:`LIGHT_UNITS` = 27 or 36 units of M.
  The triangle's own plane has no slack, but float64's own rounding shows: heights of less than 2^-21 of distance times
  edge^2 are not used, so that |n|_1 is at least 2^-21 edge^2. Then the rounding of n and float64's threshold
  (:func:`..exact.segment.plane_crosses_segment`) are less than 1.7 u M.
* What float32 loses of n and c where they are below its normal numbers is 2^-150 times the scale, of which the scale may
  make 0.05 u M at most (:func:`plane_word`).
* m . d is known to 7 u |m|_max |d|_1 (four roundings of m, three of products and sums) where the triangle's height over the
  eye, as float64 has it, is right to 2^-27; else it is not used. :data:`DEPTH_UNITS` = 10 cover the rounding of its bounds.

Of the scale itself no rounding matters: the parts of a plane share it.

**Two triangles that join.** Triangles 2 k and 2 k + 1 of the mesh mostly have an edge in common (:func:`joined_pairs`). Let
both pass it in opposite directions, and the light see the same side of both, so that it lies off both planes. With v and w
their third corners, w lies on the light's side of the first triangle's plane exactly if v lies on the light's side of the
second's: it is one determinant. If so, the first triangle lies on the light's side of the second's plane, as does every
way from it to the light, which therefore does not cross the second triangle. If not, the second triangle lies behind the
first one's plane. In either case neither hides any point of the other.

A ray that float64 takes to meet the first triangle although it passes beside the common edge, by a rounding of float64, has
its hit point behind the second triangle where the two form a valley. Here it is lit; the shared test, which other methods
use, finds it hidden. The referee counts neither as an error: such a ray is a near tie.

Planes of zeros, and an infinite m, leave every ray to float64, whatever was hit before: triangles seen edge-on, or
from close to their plane, and sizes that float32 does not hold.
"""

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ....harness.frame.geometry import Corners, Mesh
from ....harness.scene.prepared import Prepared
from ...common.axes import brought_nearer
from ...common.reads import corners_at
from ...exact.planes import farthest_corner, longest_edge
from ...exact.triangle import largest, to_float32, to_float64, total
from ...gpu.entries import entry, set_entry
from ..constants import RECORD_REGISTERS
from ..native import BASICS

EYE_UNITS = "(FUSED ? 5.5f : 6.5f)"
DEPTH_UNITS = "10.0f"
LIGHT_UNITS = "(FUSED ? 27.0f : 36.0f)"
"""C++, where :data:`..native.BASICS` tells whether products and sums are fused."""

CLOSED = wp.constant(2.0**-6)
ROUNDED = wp.constant(2.0**-20)
FLAT = wp.constant(2.0**-21)
SMALLEST = wp.constant(1.0e-30)
LARGEST = wp.constant(1.0e35)
DEEPEST = wp.constant(1.0e30)
STRETCHED = wp.constant(1.0e36)
FARTHEST = wp.constant(1.0e38)

FAR = wp.constant(2.0**34)
"""Planes pass through a light at most so many times as far away as the scene is large (:func:`nearer`). Of the way to a
directional light float32 holds no square: every triangle but small ones would be left to float64.
"""


def joined_pairs(prepared: Prepared) -> NDArray[np.uint8]:
    """1 for each pair of triangles 2 k and 2 k + 1 that has a common edge, which the two pass in opposite directions."""
    faces = prepared.faces if prepared.moves else prepared.weld[prepared.faces]
    pairs = faces[: len(faces) // 2 * 2].reshape(-1, 2, 3)
    joined = np.zeros((len(faces) + 1) // 2, dtype=np.uint8)
    for i in range(3):
        for k in range(3):
            first, second = pairs[:, 0], pairs[:, 1]
            opposite = (first[:, i] == second[:, (k + 1) % 3]) & (first[:, (i + 1) % 3] == second[:, k])
            joined[: len(pairs)] |= opposite
    return joined


@wp.struct
class LightPlanes:
    """The triangles' records for a light.

    edges   vec4f [3 * triangles]: of each the planes through the light and its edges; in float32, :func:`float32_kernel`'s
    sides   vec4f [triangles]: its own plane; empty in float32
    facing  uint8 [triangles]: :func:`light_kernel`; empty in float32
    """

    edges: wp.array[wp.vec4f]
    sides: wp.array[wp.vec4f]
    facing: wp.array[wp.uint8]


@wp.struct
class Seen:
    """A triangle seen from an origin o: its edge planes and normal from float64, as float32; sizes; the side that it
    faces.

    size: the largest distance of a corner times the longest edge; inward: +-1, 0: edge-on, or too large or small
    """

    a: wp.vec3d
    b: wp.vec3d
    c: wp.vec3d
    x: wp.vec3d
    y: wp.vec3d
    z: wp.vec3d
    normal: wp.vec3d
    height: wp.float64
    size: wp.float32
    inward: wp.float32


@wp.func
def nearer(place: wp.vec3f, size: wp.float32) -> wp.vec3f:
    """The light's place, or a point between it and the origin, at most :data:`FAR` times ``size`` away in each coordinate.

    Seen from a corner, the two are less than 3^0.5 2^-32 apart as an angle, so that over the 2 * 3^0.5 M to a hit point the
    plane moves by less than 0.1 u M.
    """
    return brought_nearer(place, FAR * size)


@wp.func_native(BASICS + "return about(a);")
def about(a: wp.float32) -> wp.float32:
    """1 / a with the precision of a GPU's single instruction, which suffices for a scale."""


@wp.func
def seen_from(o32: wp.vec3f, corners: Corners) -> Seen:
    s = Seen()
    o = to_float64(o32)
    s.a = to_float64(corners.a)
    s.b = to_float64(corners.b)
    s.c = to_float64(corners.c)
    ab = s.b - s.a
    bc = s.c - s.b
    ca = s.a - s.c
    s.normal = wp.cross(ca, ab)
    s.height = wp.dot(s.normal, s.a - o)
    s.x = wp.cross(s.b - o, bc)
    s.y = wp.cross(s.c - o, ca)
    s.z = wp.cross(s.a - o, ab)
    # Sizes choose scales and thresholds, for which float32 is precise enough.
    distance = farthest_corner(o32, corners)
    edge = longest_edge(corners)
    s.size = distance * edge
    s.inward = 0.0
    height = wp.float32(s.height)
    if s.size * edge > SMALLEST and s.size * distance < LARGEST and edge * edge > SMALLEST:
        if height > FLAT * (s.size * edge):
            s.inward = 1.0
        if height < -FLAT * (s.size * edge):
            s.inward = -1.0
    return s


@wp.func
def unknown() -> wp.vec3f:
    """m of a triangle whose depth is left to float64: its bounds are infinite or not numbers, so that no hit hides it."""
    return wp.vec3f(wp.INF, wp.INF, wp.INF)


@wp.func
def scale_of(n: wp.vec3f, s: Seen, spread: wp.float32) -> wp.float32:
    """The scale of an edge plane; ``spread``: the largest sum that its slack is a share of."""
    return s.inward * about(wp.max(largest(n), wp.max(CLOSED * spread, ROUNDED * s.size)))


@wp.func
def clear_record(records: wp.array[wp.vec4f], at: wp.int32):
    """Of a triangle that is never hit, which a tree that was made of another frame may still hold: zeros leave its rays to
    float64, which rejects it.
    """
    for k in range(3):
        set_entry(records, 3 * at + k, wp.vec4f())


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=RECORD_REGISTERS)
def eye_kernel(mesh: Mesh, eye: wp.array[wp.vec3f], records: wp.array[wp.vec4f], cleared: wp.array[wp.int32]):
    """Three words per triangle: the edge planes and m, one after the other. ``cleared``: counters of the eye's rays."""
    at = wp.tid()
    if at == 0:
        for k in range(cleared.shape[0]):
            cleared[k] = 0
    if entry(mesh.valid, at) == wp.uint8(0):
        clear_record(records, at)
        return
    s = seen_from(entry(eye, 0), corners_at(mesh, at))
    x = wp.vec3f()
    y = wp.vec3f()
    z = wp.vec3f()
    m = unknown()
    if s.inward != 0.0:
        n = to_float32(s.normal)
        spread = total(n)
        x = to_float32(s.x)
        x = x * scale_of(x, s, spread)
        y = to_float32(s.y)
        y = y * scale_of(y, s, spread)
        z = to_float32(s.z)
        z = z * scale_of(z, s, spread)
        m = n * (1.0 / wp.float32(s.height))
        if not (largest(m) < DEEPEST and largest(m) * DEEPEST > 1.0):
            m = unknown()
    set_entry(records, 3 * at, wp.vec4f(x[0], x[1], x[2], y[0]))
    set_entry(records, 3 * at + 1, wp.vec4f(y[1], y[2], z[0], z[1]))
    set_entry(records, 3 * at + 2, wp.vec4f(z[2], m[0], m[1], m[2]))


@wp.func
def plane_word(n: wp.vec3d, p: wp.vec3d, n32: wp.vec3f, scale: wp.float32, extent: wp.float32) -> wp.vec4f:
    """(n, c) of the plane n . x + c through p, scaled; ``n32`` is n rounded. Zeros where float32 does not hold c, or holds
    n or c with an error that shows in proportion to ``extent``.
    """
    c = wp.float32(-wp.dot(n, p))
    if not (wp.abs(scale) <= STRETCHED * wp.min(extent, 1.0) and wp.abs(c) < FARTHEST):
        return wp.vec4f()
    return wp.vec4f(n32[0] * scale, n32[1] * scale, n32[2] * scale, c * scale)


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=RECORD_REGISTERS)
def light_kernel(
    mesh: Mesh,
    light: wp.int32,
    lights: wp.array[wp.vec3f],
    extent: wp.array[wp.float32],
    joined: wp.array[wp.uint8],
    edges: wp.array[wp.vec4f],
    sides: wp.array[wp.vec4f],
    facing: wp.array[wp.uint8],
):
    """The arrays of :class:`LightPlanes`.

    facing: of a triangle that is ``joined`` to its neighbour, 1 or 2 for the side that the light certainly sees; else 0
    """
    at = wp.tid()
    joins = entry(joined, at >> 1)
    if entry(mesh.valid, at) == wp.uint8(0):
        clear_record(edges, at)
        set_entry(facing, at, wp.uint8(0))
        return
    size = entry(extent, 0)
    place = nearer(entry(lights, light), size)
    s = seen_from(place, corners_at(mesh, at))
    none = wp.vec4f()
    first = none
    second = none
    third = none
    own = none
    if s.inward != 0.0:
        n = to_float32(s.normal)
        spread = total(n) * (1.0 + largest(place) * about(size))
        x = to_float32(s.x)
        first = plane_word(s.x, s.b, x, scale_of(x, s, spread), size)
        y = to_float32(s.y)
        second = plane_word(s.y, s.c, y, scale_of(y, s, spread), size)
        z = to_float32(s.z)
        third = plane_word(s.z, s.a, z, scale_of(z, s, spread), size)
        # The light is where n . (light - a) = -height.
        own = plane_word(s.normal, s.a, n, -s.inward * about(largest(n)), size)
    face = wp.int32(0)
    if s.inward > 0.0:
        face = 1
    if s.inward < 0.0:
        face = 2
    set_entry(facing, at, wp.uint8(wp.where(joins != wp.uint8(0), face, 0)))
    set_entry(edges, 3 * at, first)
    set_entry(edges, 3 * at + 1, second)
    set_entry(edges, 3 * at + 2, third)
    set_entry(sides, at, own)


@wp.kernel(enable_backward=False, grid_stride=False)
def float32_kernel(mesh: Mesh, index: wp.int32, origins: wp.array[wp.vec3f], records: wp.array[wp.vec4f]):
    """Three words per triangle for float32 tests from ``origins[index]``: Moeller & Trumbore 1997 with the fixed origin's
    terms precomputed.

    With s = o - a, e = b - a, f = c - a: (f x e, f . (s x e)), (f x s, 0), (s x e, 0), so that for a direction d the
    determinant, u, v and t are three products with d and one number.
    """
    at = wp.tid()
    if entry(mesh.valid, at) == wp.uint8(0):
        return
    corners = corners_at(mesh, at)
    a = corners.a
    e = corners.b - a
    f = corners.c - a
    s = entry(origins, index) - a
    n = wp.cross(f, e)
    p = wp.cross(f, s)
    q = wp.cross(s, e)
    set_entry(records, 3 * at, wp.vec4f(n[0], n[1], n[2], wp.dot(f, q)))
    set_entry(records, 3 * at + 1, wp.vec4f(p[0], p[1], p[2], 0.0))
    set_entry(records, 3 * at + 2, wp.vec4f(q[0], q[1], q[2], 0.0))
