"""The referee's float64 filter: which triangles a ray certainly misses or meets; and its tree, with the kernels that find
what a ray or a segment may meet.

Every test has an error bound. With u = 2^-53 a difference of float32 values carries u, a product of two of them 3u, a
cross product 4u of its sum of absolute values, and a triple product 7u of its *permanent* (the same expression in
absolute values); 16u is used, which also covers the rounding of the permanent itself. Fused multiply-adds round less.
Values lie between 2^-447 and 2^387: no float64 overflow or underflow.

The tree is a heap: node i has children 2i and 2i + 1, leaf j holds ``LEAF`` triangles of a sorted order. Its boxes are
exact; the slab test widens its interval by 2^-48, far more than its two roundings.
"""

import warp as wp

from ..frame.alpha import Alpha, texels_near

wp.set_module_options({"enable_backward": False, "fast_math": False})

ROUNDING = wp.constant(wp.float64(16.0 * 2.0**-53))
WIDEN = wp.constant(wp.float64(2.0**-48))
FAR = wp.constant(wp.float64(1.0e300))
LEAF = 4


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
    seen along d, where a triple product over the edge's length is the distance from the edge.
    """
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


@wp.struct
class Tree:
    """Boxes over the valid triangles of a mesh, and the mesh.

    low, high  vec3f [2 * leaves]: boxes in heap order from 1; empty ones have low > high
    order      int32 [leaves * LEAF]: triangle of each slot, -1 for none
    leaves     a power of two
    """

    low: wp.array[wp.vec3f]
    high: wp.array[wp.vec3f]
    order: wp.array[wp.int32]
    leaves: wp.int32
    points: wp.array[wp.vec3f]
    triangles: wp.array[wp.vec3i]
    alpha: Alpha


@wp.func
def corners_of(tree: Tree, triangle: wp.int32):
    f = tree.triangles[triangle]
    return widen(tree.points[f[0]]), widen(tree.points[f[1]]), widen(tree.points[f[2]])


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


@wp.func
def next_leaf(tree: Tree, first: wp.int32, o: wp.vec3d, d: wp.vec3d, pad: wp.float64, limit: wp.float64) -> wp.int32:
    """The first leaf from a node on, in depth-first order, that a ray may meet by :func:`slab`; 0 at the end."""
    node = first
    while node > 0:
        if not slab(o, d, tree.low[node], tree.high[node], pad, limit):
            node = after(node)
        elif node < tree.leaves:
            node = 2 * node
        else:
            return node
    return node


@wp.struct
class Found:
    """Candidates in the order in which they are found: of one ray in that of the tree, of several in any.

    pairs  the ray and the triangle of each, as many as there is room for
    least  where a ray meets the triangle at the earliest
    count  int64 [1]: how many there are, also of those without room
    """

    pairs: wp.array[wp.vec2i]
    least: wp.array[wp.float64]
    count: wp.array[wp.int64]


@wp.func
def put(found: Found, ray: wp.int32, triangle: wp.int32, least: wp.float64):
    place = wp.atomic_add(found.count, 0, wp.int64(1))
    if place < wp.int64(found.pairs.shape[0]):
        found.pairs[place] = wp.vec2i(ray, triangle)
        found.least[place] = least


@wp.kernel
def collect_hits(
    tree: Tree, first: wp.int32, origins: wp.array[wp.vec3d], directions: wp.array[wp.vec3d], nearest: wp.int32,
    found: Found, best: wp.array[wp.float64],
):  # fmt: skip
    """Every triangle that the rays from the ``first`` on may hit. With ``nearest`` = 1 none beyond the certain hits
    found before it; best [n] is then an upper bound of the closest t of each ray, from all of them.
    """
    i = first + wp.tid()
    o = origins[i]
    d = directions[i]
    zero = wp.float64(0.0)
    limit = wp.float64(1.0e300)
    leaf = next_leaf(tree, 1, o, d, zero, limit)
    while leaf > 0:
        for k in range(LEAF):
            triangle = tree.order[(leaf - tree.leaves) * LEAF + k]
            if triangle >= 0:
                a, b, c = corners_of(tree, triangle)
                r = filter_ray(o, d, a, b, c)
                status = wp.int32(r[0])
                if status == 1 and r[1] <= limit:
                    status = opacity(tree.alpha, triangle, d, a - o, b - o, c - o, zero, zero)
                if status > 0 and r[1] <= limit:
                    put(found, i, triangle, r[1])
                    if status == 1 and nearest == 1:
                        limit = wp.min(limit, r[2])
        leaf = next_leaf(tree, after(leaf), o, d, zero, limit)
    best[i] = limit


@wp.kernel
def collect_between(
    tree: Tree, first: wp.int32, starts: wp.array[wp.vec3d], errors: wp.array[wp.float64], own: wp.array[wp.int32],
    margin: wp.array[wp.float64], lights: wp.array[wp.vec3d], pad: wp.float64, every: wp.int32,
    row: wp.array[wp.int32], target: wp.array[wp.int32], found: Found, certain: wp.array[wp.int32],
):  # fmt: skip
    """Triangles but ``own`` that may meet the open segment from starts[row] to lights[target]; one certain occluder, or
    -1. Of the segments from the ``first`` on. With ``every`` = 0 a certain occluder ends the search. With ``margin`` >
    0 triangles within that distance of the segment are collected too, and some beyond it.
    """
    s = first + wp.tid()
    i = row[s]
    light = lights[target[s]]
    p = starts[i]
    d = light - p
    wide = margin[i]
    sure = wp.int32(-1)
    leaf = next_leaf(tree, 1, p, d, pad + wide, wp.float64(1.0))
    while leaf > 0:
        for k in range(LEAF):
            triangle = tree.order[(leaf - tree.leaves) * LEAF + k]
            if triangle >= 0 and triangle != own[i]:
                a, b, c = corners_of(tree, triangle)
                status = filter_segment(p, light, a, b, c, errors[i])
                if status == 1:
                    status = opacity(tree.alpha, triangle, d, a - p, b - p, c - p, errors[i], errors[i])
                if status == 1 and sure < 0:
                    sure = triangle
                if wide > wp.float64(0.0) and status == 0:
                    near = not beside(d, a - p, b - p, c - p, errors[i], wp.float64(2.0) * wide)
                else:
                    near = status > 0
                if near:
                    put(found, s, triangle, wp.float64(0.0))
        if sure >= 0 and every == 0:
            break
        leaf = next_leaf(tree, after(leaf), p, d, pad + wide, wp.float64(1.0))
    certain[s] = sure
