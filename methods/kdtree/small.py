"""Small nodes by the surface area heuristic: Zhou et al. 2008, with sets of at most 64 triangles as bits of a word.

A block of 32 threads takes a small root and builds the tree below it. The faces of the pairs' boxes are its candidate
planes. For each plane the block makes two words once: which pairs belong below and which above. A node is then a word,
and the cost of a plane in it follows from the bits of the words. (Zhou et al. proceed breadth first; the tree is the
same. A block can complete its root alone because nodes are numbered as they are made.) On a CPU a block is one thread.
"""

import warp as wp

from ...harness.frame.geometry import value_struct
from .nodes import SMALL, SMALL_DEPTH, Count, Work, bit, goes_above, goes_below, put_inner, put_leaf, with_coordinate

WIDTH = 32
"""Threads of a block."""

CANDIDATES = 6 * SMALL
MOST_CANDIDATES = wp.constant(CANDIDATES)
MOST_SMALL = wp.constant(SMALL)
DEPTH = wp.constant(SMALL_DEPTH)
NODE_CHUNK = 128
MEMBER_CHUNK = 512
"""Number of entries that a block reserves at once: one atomic per node would take most of the time."""

STACK_ROOM = wp.constant(SMALL_DEPTH + 1)
NO_PLANE = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))
EMPTY_SPACE = wp.constant(wp.float32(0.8))
"""The cost of a plane that cuts off empty space is multiplied by this, because a ray that leaves there needs no further
test in the node.
"""


@value_struct
class Pending:
    """A node that is still to be divided: its pairs, as bits, its number, its level below the root, its region."""

    those: wp.uint64
    node: wp.int32
    depth: wp.int32
    low: wp.vec3f
    high: wp.vec3f


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__syncwarp();
#endif
""")
def wait_for_others():
    """From here on a lane reads what the other lanes of its block have written."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __shfl_sync(0xffffffffu, value, 0);
#else
return value;
#endif
""")
def of_first_lane(value: wp.int32) -> wp.int32: ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
for (int to = 16; to > 0; to >>= 1) {
    unsigned long long other = __shfl_xor_sync(0xffffffffu, (unsigned long long)value, to);
    value = other < value ? other : value;
}
#endif
return value;
""")
def least_of_lanes(value: wp.uint64) -> wp.uint64: ...


@wp.func_native("""
for (int left = rank; left > 0; left--) word &= word - 1;
#if defined(__CUDA_ARCH__)
return __ffsll((long long)word) - 1;
#else
return __builtin_ctzll(word);
#endif
""")
def set_bit(word: wp.uint64, rank: wp.int32) -> wp.int32:
    """The place of the bit of a word that has ``rank`` set bits below it."""


@wp.func
def area(low: wp.vec3f, high: wp.vec3f) -> wp.float32:
    """Half the surface of a box."""
    s = high - low
    return s[0] * s[1] + s[1] * s[2] + s[2] * s[0]


@wp.func
def split_cost(
    traversal: wp.float32, low: wp.vec3f, high: wp.vec3f, whole: wp.float32, plane: wp.float32, axis: wp.int32,
    below: wp.int32, above: wp.int32,
) -> wp.float32:  # fmt: skip
    """The expected cost, in triangle tests, of a ray through the node, whose :func:`area` is ``whole``."""
    of_below = area(low, with_coordinate(high, axis, plane)) * wp.float32(below)
    of_above = area(with_coordinate(low, axis, plane), high) * wp.float32(above)
    cost = traversal + (of_below + of_above) / whole
    if below == 0 or above == 0:
        cost *= EMPTY_SPACE
    return cost


@wp.func
def order_root(lane: wp.int32, slot: wp.int32, count: wp.int32, block: wp.int32, work: Work):
    """Put the pairs of a root in the order of their triangles, because the order in which they were listed varies from
    run to run.
    """
    refs = work.refs
    begin = work.roots.begin[slot]
    for k in range(lane, count, wp.block_dim()):
        at = work.roots.listed[begin + k]
        i = refs.triangle[at]
        rank = wp.int32(0)
        for other in range(count):
            if refs.triangle[work.roots.listed[begin + other]] < i:
                rank += 1
        work.scratch.triangles[block * MOST_SMALL + rank] = i
        low = refs.low[at]
        high = refs.high[at]
        to = block * MOST_CANDIDATES + 6 * rank
        for axis in range(wp.static(3)):
            work.scratch.planes[to + axis] = low[axis]
            work.scratch.planes[to + 3 + axis] = high[axis]


@wp.func
def sort_pairs(lane: wp.int32, count: wp.int32, words: wp.int32, work: Work):
    """Which pairs each candidate plane leaves below and above."""
    scratch = work.scratch
    for k in range(lane, 6 * count, wp.block_dim()):
        plane = scratch.planes[words + k]
        axis = k % 3
        below = wp.uint64(0)
        above = wp.uint64(0)
        for other in range(count):
            low = scratch.planes[words + 6 * other + axis]
            high = scratch.planes[words + 6 * other + 3 + axis]
            if goes_below(low, high, plane):
                below = below | bit(other)
            if goes_above(low, high, plane):
                above = above | bit(other)
        scratch.below[words + k] = below
        scratch.above[words + k] = above


