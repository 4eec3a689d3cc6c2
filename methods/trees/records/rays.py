"""Records of triangles for rays that share no origin, as mirrored rays: a corner, two edges and the normal, 48 bytes.

With P = a - o, k = P x d and the edges e1 = b - a, e2 = c - a, a ray o + t d meets the triangle's plane at
t = n . P / n . d with n = e1 x e2, and e2 . k, -e1 . k and n . d minus both are its weights of b, c and a times n . d
(Moeller and Trumbore 1997). For the exact walk edges and normal are multiplied by a power of two, so that the largest
part of an edge, E, is in [1/2, 1): the bounds then need no size of the triangle. With u = 2^-24, N the largest part of
n, S of P and D = |d|_1, the numbers of :data:`..trace.triangle_tests.RAY` are known to

* e2 . k and e1 . k: 14 u S D. Seven roundings (edge, P, a product, their difference, a product, two sums) of terms whose
  sum is at most 2 S D.
* n . d: 4 u N D (n, a product, two sums).
* the third weight, n . d minus the other two: 34 u S D + 6 u N D, what its parts are off by and two differences.
  Two fifths of it are known to 14 u S D + 3 u N D.
* n . P: 5 u sum_i |n_i| |P_i| (n, P, a product, two sums). Component by component: of a ray that has just left its mirror
  n . P is small because its terms are.

So weights beyond :data:`WEIGHT_UNITS` = 16 units of (S + N) D have a certain sign, n . d beyond 6 units of N D, n . P beyond
6 units of the sum. What is left of these bounds is more than float64's own verdict may differ by
(:func:`..exact.triangle.hit_distance`): in this scale its edge functions with their slack by less than 2^-46 D (S + E), its
n . d by 2^-47 E D, its n . P with its threshold by 2^-46 E S. N is at least :data:`SLIVER` = 2^-16 E. For n . P
:data:`DEPTH_SLACK` = 2^-28 of N S is added where a hit is accepted or its t bounded. To reject a triangle behind the origin,
the sign of the exact n . P suffices: float64's threshold is more than float64's error.

A weight that is certainly outside is a miss, whether n . d is certain or not. The weights add up to n . d, whose sign is
taken from what was computed: if one is below -16 u (S + N) D, the sum of the other two is above 10 u N D + u S D, so that
one of them certainly has the other sign.

Each component of n is right to 2^-26 of itself before it is rounded: Kahan's difference of products (Jeannerod, Louvet and
Muller 2013) loses nothing where the edges are exact in float64, and where they are not, the component is far from
cancelling or zero (:func:`is_sure`). A triangle of which that is not known, a sliver, and one whose sizes are beyond
:data:`SMALLEST` and :data:`LARGEST` leave every ray to float64: its record is not a number.
"""

import warp as wp

from ....harness.frame.digits import fused, lost_in_sum, rounded
from ....harness.frame.geometry import Mesh
from ...common.reads import corners_at
from ...exact.triangle import largest, to_float32, to_float64
from ...gpu.entries import entry, set_entry
from ..constants import RECORD_REGISTERS
from .planes import clear_record

WEIGHT_UNITS = 16.0
PLANE_UNITS = 6.0
DEPTH_SLACK = 2.0**-28

SLIVER = wp.constant(2.0**-16)
SMALLEST = wp.constant(1.0e-25)
LARGEST = wp.constant(1.0e25)
SUBNORMAL = wp.constant(1.2e-38)
CANCELLED = wp.constant(wp.float64(2.0**-26))


@wp.func
def difference_of_products(a: wp.float64, b: wp.float64, c: wp.float64, d: wp.float64) -> wp.float64:
    """a b - c d, right to 1.5 units in its last place."""
    product = rounded(c, d)
    lost = fused(-c, d, product)
    return fused(a, b, -product) + lost


@wp.func
def precise_normal(e: wp.vec3d, f: wp.vec3d) -> wp.vec3d:
    """e x f, each component right to 1.5 units in its own last place."""
    return wp.vec3d(
        difference_of_products(e[1], f[2], e[2], f[1]),
        difference_of_products(e[2], f[0], e[0], f[2]),
        difference_of_products(e[0], f[1], e[1], f[0]),
    )


