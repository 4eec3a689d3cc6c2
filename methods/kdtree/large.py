"""Large nodes, breadth first: cut off empty space, then divide at the middle of the longest side. Zhou et al. 2008.

A level is three launches, repeated inside the graph while there are nodes to divide: nodes choose their planes, pairs go
to the children, the level's bounds advance. Pairs stay where they are. A pair that both children need stays in its place
for one child and is appended for the other, with its box cut to each (as spatial splits do, Stich et al. 2009). So no
lists are moved or sorted; each pair stores its node.

Division ends at nodes of ``small`` pairs, at LARGE_DEPTH, and where a node's ancestors have multiplied their pairs
MOST_GROWTH times: 100,000 triangles with one centroid would otherwise be doubled at each level. So there are at most
2 MOST_GROWTH pairs for each triangle: the pairs of all leaves, each divided by its growth, add up to the triangles.
"""

import warp as wp

from ...harness.frame.geometry import Mesh, corners_of
from ..common.bounds import box_high, box_low
from ..gpu.reserve import number_in, reserve
from .clip import parts_of
from .nodes import (
    LARGE_NODES,
    LEVEL_BEGIN,
    LEVEL_END,
    LISTED,
    NODES,
    REFS,
    REFS_END,
    ROOTS,
    SETTLED,
    Large,
    Refs,
    Roots,
    goes_above,
    goes_below,
    ordered,
    put_inner,
    put_leaf,
    unordered,
)

NOTHING = wp.constant(0x7FFFFFFF)
"""Start of a minimum of :func:`.nodes.ordered` numbers."""

MOST_GROWTH = wp.constant(wp.float32(8.0))
"""Nodes whose ancestors have multiplied their pairs by this are not divided. For surfaces the factor is about 2."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
if (values.data[i] > value) atomicMin(values.data + i, value);
#else
if (values.data[i] > value) values.data[i] = value;
#endif
""")
def lower_to(values: wp.array(dtype=wp.int32), i: wp.int32, value: wp.int32):
    """Lower an entry to at most ``value``. The entry is read first: most are low enough."""


@wp.func
def tighten(large: Large, node: wp.int32, low: wp.vec3f, high: wp.vec3f):
    for k in range(wp.static(3)):
        lower_to(large.tight, 6 * node + k, ordered(low[k]))
        lower_to(large.tight, 6 * node + 3 + k, ordered(-high[k]))


@wp.func
def put_large(
    large: Large, node: wp.int32, low: wp.vec3f, high: wp.vec3f, depth: wp.int32, growth: wp.float32, parent: wp.int32
):  # fmt: skip
    large.low[node] = low
    large.high[node] = high
    large.count[node] = 0
    large.depth[node] = depth
    large.growth[node] = growth
    large.parent[node] = parent
    for k in range(wp.static(6)):
        large.tight[6 * node + k] = NOTHING


@wp.kernel(enable_backward=False)
def gather_kernel(mesh: Mesh, refs: Refs, large: Large, counters: wp.array(dtype=wp.int32)):
    """A pair of the root for each valid triangle."""
    i = wp.tid()
    if mesh.valid[i] == wp.uint8(0):
        return
    at = reserve(counters, REFS, 1)
    if at < refs.triangle.shape[0]:
        corners = corners_of(mesh, i)
        refs.triangle[at] = i
        refs.node[at] = 0
        refs.low[at] = wp.min(corners.a, wp.min(corners.b, corners.c))
        refs.high[at] = wp.max(corners.a, wp.max(corners.b, corners.c))


@wp.kernel(enable_backward=False)
def root_kernel(
    refs: Refs,
    large: Large,
    box: wp.array(dtype=wp.float32),
    counters: wp.array(dtype=wp.int32),
    going: wp.array(dtype=wp.int32),
):
    """The root: one thread, after :func:`gather_kernel`."""
    low = box_low(box)
    high = box_high(box)
    held = wp.min(counters[REFS], refs.triangle.shape[0])
    put_large(large, 0, low, high, 0, 1.0, held)
    large.count[0] = held
    tighten(large, 0, low, high)
    counters[NODES] = 1
    counters[LEVEL_BEGIN] = 0
    counters[LEVEL_END] = 1
    counters[REFS_END] = held
    going[0] = 1


@wp.func
def settle(
    large: Large, roots: Roots, node: wp.int32, last: wp.int32, count: wp.int32, counters: wp.array(dtype=wp.int32)
):  # fmt: skip
    """The pairs of ``node`` stay together, in the region of ``last``."""
    slot = wp.atomic_add(counters, ROOTS, 1)
    roots.node[slot] = last
    roots.begin[slot] = wp.atomic_add(counters, LISTED, count)
    roots.count[slot] = count
    roots.cursor[slot] = 0
    large.target[node] = -1 - slot


@wp.func
def new_pair(counters: wp.array(dtype=wp.int32)) -> wp.int32:
    return wp.atomic_add(counters, NODES, 2)


