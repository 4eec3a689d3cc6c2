"""The tree of the referee's float64 filter (:mod:`.judge.filters`): kernels that find what a ray or a segment may meet.

The tree is a heap: node i has children 2i and 2i + 1, leaf j holds ``LEAF`` triangles of a sorted order. Its boxes are
exact; the slab test widens its interval by 2^-48, far more than its two roundings.
"""

import warp as wp

from ..frame.alpha import Alpha
from .filters import WIDEN, beside, filter_ray, filter_segment, opacity, widen

LEAF = 4

wp.set_module_options({"enable_backward": False, "fast_math": False})


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
    found before it; best [n] is then an upper bound of the closest t of each ray, from all of them."""
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
    0 triangles within that distance of the segment are collected too, and some beyond it."""
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
