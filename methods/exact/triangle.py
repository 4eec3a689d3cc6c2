"""The triangle tests that all exact methods share: float32 rejects, float64 decides.

A float32 test only rejects: it compares its edge functions with a bound on their rounding.
What it cannot reject is decided in float64, with each edge taken in weld order, so that the two triangles at
an edge compute the same number with opposite sign and no ray can pass between them. An answer therefore never
depends on which structure offered the triangle, in which order, or how often.

Conventions (for all methods): triangles are closed and two-sided; a coplanar ray is no hit; (u, v) are the
weights of vertices 1 and 2; the shadow segment is open at the hit point and at the light.

Bounds: u32 = 2^-24 and u64 = 2^-53 are the unit roundoffs. For e = d . ((p - o) x (q - p)) with exact inputs,
every difference carries one rounding, every product one, and at most three additions follow, so that
|error| <= 8 u * sum_i |d_i| (|P_j Q_k| + |P_k Q_j|) <= 16 u |d|_1 |P|_max |Q|_max. Fused multiply-adds only round
less. FLOOR covers underflow. Where a product of lengths comes near float32's largest number (OVERFLOW), nothing counts as
certain, because an infinity could have the wrong sign.
"""

import warp as wp

from ...harness.frame.digits import products_of_normal, sum_of_sizes, wide_slope
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Corners, Hits, Mesh, Ray, corners_of, weld_of
from ...harness.frame.vectors import largest as largest
from ...harness.frame.vectors import to_float32 as to_float32
from ...harness.frame.vectors import to_float64 as to_float64
from ...harness.frame.vectors import total as total
from .hit_point import U64 as U64
from .hit_point import hit_point, plane_distance

U32 = wp.constant(5.9604645e-08)  # 2^-24
FLOOR32 = wp.constant(1.0e-35)
OVERFLOW = wp.constant(1.0e37)
UNDERFLOW = wp.constant(1.0e-37)
"""Added to the product of two lengths of which an error of a normal is a share: where products are subnormal its components
lose up to 2^-149, a quarter of u32 of this.
"""

NO_HIT = wp.constant(wp.float64(-1.0))

CLEARLY_BEFORE = wp.constant(wp.float64(1.0 - 2.0**-27))
CLEARLY_BEHIND = wp.constant(wp.float64(1.0 + 2.0**-27))
"""Ratios of two distances beyond which their keys differ (:func:`nearer_of`)."""

NOT_ZERO = wp.constant(wp.float64(1.0e-300))
"""Added to the sum of the edge functions of a triangle that is hit. The sum is 0 only if each of them is. Otherwise it is at
least 2^-447, of which every product of three float32 numbers is a multiple, and this does not change it.
"""

CLOSED = wp.constant(wp.float64(2.0**-30))
"""Share of the sum of its edge functions that a ray or segment may pass outside a triangle and still meet it, at most.

The triangle is closed, so doubt counts as inside: six edges that meet at a vertex could otherwise all round to the side
that lets a ray exactly through the vertex pass. The doubt is the bound on rounding. As a share of the sum that is 16 u64
times distance over height of the triangle: no more than this for triangles seen from up to half a million times their
height. (Of a shadow segment, the distance is the hit point's, not the light's.) From farther away such a ray may pass: of
200,000 fans of six triangles with a ray aimed exactly at their centre, none let it pass at 1e7 edge lengths and 78 at
1e8, where a step of a float32 direction is six edges long. It stays a share of the sum there, so that a ray almost in the
plane does not hit far from the triangle.
"""


NORMAL_UNITS = wp.constant(wp.float64(9.0 * 2.0**-53))
"""Bound on the error of (e x f) . w, where e, f and w are differences of two float32 numbers: times the sum over the
components of (|e_j f_k| + |e_k f_j|) |w_i|. Differences and products cost 3 u64 each, the difference of two products one
more, its product with w_i two, and the sum of three two: 8 u64. The ninth covers the rounding of the bound itself. Sizes of
components, not of vectors: a triangle 1e8 long and 1 wide has products of 1e8, not of 1e16.
"""


