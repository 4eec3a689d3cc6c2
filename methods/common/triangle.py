"""The triangle tests that every method of ours shares: float32 rejects, float64 decides, and what it cannot is exact.

A float32 test only rejects: it compares its edge functions with a bound on their rounding. What it cannot reject is
computed in float64 and compared with the bound of float64. Beyond that bound nothing is in doubt; the few pairs within
it are decided exactly (:mod:`.exactly`). So hits are those of exact arithmetic on the float32 inputs, and an answer never
depends on which structure offered the triangle, in which order, or how often.

Conventions (fixed for everyone): triangles are closed and two-sided; a coplanar ray is no hit; (u, v) are the
weights of vertices 1 and 2; the shadow segment is open at the hit point and at the light.

Bounds: u32 = 2^-24 and u64 = 2^-53 are the unit roundoffs. For e = d . ((p - o) x (q - p)) with exact inputs,
every difference carries one rounding, every product one, and at most three additions follow, so that
|error| <= 8 u * sum_i |d_i| (|P_j Q_k| + |P_k Q_j|) <= 16 u |d|_1 |P|_max |Q|_max. Fused multiply-adds only round
less. FLOOR covers underflow. Where a product of lengths nears float32's largest number (OVERFLOW) nothing is certain:
an infinity of the wrong sign would be.
"""

from __future__ import annotations

import warp as wp

from ...harness.frame.geometry import Corners, Hits, Mesh, Ray, corners_of, weld_of
from ...harness.frame.vectors import largest as largest
from ...harness.frame.vectors import to_float32 as to_float32
from ...harness.frame.vectors import to_float64 as to_float64
from ...harness.frame.vectors import total as total
from .exactly import exact_distance, exact_hit
from .hitpoint import IN_DOUBT, hit_point, sure_distance
from .hitpoint import NO_HIT as NO_HIT
from .hitpoint import U64 as U64

U32 = wp.constant(5.9604645e-08)  # 2^-24
FLOOR32 = wp.constant(1.0e-35)
OVERFLOW = wp.constant(1.0e37)

EDGE_UNITS = wp.constant(wp.float64(17.0))
"""Units of U64 |d|_1 |P|_max |Q|_max by which a float64 edge function may be wrong; sizes are taken in float32."""

CLOSE = wp.constant(wp.float64(2.0**-27))
"""Two t that differ by a larger share are in the right order."""

SAME = wp.constant(wp.float64(2.0**-90))
"""Two t in two numbers each that differ by no larger share are the same."""


@wp.func
def certainly_outside(e0: wp.float32, e1: wp.float32, e2: wp.float32, bound: wp.float32) -> wp.bool:
    """Whether two of three edge functions, each known to ``bound``, certainly have opposite signs."""
    low = wp.min(e0, wp.min(e1, e2))
    high = wp.max(e0, wp.max(e1, e2))
    return low < -bound and high > bound


@wp.func
def may_hit(ray: Ray, corners: Corners) -> wp.bool:
    """False only if the ray's line certainly misses the triangle. Float32; t is not looked at."""
    d = ray.direction
    pa = corners.a - ray.origin
    pb = corners.b - ray.origin
    pc = corners.c - ray.origin
    ab = corners.b - corners.a
    bc = corners.c - corners.b
    ca = corners.a - corners.c
    reach = wp.max(largest(pa), wp.max(largest(pb), largest(pc)))
    edge = wp.max(largest(ab), wp.max(largest(bc), largest(ca)))
    product = total(d) * reach * edge
    if not (product < OVERFLOW):
        return True
    bound = 16.0 * U32 * product + FLOOR32
    return not certainly_outside(
        wp.dot(wp.cross(pb, bc), d), wp.dot(wp.cross(pc, ca), d), wp.dot(wp.cross(pa, ab), d), bound
    )


@wp.func
def edge_function(
    o: wp.vec3d, d: wp.vec3d, p: wp.vec3d, q: wp.vec3d, weld_p: wp.int32, weld_q: wp.int32
) -> wp.float64:
    """d . ((p - o) x (q - p)) in float64, taken from the vertex with the lower weld index."""
    # Ends are selected instead of branching, since a warp would compute both branches.
    ordered = weld_p < weld_q
    first = wp.where(ordered, p, q)
    value = wp.dot(wp.cross(first - o, wp.where(ordered, q, p) - first), d)
    return wp.where(ordered, value, -value)


@wp.func
def edge_functions(
    o: wp.vec3d, d: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, weld: wp.vec3i
) -> wp.vec3d:
    """The edge functions opposite to a, b and c."""
    return wp.vec3d(
        edge_function(o, d, b, c, weld[1], weld[2]),
        edge_function(o, d, c, a, weld[2], weld[0]),
        edge_function(o, d, a, b, weld[0], weld[1]),
    )


