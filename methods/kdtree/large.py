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
from ..common.axes import longest_axis
from ..common.bounds import box_high, box_low
from ..gpu.reserve import number_in, reserve
from .clip import Box, is_box, parts_of
from .nodes import SETTLED, Count, Large, Work, goes_above, goes_below, put_inner, put_leaf, with_coordinate

NOTHING = wp.constant(0x7FFFFFFF)
"""Start of a minimum of :func:`ordered` numbers."""

MOST_GROWTH = wp.constant(wp.float32(8.0))
"""Nodes whose ancestors have multiplied their pairs by this are not divided. For surfaces the factor is about 2."""


@wp.func
def ordered(x: wp.float32) -> wp.int32:
    """An integer in the order of x, for atomics."""
    bits = wp.cast(x, wp.int32)
    return wp.where(bits < 0, bits ^ 0x7FFFFFFF, bits)


@wp.func
def unordered(key: wp.int32) -> wp.float32:
    return wp.cast(wp.where(key < 0, key ^ 0x7FFFFFFF, key), wp.float32)


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
def tighten(large: Large, node: wp.int32, box: Box):
    for k in range(wp.static(3)):
        lower_to(large.tight, 6 * node + k, ordered(box.low[k]))
        lower_to(large.tight, 6 * node + 3 + k, ordered(-box.high[k]))


@wp.func
def put_large(large: Large, node: wp.int32, region: Box, depth: wp.int32, growth: wp.float32, parent: wp.int32):
    large.low[node] = region.low
    large.high[node] = region.high
    large.count[node] = 0
    large.depth[node] = depth
    large.growth[node] = growth
    large.parent[node] = parent
    for k in range(wp.static(6)):
        large.tight[6 * node + k] = NOTHING


@wp.kernel(enable_backward=False)
def gather_kernel(mesh: Mesh, work: Work):
    """A pair of the root for each valid triangle."""
    i = wp.tid()
    if mesh.valid[i] == wp.uint8(0):
        return
    refs = work.refs
    at = reserve(work.counters, Count.REFS, 1)
    if at < refs.triangle.shape[0]:
        corners = corners_of(mesh, i)
        refs.triangle[at] = i
        refs.node[at] = 0
        refs.low[at] = wp.min(corners.a, wp.min(corners.b, corners.c))
        refs.high[at] = wp.max(corners.a, wp.max(corners.b, corners.c))


@wp.kernel(enable_backward=False)
def root_kernel(work: Work):
    """The root: one thread, after :func:`gather_kernel`."""
    large = work.large
    counters = work.counters
    region = Box(box_low(work.tree.box), box_high(work.tree.box))
    held = wp.min(counters[Count.REFS], work.refs.triangle.shape[0])
    put_large(large, 0, region, 0, 1.0, held)
    large.count[0] = held
    tighten(large, 0, region)
    counters[Count.NODES] = 1
    counters[Count.LEVEL_BEGIN] = 0
    counters[Count.LEVEL_END] = 1
    counters[Count.REFS_END] = held
    work.going[0] = 1


@wp.func
def settle(work: Work, node: wp.int32, last: wp.int32, count: wp.int32):
    """The pairs of ``node`` stay together, in the region of ``last``."""
    slot = wp.atomic_add(work.counters, Count.ROOTS, 1)
    work.roots.node[slot] = last
    work.roots.begin[slot] = wp.atomic_add(work.counters, Count.LISTED, count)
    work.roots.count[slot] = count
    work.roots.cursor[slot] = 0
    work.large.target[node] = -1 - slot