@wp.func
def certainly_outside(e0: wp.float32, e1: wp.float32, e2: wp.float32, bound: wp.float32) -> wp.bool:
    """Whether two of three edge functions, each known to ``bound``, certainly have opposite signs."""
    low = wp.min(e0, wp.min(e1, e2))
    high = wp.max(e0, wp.max(e1, e2))
    return low < -bound and high > bound


@wp.func
def may_hit(ray: Ray, corners: Corners) -> wp.bool:
    """False only if the ray's line certainly misses the triangle. Float32; t is not tested."""
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
def edge_function(o: wp.vec3d, d: wp.vec3d, p: wp.vec3d, q: wp.vec3d, weld_p: wp.int32, weld_q: wp.int32) -> wp.float64:
    """d . ((p - o) x (q - p)) in float64, taken from the vertex with the lower weld index."""
    # Ends are selected instead of branching, since a warp would compute both branches.
    ordered = weld_p < weld_q
    first = wp.where(ordered, p, q)
    value = wp.dot(wp.cross(first - o, wp.where(ordered, q, p) - first), d)
    return wp.where(ordered, value, -value)


@wp.func
def wide_edge(o: wp.vec3d, d: wp.vec3d, p: wp.vec3d, q: wp.vec3d) -> wp.float64:
    """:func:`edge_function` of float32 numbers to 2^-51 of itself."""
    return wide_slope(to_float32(o), to_float32(p), to_float32(q), d)


@wp.func
def edge_functions(o: wp.vec3d, d: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, weld: wp.vec3i) -> wp.vec3d:
    """The edge functions opposite to a, b and c."""
    if wp.static(effects.wide):
        return wp.vec3d(wide_edge(o, d, b, c), wide_edge(o, d, c, a), wide_edge(o, d, a, b))
    return wp.vec3d(
        edge_function(o, d, b, c, weld[1], weld[2]),
        edge_function(o, d, c, a, weld[2], weld[0]),
        edge_function(o, d, a, b, weld[0], weld[1]),
    )


@wp.func
def edge_doubt(o: wp.vec3d, d: wp.vec3d, p: wp.vec3d, q: wp.vec3d, weld_p: wp.int32, weld_q: wp.int32) -> wp.float64:
    """Bound on the error of :func:`edge_function`."""
    first = wp.where(weld_p < weld_q, p, q)
    return NORMAL_UNITS * sum_of_sizes(products_of_normal(first - o, q - p), d)


@wp.func
def wide_distance(ray: Ray, corners: Corners, e: wp.vec3d) -> wp.float64:
    """:func:`hit_distance` where all signs are known: those of the edge functions e, of 0 on an edge, and of t."""
    if wp.min(e[0], wp.min(e[1], e[2])) < wp.float64(0.0) and wp.max(e[0], wp.max(e[1], e[2])) > wp.float64(0.0):
        return NO_HIT
    t = plane_distance(ray, corners)
    return wp.where(t > wp.float64(0.0) and t < wp.float64(wp.INF), t, NO_HIT)