@wp.func
def hit_distance(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.float64:
    """t > 0 of the hit in lengths of the direction, right to 2^-28 and mostly to 2^-50, or NO_HIT.

    Whether the triangle is hit is exact: closed triangles, t > 0, no hit by a coplanar ray. Float64 decides where edge
    functions, height and slope are beyond their rounding.
    """
    o64 = to_float64(ray.origin)
    d64 = to_float64(ray.direction)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    e = edge_functions(o64, d64, a64, b64, c64, weld)
    low = wp.min(e[0], wp.min(e[1], e[2]))
    high = wp.max(e[0], wp.max(e[1], e[2]))
    bound = EDGE_UNITS * U64 * test_size(ray, corners)
    if low < -bound and high > bound:
        return NO_HIT
    if low > bound or high < -bound:
        t = sure_distance(o64, d64, a64, b64, c64)
        if t != IN_DOUBT:
            return t
    return exact_hit(ray.origin, ray.direction, corners.a, corners.b, corners.c)[0]


@wp.func
def test_size(ray: Ray, corners: Corners) -> wp.float64:
    """What the rounding of edge functions is a share of: |d|_1 times the distance of a corner times an edge, the largest.

    Sizes in float32, as :func:`may_hit` has them, times each other in float64: neither overflows nor underflows.
    """
    a = corners.a
    b = corners.b
    c = corners.c
    o = ray.origin
    reach = wp.max(largest(a - o), wp.max(largest(b - o), largest(c - o)))
    edge = wp.max(largest(b - a), wp.max(largest(c - b), largest(a - c)))
    return wp.float64(total(ray.direction)) * wp.float64(reach) * wp.float64(edge)


@wp.func
def nearness_key(inverse: wp.float64) -> wp.uint64:
    """The leading 40 bits of 1 / t > 0 (eleven of exponent, 29 of fraction): larger is nearer.

    1 / t is linear in the direction for rays that share an origin, so a method that streams pixels over a triangle
    gets it without a division.
    """
    return wp.cast(inverse, wp.uint64) >> wp.uint64(23)


@wp.func
def depth_key(t: wp.float64) -> wp.uint64:
    """The complement of ``nearness_key(1 / t)``: 40 bits in the order of t > 0.

    Two hits whose keys agree (2^-29 of each other) are a tie, which the lowest index wins. So rounding never
    decides between the triangles that meet at an edge, and a hit packs into 64 bits beside its index.
    """
    return wp.uint64(0xFFFFFFFFFF) - nearness_key(wp.float64(1.0) / t)


@wp.func
def nearer(ray: Ray, mesh: Mesh, t: wp.float64, i: wp.int32, best_t: wp.float64, best: wp.int32) -> wp.bool:
    """Whether hit (t, i) comes before (best_t, best), exactly: smaller t, then lower index; best = -1 is no hit yet."""
    if best < 0:
        return True
    if wp.abs(t - best_t) > CLOSE * best_t:
        return t < best_t
    return nearer_exactly(ray, mesh, i, best)


@wp.func
def nearer_exactly(ray: Ray, mesh: Mesh, i: wp.int32, k: wp.int32) -> wp.bool:
    """:func:`nearer` for hits of triangles i and k whose t are close: t that agree to 2^-90 are the same."""
    one = corners_of(mesh, i)
    other = corners_of(mesh, k)
    t = exact_distance(ray.origin, ray.direction, one.a, one.b, one.c)
    s = exact_distance(ray.origin, ray.direction, other.a, other.b, other.c)
    behind = (t[0] - s[0]) + (t[1] - s[1])
    if wp.abs(behind) > SAME * s[0]:
        return behind < wp.float64(0.0)
    return i < k


@wp.func
def hit_weights(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec2f:
    """(u, v): the weights of vertices 1 and 2 at the hit."""
    o = to_float64(ray.origin)
    d = to_float64(ray.direction)
    a = to_float64(corners.a)
    b = to_float64(corners.b)
    c = to_float64(corners.c)
    e = edge_functions(o, d, a, b, c, weld)
    sum = e[0] + e[1] + e[2]
    return wp.vec2f(wp.float32(e[1] / sum), wp.float32(e[2] / sum))


@wp.func
def write_miss(hits: Hits, pixel: wp.int32):
    """A pixel without a hit. Its hit point is never read."""
    hits.triangle[pixel] = -1
    hits.t[pixel] = wp.INF
    hits.u[pixel] = 0.0
    hits.v[pixel] = 0.0


@wp.func
def write_hit(
    hits: Hits,
    hit_points: wp.array(dtype=wp.vec3d),
    pixel: wp.int32,
    ray: Ray,
    best: wp.int32,
    t: wp.float64,
    mesh: Mesh,
):
    """Write a pixel's closest hit and its float64 hit point; ``best`` = -1 is a miss (t = inf, u = v = 0)."""
    hits.triangle[pixel] = best
    if best < 0:
        hits.t[pixel] = wp.INF
        hits.u[pixel] = 0.0
        hits.v[pixel] = 0.0
        hit_points[pixel] = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
        return
    corners = corners_of(mesh, best)
    uv = hit_weights(ray, corners, weld_of(mesh, best))
    hits.t[pixel] = wp.float32(t)
    hits.u[pixel] = uv[0]
    hits.v[pixel] = uv[1]
    hit_points[pixel] = hit_point(ray, t, corners)