@wp.kernel(enable_backward=False)
def divide_kernel(
    threads: wp.int32,
    small: wp.int32,
    empty: wp.float32,
    most_depth: wp.int32,
    large: Large,
    roots: Roots,
    nodes: wp.array(dtype=wp.vec2i),
    counters: wp.array(dtype=wp.int32),
):
    """Each node of the level is marked as settled, or gets its planes."""
    node = counters[LEVEL_BEGIN] + wp.tid()
    room = large.count.shape[0]
    while node < counters[LEVEL_END]:
        depth = large.depth[node]
        count = large.count[node]
        large.target[node] = -1
        if depth != SETTLED and count == 0:
            put_leaf(nodes, node, 0, 0)
        elif depth != SETTLED:
            growth = large.growth[node]
            if node > 0:
                sibling = node + 1
                if (node & 1) == 0:
                    sibling = node - 1
                growth *= wp.float32(count + large.count[sibling]) / wp.float32(large.parent[node])
            last = wp.int32(node)
            low = large.low[node]
            high = large.high[node]
            done = count <= small or depth >= most_depth or growth >= MOST_GROWTH
            # Empty space: a plane at the box of the pairs, an empty leaf beyond it; each side in turn.
            for side in range(wp.static(6)):
                axis = side % 3
                edge = unordered(large.tight[6 * node + side])
                if side >= 3:
                    edge = -edge
                gap = edge - low[axis]
                if side >= 3:
                    gap = high[axis] - edge
                if not done and depth + 1 < most_depth and gap > empty * (high[axis] - low[axis]):
                    child = new_pair(counters)
                    if child + 1 < room:
                        put_inner(nodes, last, edge, axis, child)
                        rest = wp.int32(child)
                        if side < 3:
                            rest = child + 1
                            low[axis] = edge
                        else:
                            high[axis] = edge
                        put_leaf(nodes, child + child + 1 - rest, 0, 0)
                        large.depth[child] = SETTLED
                        large.depth[child + 1] = SETTLED
                        large.low[rest] = low
                        large.high[rest] = high
                        last = rest
                        depth += 1
            sides = high - low
            longest = wp.int32(0)
            if sides[1] > sides[0]:
                longest = 1
            if sides[2] > sides[longest]:
                longest = 2
            middle = low[longest] + 0.5 * sides[longest]
            if not (middle > low[longest] and middle < high[longest]):
                done = True
            if not done:
                child = new_pair(counters)
                if child + 1 < room:
                    put_inner(nodes, last, middle, longest, child)
                    below_high = wp.vec3f(high[0], high[1], high[2])
                    below_high[longest] = middle
                    above_low = wp.vec3f(low[0], low[1], low[2])
                    above_low[longest] = middle
                    put_large(large, child, low, below_high, depth + 1, growth, count)
                    put_large(large, child + 1, above_low, high, depth + 1, growth, count)
                    large.target[node] = last
                else:
                    done = True
            if done:
                settle(large, roots, node, last, count, counters)
        node += threads


@wp.func
def join(refs: Refs, large: Large, at: wp.int32, node: wp.int32, low: wp.vec3f, high: wp.vec3f):
    """The pair at ``at`` belongs to ``node`` from now on."""
    refs.node[at] = node
    refs.low[at] = low
    refs.high[at] = high
    number_in(large.count, node)
    tighten(large, node, low, high)


@wp.kernel(enable_backward=False)
def distribute_kernel(
    threads: wp.int32,
    mesh: Mesh,
    refs: Refs,
    large: Large,
    nodes: wp.array(dtype=wp.vec2i),
    counters: wp.array(dtype=wp.int32),
):
    """Each pair of the level's nodes goes to the child that it meets, or to both."""
    at = wp.int32(wp.tid())
    while at < counters[REFS_END]:
        node = refs.node[at]
        if node >= counters[LEVEL_BEGIN]:
            target = large.target[node]
            if target >= 0:
                split = nodes[target]
                plane = wp.cast(split[0], wp.float32)
                axis = split[1] & 3
                child = split[1] >> 2
                low = refs.low[at]
                high = refs.high[at]
                below = goes_below(low[axis], high[axis], plane)
                above = goes_above(low[axis], high[axis], plane)
                if below and above:
                    i = refs.triangle[at]
                    parts = parts_of(mesh, i, low, high, plane, axis)
                    refs.node[at] = -1
                    if parts.below:
                        join(refs, large, at, child, parts.below_low, parts.below_high)
                    if parts.above:
                        place = wp.int32(at)
                        if parts.below:
                            place = reserve(counters, REFS, 1)
                        if place < refs.triangle.shape[0]:
                            refs.triangle[place] = i
                            join(refs, large, place, child + 1, parts.above_low, parts.above_high)
                elif below:
                    join(refs, large, at, child, low, high)
                else:
                    join(refs, large, at, child + 1, low, high)
        at += threads


@wp.kernel(enable_backward=False)
def advance_kernel(refs: Refs, large: Large, counters: wp.array(dtype=wp.int32), going: wp.array(dtype=wp.int32)):
    """The next level; one thread."""
    begin = counters[LEVEL_END]
    end = counters[NODES]
    if end > large.count.shape[0]:
        end = begin  # the frame will be repeated with more room
    counters[LEVEL_BEGIN] = begin
    counters[LEVEL_END] = end
    counters[REFS_END] = wp.min(counters[REFS], refs.triangle.shape[0])
    counters[LARGE_NODES] = counters[NODES]
    going[0] = wp.where(end > begin, 1, 0)


@wp.kernel(enable_backward=False)
def list_kernel(threads: wp.int32, refs: Refs, large: Large, roots: Roots, counters: wp.array(dtype=wp.int32)):
    """List the pairs of each root, in any order."""
    at = wp.int32(wp.tid())
    while at < counters[REFS_END]:
        node = refs.node[at]
        if node >= 0 and node < counters[LEVEL_BEGIN]:
            slot = -1 - large.target[node]
            if slot >= 0:
                place = roots.begin[slot] + number_in(roots.cursor, slot)
                if place < roots.listed.shape[0]:
                    roots.listed[place] = at
        at += threads