@wp.func
def hit_distance(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.float64:
    """t > 0 of the hit in lengths of the direction, or NO_HIT. Float64 on exact float32 inputs.

    A triangle whose plane contains the origin within rounding is not hit, nor is one whose plane contains the direction.
    """
    o64 = to_float64(ray.origin)
    d64 = to_float64(ray.direction)
    a64 = to_float64(corners.a)
    b64 = to_float64(corners.b)
    c64 = to_float64(corners.c)
    e = edge_functions(o64, d64, a64, b64, c64, weld)
    if wp.static(effects.wide):
        return wide_distance(ray, corners, e)
    sum = e[0] + e[1] + e[2]
    if sum < wp.float64(0.0):
        e = -e  # inside is positive
    low = wp.min(e[0], wp.min(e[1], e[2]))
    if low < wp.float64(0.0):
        if low < -CLOSED * wp.abs(sum):
            return NO_HIT
        # Only the edge that the ray passes farthest outside: bounds of all three would take many registers.
        p = b64
        q = c64
        weld_p = weld[1]
        weld_q = weld[2]
        if e[1] == low:
            p = c64
            q = a64
            weld_p = weld[2]
            weld_q = weld[0]
        if e[2] == low:
            p = a64
            q = b64
            weld_p = weld[0]
            weld_q = weld[1]
        if low < -edge_doubt(o64, d64, p, q, weld_p, weld_q):
            return NO_HIT
    e1 = b64 - a64
    e2 = c64 - a64
    n = wp.cross(e1, e2)
    away = a64 - o64
    det = wp.dot(n, d64)
    height = wp.dot(n, away)
    products = products_of_normal(e1, e2)
    if wp.abs(det) <= NORMAL_UNITS * sum_of_sizes(products, d64):
        return NO_HIT
    if wp.abs(height) <= NORMAL_UNITS * sum_of_sizes(products, away):
        return NO_HIT
    t = height / det
    return wp.where(t > wp.float64(0.0), t, NO_HIT)


@wp.func_native("""
unsigned int last = (unsigned int)(triangles - 1) | 0x8000u;
#if defined(__CUDA_ARCH__)
int spare = __clz(last) - 8;
#else
int spare = __builtin_clz(last) - 8;
#endif
return spare < 0 ? 0 : spare;
""")
def spare_bits(triangles: wp.int32) -> wp.int32:
    """The number of bits of a 24-bit index that no triangle of the mesh needs, eight at most. They extend the keys of
    hits.
    """


@wp.func
def nearness_key(inverse: wp.float64, spare: wp.int32) -> wp.uint64:
    """The leading bits of 1 / t > 0, eleven of exponent and 29 + ``spare`` (:func:`spare_bits`) of fraction; larger is
    nearer.

    1 / t is linear in the direction for rays that share an origin, so a method that streams pixels over a triangle
    gets it without a division.
    """
    return wp.cast(inverse, wp.uint64) >> wp.uint64(23 - spare)


@wp.func
def depth_key(t: wp.float64, spare: wp.int32) -> wp.uint64:
    """The complement of the nearness key of 1 / t: 40 + ``spare`` bits in the order of t > 0.

    Two hits whose keys agree (2^-29 of each other, 2^-37 in meshes of up to 65,536 triangles) are a tie, which the lowest
    index wins. So rounding never decides between the triangles that meet at an edge, and a hit packs into 64 bits beside
    its index.
    """
    return (wp.uint64(0xFFFFFFFFFFFF) >> wp.uint64(8 - spare)) - nearness_key(wp.float64(1.0) / t, spare)


@wp.func
def nearer(mesh: Mesh, t: wp.float64, i: wp.int32, best_t: wp.float64, best: wp.int32) -> wp.bool:
    """Whether hit (t, i) comes before (best_t, best): smaller key, then lower index; best = -1 is no hit yet."""
    return nearer_of(mesh.triangles.shape[0], t, i, best_t, best)


@wp.func
def nearer_of(triangles: wp.int32, t: wp.float64, i: wp.int32, best_t: wp.float64, best: wp.int32) -> wp.bool:
    """:func:`nearer` in a mesh of so many triangles.

    Keys have at least 29 bits of fraction, so that distances that differ by more than 2^-27 of themselves have different
    keys, in their order. Only closer ones are compared by their keys, which take two divisions.
    """
    if best < 0 or t < best_t * CLEARLY_BEFORE:
        return True
    if t > best_t * CLEARLY_BEHIND:
        return False
    spare = spare_bits(triangles)
    key = depth_key(t, spare)
    best_key = depth_key(best_t, spare)
    return key < best_key or (key == best_key and i < best)


@wp.func
def hit_weights(ray: Ray, corners: Corners, weld: wp.vec3i) -> wp.vec2f:
    """(u, v): the weights of vertices 1 and 2 at the hit; 0 where float64 cannot tell the triangle from a point."""
    o = to_float64(ray.origin)
    d = to_float64(ray.direction)
    a = to_float64(corners.a)
    b = to_float64(corners.b)
    c = to_float64(corners.c)
    e = edge_functions(o, d, a, b, c, weld)
    sum = e[0] + e[1] + e[2] + NOT_ZERO
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
    hits: Hits, hit_points: wp.array[wp.vec3d], pixel: wp.int32, ray: Ray, best: wp.int32, t: wp.float64, mesh: Mesh
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
