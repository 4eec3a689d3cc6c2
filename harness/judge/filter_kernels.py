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

    low: wp.array(dtype=wp.vec3f)
    high: wp.array(dtype=wp.vec3f)
    order: wp.array(dtype=wp.int32)
    leaves: wp.int32
    points: wp.array(dtype=wp.vec3f)
    triangles: wp.array(dtype=wp.vec3i)
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


@wp.kernel
def find_nearest(tree: Tree, origins: wp.array[wp.vec3d], directions: wp.array[wp.vec3d], best: wp.array[wp.float64]):
    """best [n]: an upper bound of the closest t of each ray, from its certain hits; FAR where there is none."""
    i = wp.tid()
    o = origins[i]
    d = directions[i]
    zero = wp.float64(0.0)
    limit = wp.float64(1.0e300)
    node = wp.int32(1)
    while node > 0:
        if not slab(o, d, tree.low[node], tree.high[node], wp.float64(0.0), limit):
            node = after(node)
        elif node < tree.leaves:
            node = 2 * node
        else:
            for k in range(LEAF):
                triangle = tree.order[(node - tree.leaves) * LEAF + k]
                if triangle >= 0:
                    a, b, c = corners_of(tree, triangle)
                    r = filter_ray(o, d, a, b, c)
                    if (
                        r[0] == wp.float64(1.0)
                        and opacity(tree.alpha, triangle, d, a - o, b - o, c - o, zero, zero) == 1
                    ):
                        limit = wp.min(limit, r[2])
            node = after(node)
    best[i] = limit


@wp.kernel
def collect_hits(
    tree: Tree,
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
        if not slab(o, d, tree.low[node], tree.high[node], wp.float64(0.0), limit):
            node = after(node)
        elif node < tree.leaves:
            node = 2 * node
        else:
            for k in range(LEAF):
                triangle = tree.order[(node - tree.leaves) * LEAF + k]
                if triangle >= 0:
                    a, b, c = corners_of(tree, triangle)
                    r = filter_ray(o, d, a, b, c)
                    seen = r[0] > zero and r[1] <= limit
                    if r[0] == wp.float64(1.0) and seen:
                        seen = opacity(tree.alpha, triangle, d, a - o, b - o, c - o, zero, zero) != 0
                    if seen:
                        if write == 1:
                            found[offsets[place] + count] = triangle
                        count += 1
            node = after(node)
    counts[place] = count


@wp.kernel
def collect_between(
    tree: Tree,
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
        if not slab(p, d, tree.low[node], tree.high[node], pad + wide, wp.float64(1.0)):
            node = after(node)
        elif node < tree.leaves:
            node = 2 * node
        else:
            for k in range(LEAF):
                triangle = tree.order[(node - tree.leaves) * LEAF + k]
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
                        if write == 1:
                            found[offsets[place] + count] = triangle
                        count += 1
            node = after(node)
            if sure >= 0 and every == 0:
                node = wp.int32(0)
    counts[place] = count
    certain[place] = sure
