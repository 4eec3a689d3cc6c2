"""The referee's float64 filter: which triangles a ray certainly misses or meets.

Every test has an error bound. With u = 2^-53 a difference of float32 values carries u, a product of two of them 3u, a
cross product 4u of its sum of absolute values, and a triple product 7u of its *permanent* (the same expression in
absolute values); 16u is used, which also covers the rounding of the permanent itself. Fused multiply-adds round less.
Values lie between 2^-447 and 2^387: no float64 overflow or underflow.
"""

import warp as wp

from ..frame.alpha import Alpha, texels_near

ROUNDING = wp.constant(wp.float64(16.0 * 2.0**-53))
WIDEN = wp.constant(wp.float64(2.0**-48))
FAR = wp.constant(wp.float64(1.0e300))


@wp.func
def widen(v: wp.vec3f) -> wp.vec3d:
    return wp.vec3d(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]))


@wp.func
def permanent(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.float64:
    return a[0] * (b[1] * c[2] + b[2] * c[1]) + a[1] * (b[2] * c[0] + b[0] * c[2]) + a[2] * (b[0] * c[1] + b[1] * c[0])


@wp.func
def triple(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, ea: wp.float64, eb: wp.float64, ec: wp.float64) -> wp.vec2d:
    """a . (b x c) and a bound on its error, where the components of a, b, c have errors of up to ea, eb, ec."""
    value = a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    pa = wp.vec3d(wp.abs(a[0]), wp.abs(a[1]), wp.abs(a[2]))
    pb = wp.vec3d(wp.abs(b[0]), wp.abs(b[1]), wp.abs(b[2]))
    pc = wp.vec3d(wp.abs(c[0]), wp.abs(c[1]), wp.abs(c[2]))
    plain = permanent(pa, pb, pc)
    full = permanent(pa + wp.vec3d(ea, ea, ea), pb + wp.vec3d(eb, eb, eb), pc + wp.vec3d(ec, ec, ec))
    return wp.vec2d(value, ROUNDING * full + (full - plain))


@wp.func
def sign_of(x: wp.vec2d) -> wp.int32:
    """1 or -1 where the sign is certain, else 0."""
    if x[0] > x[1]:
        return 1
    if x[0] < -x[1]:
        return -1
    return 0


@wp.func
def outside(d: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, ed: wp.float64, e: wp.float64) -> wp.int32:
    """Line from the origin along d against a triangle: 1 certainly misses, 0 certainly hits, 2 uncertain."""
    su = sign_of(triple(d, c, b, ed, e, e))
    sv = sign_of(triple(d, a, c, ed, e, e))
    sw = sign_of(triple(d, b, a, ed, e, e))
    if (su > 0 or sv > 0 or sw > 0) and (su < 0 or sv < 0 or sw < 0):
        return 1
    if su == 0 or sv == 0 or sw == 0:
        return 2
    return 0


@wp.func
def filter_ray(o: wp.vec3d, d: wp.vec3d, va: wp.vec3d, vb: wp.vec3d, vc: wp.vec3d) -> wp.vec3d:
    """A ray against a triangle: (status, t low, t high); status 0 miss, 1 certain hit, 2 uncertain."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    miss = wp.vec3d(zero, zero, zero)
    a = va - o
    side = outside(d, a, vb - o, vc - o, zero, zero)
    if side == 1:
        return miss
    over = triple(a, vb - va, vc - va, zero, zero, zero)
    under = triple(d, vb - va, vc - va, zero, zero, zero)
    if sign_of(under) == 0:
        return wp.vec3d(wp.float64(2.0), zero, FAR)
    if sign_of(over) == -sign_of(under):
        return miss
    low = (wp.abs(over[0]) - over[1]) / (wp.abs(under[0]) + under[1]) * (one - WIDEN)
    high = (wp.abs(over[0]) + over[1]) / (wp.abs(under[0]) - under[1]) * (one + WIDEN)
    if side == 0 and sign_of(over) != 0:
        return wp.vec3d(one, low, high)
    return wp.vec3d(wp.float64(2.0), wp.max(low, zero), high)


@wp.func
def filter_segment(p: wp.vec3d, light: wp.vec3d, va: wp.vec3d, vb: wp.vec3d, vc: wp.vec3d, e: wp.float64) -> wp.int32:
    """An open segment whose start has an error of up to e per component: 0 misses, 1 certainly meets, 2 uncertain."""
    zero = wp.float64(0.0)
    near = sign_of(triple(va - p, vb - va, vc - va, e, zero, zero))
    far = sign_of(triple(light - va, vb - va, vc - va, zero, zero, zero))
    if near * far < 0:
        return 0
    side = outside(light - p, va - p, vb - p, vc - p, e, e)
    if side == 1:
        return 0
    if side == 0 and near * far > 0:
        return 1
    return 2


@wp.func
def opacity(
    alpha: Alpha, i: wp.int32, d: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, ed: wp.float64, e: wp.float64
) -> wp.int32:
    """Of triangle i where the line along d certainly crosses it: 1 opaque, 0 transparent, 2 uncertain."""
    if alpha.masked.shape[0] == 0:
        return 1
    if alpha.masked[i] == wp.uint8(0):
        return 1
    u = triple(d, c, b, ed, e, e)
    v = triple(d, a, c, ed, e, e)
    w = triple(d, b, a, ed, e, e)
    sum = u[0] + v[0] + w[0]
    error = u[1] + v[1] + w[1]
    if not (wp.abs(sum) > wp.float64(2.0) * error):
        return 2
    # The error of a weight of at most 1 is its own and that of the sum, over the smallest possible sum.
    doubt = wp.float64(2.0) * error / (wp.abs(sum) - error) + WIDEN
    found = texels_near(alpha, i, v[0] / sum, w[0] / sum, doubt)
    if found == 3:
        return 2
    return found & 1


@wp.func
def beside(d: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, e: wp.float64, wide: wp.float64) -> wp.bool:
    """Whether the line from the origin along d certainly passes a triangle at more than ``wide``: beyond an edge of it, as
    seen along d, where a triple product over the edge's length is the distance from the edge."""
    u = triple(d, c, b, e, e, e)
    v = triple(d, a, c, e, e, e)
    w = triple(d, b, a, e, e, e)
    turned = u[0] + v[0] + w[0]
    if wp.abs(turned) <= u[1] + v[1] + w[1]:
        return False
    side = wp.sign(turned)
    if beyond(-side * u[0] - u[1], d, c - b, e, wide):
        return True
    return beyond(-side * v[0] - v[1], d, a - c, e, wide) or beyond(-side * w[0] - w[1], d, b - a, e, wide)


@wp.func
def beyond(volume: wp.float64, d: wp.vec3d, edge: wp.vec3d, e: wp.float64, wide: wp.float64) -> wp.bool:
    """Whether a triple product is certainly more than ``wide`` times d times the length of an edge as seen along d."""
    doubt = (WIDEN * wp.length(d) + wp.float64(2.0) * e) * wp.length(edge)
    return volume > wide * (wp.length(wp.cross(d, edge)) + doubt) * (wp.float64(1.0) + WIDEN)