@wp.kernel(enable_backward=False)
def divide_kernel(threads: wp.int32, small: wp.int32, empty: wp.float32, most_depth: wp.int32, work: Work):
    """Each node of the level is marked as settled, or gets its planes."""
    large = work.large
    counters = work.counters
    node = counters[Count.LEVEL_BEGIN] + wp.tid()
    room = large.count.shape[0]
    while node < counters[Count.LEVEL_END]:
        depth = large.depth[node]
        count = large.count[node]
        large.target[node] = -1
        if depth != SETTLED and count == 0:
            put_leaf(work.tree, node, 0, 0)
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
                    child = wp.atomic_add(counters, Count.NODES, 2)
                    if child + 1 < room:
                        put_inner(work.tree, last, edge, axis, child)
                        rest = wp.int32(child)
                        if side < 3:
                            rest = child + 1
                            low[axis] = edge
                        else:
                            high[axis] = edge
                        put_leaf(work.tree, child + child + 1 - rest, 0, 0)
                        large.depth[child] = SETTLED
                        large.depth[child + 1] = SETTLED
                        large.low[rest] = low
                        large.high[rest] = high
                        last = rest
                        depth += 1
            sides = high - low
            axis = longest_axis(sides)
            middle = low[axis] + 0.5 * sides[axis]
            if not done and middle > low[axis] and middle < high[axis]:
                child = wp.atomic_add(counters, Count.NODES, 2)
                done = child + 1 >= room
                if not done:
                    put_inner(work.tree, last, middle, axis, child)
                    put_large(large, child, Box(low, with_coordinate(high, axis, middle)), depth + 1, growth, count)
                    put_large(large, child + 1, Box(with_coordinate(low, axis, middle), high), depth + 1, growth, count)
                    large.target[node] = last
            else:
                done = True
            if done:
                settle(work, node, last, count)
        node += threads


@wp.func
def join(work: Work, at: wp.int32, node: wp.int32, box: Box):
    """The pair at ``at`` belongs to ``node`` from now on."""
    work.refs.node[at] = node
    work.refs.low[at] = box.low
    work.refs.high[at] = box.high
    number_in(work.large.count, node)
    tighten(work.large, node, box)


@wp.kernel(enable_backward=False)
def distribute_kernel(threads: wp.int32, mesh: Mesh, work: Work):
    """Each pair of the level's nodes goes to the child that it meets, or to both."""
    refs = work.refs
    counters = work.counters
    at = wp.int32(wp.tid())
    while at < counters[Count.REFS_END]:
        node = refs.node[at]
        if node >= counters[Count.LEVEL_BEGIN]:
            target = work.large.target[node]
            if target >= 0:
                split = work.tree.nodes[target]
                plane = wp.cast(split[0], wp.float32)
                axis = split[1] & 3
                child = split[1] >> 2
                box = Box(refs.low[at], refs.high[at])
                below = goes_below(box.low[axis], box.high[axis], plane)
                above = goes_above(box.low[axis], box.high[axis], plane)
                if below and above:
                    i = refs.triangle[at]
                    parts = parts_of(mesh, i, box, plane, axis)
                    refs.node[at] = -1
                    place = wp.int32(at)
                    if is_box(parts.below):
                        join(work, at, child, parts.below)
                    if is_box(parts.above):
                        if is_box(parts.below):
                            place = reserve(counters, Count.REFS, 1)
                        if place < refs.triangle.shape[0]:
                            refs.triangle[place] = i
                            join(work, place, child + 1, parts.above)
                elif below:
                    join(work, at, child, box)
                else:
                    join(work, at, child + 1, box)
        at += threads


@wp.kernel(enable_backward=False)
def advance_kernel(work: Work):
    """The next level; one thread."""
    counters = work.counters
    begin = counters[Count.LEVEL_END]
    end = counters[Count.NODES]
    if end > work.large.count.shape[0]:
        end = begin  # the frame will be repeated with more room
    counters[Count.LEVEL_BEGIN] = begin
    counters[Count.LEVEL_END] = end
    counters[Count.REFS_END] = wp.min(counters[Count.REFS], work.refs.triangle.shape[0])
    counters[Count.LARGE_NODES] = counters[Count.NODES]
    work.going[0] = wp.where(end > begin, 1, 0)


@wp.kernel(enable_backward=False)
def list_kernel(threads: wp.int32, work: Work):
    """List the pairs of each root, in any order."""
    at = wp.int32(wp.tid())
    while at < work.counters[Count.REFS_END]:
        node = work.refs.node[at]
        if node >= 0 and node < work.counters[Count.LEVEL_BEGIN]:
            slot = -1 - work.large.target[node]
            if slot >= 0:
                place = work.roots.begin[slot] + number_in(work.roots.cursor, slot)
                if place < work.roots.listed.shape[0]:
                    work.roots.listed[place] = at
        at += threads