@wp.func
def best_plane(lane: wp.int32, words: wp.int32, at: Pending, traversal: wp.float32, work: Work) -> wp.uint64:
    """The candidate of least cost, behind its cost's bits; NO_PLANE where a leaf costs no more. The same for all lanes."""
    scratch = work.scratch
    number = wp.bit_count(at.those)
    whole = area(at.low, at.high)
    best = NO_PLANE
    if whole > 0.0 and wp.float32(number) > EMPTY_SPACE * traversal:
        for rank in range(lane, 6 * number, wp.block_dim()):
            k = 6 * set_bit(at.those, rank // 6) + rank % 6
            plane = scratch.planes[words + k]
            axis = k % 3
            if plane > at.low[axis] and plane < at.high[axis]:
                below = wp.bit_count(at.those & scratch.below[words + k])
                above = wp.bit_count(at.those & scratch.above[words + k])
                cost = split_cost(traversal, at.low, at.high, whole, plane, axis, below, above)
                if cost < wp.float32(number):
                    key = (wp.uint64(wp.cast(cost, wp.uint32)) << wp.uint64(32)) | wp.uint64(k)
                    best = wp.min(best, key)
    return least_of_lanes(best)


@wp.kernel(enable_backward=False)
def small_kernel(blocks: wp.int32, traversal: wp.float32, work: Work):
    """The trees below all small roots; one leaf where more triangles were left than a word has bits."""
    block, lane = wp.tid()
    roots = work.roots
    members = work.tree.members
    counters = work.counters
    stack = wp.zeros(shape=STACK_ROOM, dtype=Pending)
    room = members.shape[0]
    words = block * MOST_CANDIDATES
    next_node = wp.int32(0)
    end_node = wp.int32(0)
    next_member = wp.int32(0)
    end_member = wp.int32(0)
    nodes_used = wp.int32(0)
    members_used = wp.int32(0)
    longest = wp.int32(0)
    slot = wp.int32(block)
    while slot < counters[Count.ROOTS]:
        count = roots.count[slot]
        root = roots.node[slot]
        held = wp.int32(0)
        mine = wp.int32(0)
        if count > MOST_SMALL:
            if lane == 0:
                mine = wp.atomic_add(counters, Count.MEMBERS, count)
                put_leaf(work.tree, root, mine, count)
            place = of_first_lane(mine)
            members_used += count
            longest = wp.max(longest, count)
            for k in range(lane, count, wp.block_dim()):
                if place + k < room:
                    members[place + k] = work.refs.triangle[roots.listed[roots.begin[slot] + k]]
        else:
            order_root(lane, slot, count, block, work)
            wait_for_others()
            sort_pairs(lane, count, words, work)
            wait_for_others()
            stack[0] = Pending(NO_PLANE >> wp.uint64(64 - count), root, 0, work.large.low[root], work.large.high[root])
            held = 1
        while held > 0:
            held -= 1
            at = stack[held]
            best = NO_PLANE
            if at.depth < DEPTH:
                best = best_plane(lane, words, at, traversal, work)
            if best == NO_PLANE:
                number = wp.bit_count(at.those)
                if next_member + number > end_member:
                    if lane == 0:
                        mine = wp.atomic_add(counters, Count.MEMBERS, MEMBER_CHUNK)
                    next_member = of_first_lane(mine)
                    end_member = next_member + MEMBER_CHUNK
                place = wp.int32(next_member)
                next_member += number
                members_used += number
                longest = wp.max(longest, number)
                if lane == 0:
                    put_leaf(work.tree, at.node, place, number)
                for rank in range(lane, number, wp.block_dim()):
                    if place + rank < room:
                        members[place + rank] = work.scratch.triangles[block * MOST_SMALL + set_bit(at.those, rank)]
            else:
                chosen = wp.int32(best & wp.uint64(0xFFFFFFFF))
                plane = work.scratch.planes[words + chosen]
                axis = chosen % 3
                if next_node == end_node:
                    if lane == 0:
                        mine = wp.atomic_add(counters, Count.NODES, NODE_CHUNK)
                    next_node = of_first_lane(mine)
                    end_node = next_node + NODE_CHUNK
                child = wp.int32(next_node)
                next_node += 2
                nodes_used += 2
                if lane == 0:
                    put_inner(work.tree, at.node, plane, axis, child)
                below = at.those & work.scratch.below[words + chosen]
                above = at.those & work.scratch.above[words + chosen]
                low = with_coordinate(at.low, axis, plane)
                high = with_coordinate(at.high, axis, plane)
                stack[held] = Pending(above, child + 1, at.depth + 1, low, at.high)
                stack[held + 1] = Pending(below, child, at.depth + 1, at.low, high)
                held += 2
        wait_for_others()
        slot += blocks
    if lane == 0:
        wp.atomic_add(counters, Count.NODES_USED, nodes_used)
        wp.atomic_add(counters, Count.MEMBERS_USED, members_used)
        wp.atomic_max(counters, Count.LONGEST, longest)


@wp.kernel(enable_backward=False)
def finish_kernel(work: Work):
    """Write what the frame needed. Where that exceeds the capacity, make a tree without triangles, which rays can
    traverse.
    """
    pairs = work.counters[Count.REFS]
    large = work.counters[Count.LARGE_NODES]
    nodes = work.counters[Count.NODES]
    members = work.counters[Count.MEMBERS]
    work.need[0] = wp.int64(pairs)
    work.need[1] = wp.int64(large)
    work.need[2] = wp.int64(nodes)
    work.need[3] = wp.int64(members)
    tree = work.tree
    fits = pairs <= work.refs.triangle.shape[0] and large <= work.large.count.shape[0]
    if not (fits and nodes <= tree.nodes.shape[0] and members <= tree.members.shape[0]):
        put_leaf(tree, 0, 0, 0)
