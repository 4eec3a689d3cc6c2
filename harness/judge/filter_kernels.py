"""The referee's float64 filter: which triangles a ray certainly misses, and a tree that finds the rest.

Every test has an error bound. With u = 2^-53 a difference of float32 values carries u, a product of two of them 3u, a
cross product 4u of its sum of absolute values, and a triple product 7u of its *permanent* (the same expression in
absolute values); 16u is used, which also covers the rounding of the permanent itself. Fused multiply-adds round less.
Values lie between 2^-447 and 2^387: no float64 overflow or underflow. The tree is a heap: node i has children 2i and
2i + 1, leaf j holds ``LEAF`` triangles of a sorted order. Its boxes are exact; the slab test widens its interval by
2^-48, far more than its two roundings.
"""

from __future__ import annotations

import warp as wp

from ..frame.alpha import Alpha, texels_near

LEAF = 4

ROUNDING = wp.constant(wp.float64(16.0 * 2.0**-53))
WIDEN = wp.constant(wp.float64(2.0**-48))
FAR = wp.constant(wp.float64(1.0e300))

wp.set_module_options({"enable_backward": False, "fast_math": False})


# --- filter -------------------------------------------------------------------------------------------------


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


@wp.func
def slab(o: wp.vec3d, d: wp.vec3d, low: wp.vec3f, high: wp.vec3f, pad: wp.float64, limit: wp.float64) -> wp.bool:
    """False only where no point o + t d with 0 <= t <= limit lies in the box grown by pad."""
    enter = wp.float64(0.0)
    leave = limit
    for i in range(3):
        lo = wp.float64(low[i]) - pad
        hi = wp.float64(high[i]) + pad
        if lo > hi:
            return False
        if d[i] == wp.float64(0.0):
            if o[i] < lo or o[i] > hi:
                return False
        else:
            t0 = (lo - o[i]) / d[i]
            t1 = (hi - o[i]) / d[i]
            first = wp.min(t0, t1)
            last = wp.max(t0, t1)
            enter = wp.max(enter, first - WIDEN * wp.abs(first))
            leave = wp.min(leave, last + WIDEN * wp.abs(last))
    return enter <= leave


@wp.func
def after(node: wp.int32) -> wp.int32:
    """The next node in depth-first order that is not below this one; 0 at the end."""
    n = node
    while (n & 1) == 1:
        n = n >> 1
    if n == 0:
        return 0
    return n + 1


# --- kernels ------------------------------------------------------------------------------------------------


@wp.kernel
def find_nearest(
    low: wp.array[wp.vec3f],
    high: wp.array[wp.vec3f],
    order: wp.array[wp.int32],
    leaves: wp.int32,
    points: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    alpha: Alpha,
    origins: wp.array[wp.vec3d],
    directions: wp.array[wp.vec3d],
    best: wp.array[wp.float64],
):
    """best [n]: an upper bound of the closest t of each ray, from its certain hits; FAR where there is none."""
    i = wp.tid()
    o = origins[i]
    d = directions[i]
    zero = wp.float64(0.0)
    limit = wp.float64(1.0e300)
    node = wp.int32(1)
    while node > 0:
        if not slab(o, d, low[node], high[node], wp.float64(0.0), limit):
            node = after(node)
        elif node < leaves:
            node = 2 * node
        else:
            for k in range(LEAF):
                triangle = order[(node - leaves) * LEAF + k]
                if triangle >= 0:
                    f = triangles[triangle]
                    a = widen(points[f[0]])
                    b = widen(points[f[1]])
                    c = widen(points[f[2]])
                    r = filter_ray(o, d, a, b, c)
                    if r[0] == wp.float64(1.0) and opacity(alpha, triangle, d, a - o, b - o, c - o, zero, zero) == 1:
                        limit = wp.min(limit, r[2])
            node = after(node)
    best[i] = limit