@wp.func
def is_sure(
    n: wp.float64, near: wp.float32, ej: wp.float64, fk: wp.float64, ek: wp.float64, fj: wp.float64, exact: wp.bool
) -> wp.bool:
    """Whether a component n = ej fk - ek fj of the normal, and ``near``, it scaled and rounded, are known relative to
    themselves. ``exact``: whether the edges are, or n is known to be 0; else they are right to 2^-53.
    """
    if not exact and wp.abs(n) < CANCELLED * (wp.abs(ej * fk) + wp.abs(ek * fj)):
        return False
    return n == wp.float64(0.0) or wp.abs(near) > SUBNORMAL


@wp.func
def is_known(
    n: wp.vec3d, near: wp.vec3f, e: wp.vec3d, f: wp.vec3d, b: wp.vec3d, c: wp.vec3d, exact: wp.bool
) -> wp.bool:
    """:func:`is_sure` of all components. One is 0 if b and c differ along its own axis only."""
    x = b[0] == c[0]
    y = b[1] == c[1]
    z = b[2] == c[2]
    return (
        is_sure(n[0], near[0], e[1], f[2], e[2], f[1], exact or (y and z))
        and is_sure(n[1], near[1], e[2], f[0], e[0], f[2], exact or (z and x))
        and is_sure(n[2], near[2], e[0], f[1], e[1], f[0], exact or (x and y))
    )


@wp.func
def downscale(size: wp.float32) -> wp.float32:
    """The power of two that takes a normal number to [1/2, 1)."""
    exponent = wp.cast(size, wp.uint32) >> wp.uint32(23)
    return wp.cast((wp.uint32(253) - exponent) << wp.uint32(23), wp.float32)


@wp.func
def set_record(records: wp.array[wp.vec4f], at: wp.int32, a: wp.vec3f, e: wp.vec3f, f: wp.vec3f, n: wp.vec3f):
    set_entry(records, 3 * at, wp.vec4f(a[0], a[1], a[2], e[0]))
    set_entry(records, 3 * at + 1, wp.vec4f(e[1], e[2], f[0], f[1]))
    set_entry(records, 3 * at + 2, wp.vec4f(f[2], n[0], n[1], n[2]))


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=RECORD_REGISTERS)
def ray_kernel(mesh: Mesh, records: wp.array[wp.vec4f]):
    """Three words per triangle: a, and the edges and the normal in the triangle's own scale."""
    at = wp.tid()
    if entry(mesh.valid, at) == wp.uint8(0):
        clear_record(records, at)
        return
    corners = corners_at(mesh, at)
    a = to_float64(corners.a)
    b = to_float64(corners.b)
    c = to_float64(corners.c)
    e = b - a
    f = c - a
    exact = largest(lost_in_sum(b, -a, e)) + largest(lost_in_sum(c, -a, f)) == wp.float64(0.0)
    edge = wp.float32(wp.max(largest(e), largest(f)))
    unknown = wp.vec3f(wp.NAN, wp.NAN, wp.NAN)
    e32 = unknown
    f32 = unknown
    n32 = unknown
    if edge > SMALLEST and edge < LARGEST:
        scale = downscale(edge)
        n = precise_normal(e, f)
        near = to_float32(n * wp.float64(scale))
        thick = largest(near)
        if thick > SLIVER * edge and thick > SMALLEST and is_known(n, near, e, f, b, c, exact):
            e32 = to_float32(e) * scale
            f32 = to_float32(f) * scale
            n32 = near
    set_record(records, at, corners.a, e32, f32, n32)


@wp.kernel(enable_backward=False, grid_stride=False)
def float32_ray_kernel(mesh: Mesh, records: wp.array[wp.vec4f]):
    """Three words per triangle for tests in float32: a, the edges and the normal."""
    at = wp.tid()
    if entry(mesh.valid, at) == wp.uint8(0):
        return
    corners = corners_at(mesh, at)
    e = corners.b - corners.a
    f = corners.c - corners.a
    set_record(records, at, corners.a, e, f, wp.cross(e, f))