@wp.kernel
def collect_hits(
    low: wp.array[wp.vec3f],
    high: wp.array[wp.vec3f],
    order: wp.array[wp.int32],
    leaves: wp.int32,
    points: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    alpha: Alpha,
    origins: wp.array[wp.vec3d],
    directions: wp.array[wp.vec3d],
    best: wp.array[wp.float64],
    todo: wp.array[wp.int32],
    offsets: wp.array[wp.int32],
    write: wp.int32,
    counts: wp.array[wp.int32],
    found: wp.array[wp.int32],
):
    """Every triangle that may be hit at t <= best: counted, and written from offsets on if ``write``.

    ``todo``: the rays of the launch; ``offsets`` and ``counts`` are by their places in it.
    """
    place = wp.tid()
    i = todo[place]
    o = origins[i]
    d = directions[i]
    zero = wp.float64(0.0)
    limit = best[i]
    count = wp.int32(0)
    node = wp.int32(1)
    while node > 0:
        if not slab(o, d, low[node], high[node], wp.float64(0.0), limit):
            node = after(node)
        elif node < leaves:
            node = 2 * node
        else:
            for k in range(LEAF):
                triangle = order[(node - leaves) * LEAF + k]
                if triangle >= 0:
                    f = triangles[triangle]
                    a = widen(points[f[0]])
                    b = widen(points[f[1]])
                    c = widen(points[f[2]])
                    r = filter_ray(o, d, a, b, c)
                    seen = r[0] > zero and r[1] <= limit
                    if r[0] == wp.float64(1.0) and seen:
                        seen = opacity(alpha, triangle, d, a - o, b - o, c - o, zero, zero) != 0
                    if seen:
                        if write == 1:
                            found[offsets[place] + count] = triangle
                        count += 1
            node = after(node)
    counts[place] = count


@wp.kernel
def collect_between(
    low: wp.array[wp.vec3f],
    high: wp.array[wp.vec3f],
    order: wp.array[wp.int32],
    leaves: wp.int32,
    points: wp.array[wp.vec3f],
    triangles: wp.array[wp.vec3i],
    alpha: Alpha,
    starts: wp.array[wp.vec3d],
    errors: wp.array[wp.float64],
    own: wp.array[wp.int32],
    margin: wp.array[wp.float64],
    lights: wp.array[wp.vec3d],
    pad: wp.float64,
    every: wp.int32,
    row: wp.array[wp.int32],
    target: wp.array[wp.int32],
    todo: wp.array[wp.int32],
    offsets: wp.array[wp.int32],
    write: wp.int32,
    counts: wp.array[wp.int32],
    found: wp.array[wp.int32],
    certain: wp.array[wp.int32],
):
    """Triangles but ``own`` that may meet the open segment from starts[row] to lights[target]; one certain occluder, or -1.

    ``todo``: the segments of the launch; ``offsets``, ``counts`` and ``certain`` are by their places in it.
    With ``every`` = 0 a certain occluder ends the search. With ``margin`` > 0 triangles within that distance of the
    segment are collected too, and some beyond it.
    """
    place = wp.tid()
    i = row[todo[place]]
    light = lights[target[todo[place]]]
    p = starts[i]
    d = light - p
    wide = margin[i]
    count = wp.int32(0)
    sure = wp.int32(-1)
    node = wp.int32(1)
    while node > 0:
        if not slab(p, d, low[node], high[node], pad + wide, wp.float64(1.0)):
            node = after(node)
        elif node < leaves:
            node = 2 * node
        else:
            for k in range(LEAF):
                triangle = order[(node - leaves) * LEAF + k]
                if triangle >= 0 and triangle != own[i]:
                    f = triangles[triangle]
                    a = widen(points[f[0]])
                    b = widen(points[f[1]])
                    c = widen(points[f[2]])
                    status = filter_segment(p, light, a, b, c, errors[i])
                    if status == 1:
                        status = opacity(alpha, triangle, d, a - p, b - p, c - p, errors[i], errors[i])
                    if status == 1 and sure < 0:
                        sure = triangle
                    if wide > wp.float64(0.0) and status == 0:
                        near = not beside(d, a - p, b - p, c - p, errors[i], wp.float64(2.0) * wide)
                    else:
                        near = status > 0
                    if near:
                        if write == 1:
                            found[offsets[place] + count] = triangle
                        count += 1
            node = after(node)
            if sure >= 0 and every == 0:
                node = wp.int32(0)
    counts[place] = count
    certain[place] = sure
