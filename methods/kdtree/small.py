"""Small nodes by the surface area heuristic: Zhou et al. 2008, with sets of at most 64 triangles as bits of a word.

A block of 32 threads takes a small root and builds the tree below it. The faces of the pairs' boxes are its candidate
planes. For each plane the block makes two words once: which pairs belong below and which above. A node is then a word,
and the cost of a plane in it follows from the bits of the words. (Zhou et al. proceed breadth first; the tree is the
same. A block can complete its root alone because nodes are numbered as they are made.) On a CPU a block is one thread.
"""

import warp as wp

from .nodes import (
    LARGE_NODES,
    LONGEST,
    MEMBERS,
    MEMBERS_USED,
    NODES,
    NODES_USED,
    REFS,
    ROOTS,
    SMALL,
    SMALL_DEPTH,
    Large,
    Refs,
    Roots,
    bit,
    goes_above,
    goes_below,
    put_inner,
    put_leaf,
)

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
test in the node."""


@wp.struct
class Scratch:
    """Memory of each block.

    planes  float32 [blocks * CANDIDATES]: the faces of the root's pairs, low x y z and high x y z of each; by triangle
    triangles  int32 [blocks * SMALL]: the triangles of those pairs
    below, above  uint64 [blocks * CANDIDATES]: which pairs a plane leaves below and above it
    """

    planes: wp.array(dtype=wp.float32)
    triangles: wp.array(dtype=wp.int32)
    below: wp.array(dtype=wp.uint64)
    above: wp.array(dtype=wp.uint64)


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
    middle_high = wp.vec3f(high[0], high[1], high[2])
    middle_high[axis] = plane
    middle_low = wp.vec3f(low[0], low[1], low[2])
    middle_low[axis] = plane
    of_below = area(low, middle_high) * wp.float32(below)
    of_above = area(middle_low, high) * wp.float32(above)
    cost = traversal + (of_below + of_above) / whole
    if below == 0 or above == 0:
        cost *= EMPTY_SPACE
    return cost


@wp.func
def order_root(
    lane: wp.int32, slot: wp.int32, count: wp.int32, block: wp.int32, refs: Refs, roots: Roots, scratch: Scratch
):  # fmt: skip
    """Put the pairs of a root in the order of their triangles, because the order in which they were listed varies from
    run to run."""
    begin = roots.begin[slot]
    k = wp.int32(lane)
    while k < count:
        at = roots.listed[begin + k]
        i = refs.triangle[at]
        rank = wp.int32(0)
        for other in range(count):
            if refs.triangle[roots.listed[begin + other]] < i:
                rank += 1
        scratch.triangles[block * MOST_SMALL + rank] = i
        low = refs.low[at]
        high = refs.high[at]
        to = block * MOST_CANDIDATES + 6 * rank
        for axis in range(wp.static(3)):
            scratch.planes[to + axis] = low[axis]
            scratch.planes[to + 3 + axis] = high[axis]
        k += wp.block_dim()


@wp.func
def sort_pairs(lane: wp.int32, count: wp.int32, words: wp.int32, scratch: Scratch):
    """Which pairs each candidate plane leaves below and above."""
    k = wp.int32(lane)
    while k < 6 * count:
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
        k += wp.block_dim()


@wp.func
def best_plane(
    lane: wp.int32, words: wp.int32, those: wp.uint64, low: wp.vec3f, high: wp.vec3f, traversal: wp.float32,
    scratch: Scratch,
) -> wp.uint64:  # fmt: skip
    """The candidate of least cost, behind its cost's bits; NO_PLANE where a leaf costs no more. The same for all lanes."""
    number = wp.bit_count(those)
    whole = area(low, high)
    best = NO_PLANE
    if whole > 0.0 and wp.float32(number) > EMPTY_SPACE * traversal:
        rank = wp.int32(lane)
        while rank < 6 * number:
            k = 6 * set_bit(those, rank // 6) + rank % 6
            plane = scratch.planes[words + k]
            axis = k % 3
            if plane > low[axis] and plane < high[axis]:
                below = wp.bit_count(those & scratch.below[words + k])
                above = wp.bit_count(those & scratch.above[words + k])
                cost = split_cost(traversal, low, high, whole, plane, axis, below, above)
                if cost < wp.float32(number):
                    key = (wp.uint64(wp.cast(cost, wp.uint32)) << wp.uint64(32)) | wp.uint64(k)
                    best = wp.min(best, key)
            rank += wp.block_dim()
    return least_of_lanes(best)


@wp.kernel(enable_backward=False)
def small_kernel(
    blocks: wp.int32,
    traversal: wp.float32,
    refs: Refs,
    large: Large,
    roots: Roots,
    scratch: Scratch,
    nodes: wp.array(dtype=wp.vec2i),
    members: wp.array(dtype=wp.int32),
    counters: wp.array(dtype=wp.int32),
):
    """The trees below all small roots; one leaf where more triangles were left than a word has bits."""
    block, lane = wp.tid()
    stack_node = wp.zeros(shape=STACK_ROOM, dtype=wp.int32)
    stack_set = wp.zeros(shape=STACK_ROOM, dtype=wp.uint64)
    stack_depth = wp.zeros(shape=STACK_ROOM, dtype=wp.int32)
    stack_low = wp.zeros(shape=STACK_ROOM, dtype=wp.vec3f)
    stack_high = wp.zeros(shape=STACK_ROOM, dtype=wp.vec3f)
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
    while slot < counters[ROOTS]:
        count = roots.count[slot]
        held = wp.int32(0)
        mine = wp.int32(0)
        if count > MOST_SMALL:
            if lane == 0:
                mine = wp.atomic_add(counters, MEMBERS, count)
                put_leaf(nodes, roots.node[slot], mine, count)
            place = of_first_lane(mine)
            members_used += count
            longest = wp.max(longest, count)
            k = wp.int32(lane)
            while k < count:
                if place + k < room:
                    members[place + k] = refs.triangle[roots.listed[roots.begin[slot] + k]]
                k += wp.block_dim()
        else:
            order_root(lane, slot, count, block, refs, roots, scratch)
            wait_for_others()
            sort_pairs(lane, count, words, scratch)
            wait_for_others()
            stack_node[0] = roots.node[slot]
            stack_set[0] = NO_PLANE >> wp.uint64(64 - count)
            stack_depth[0] = 0
            stack_low[0] = large.low[roots.node[slot]]
            stack_high[0] = large.high[roots.node[slot]]
            held = 1
        while held > 0:
            held -= 1
            node = stack_node[held]
            those = stack_set[held]
            depth = stack_depth[held]
            low = stack_low[held]
            high = stack_high[held]
            best = NO_PLANE
            if depth < DEPTH:
                best = best_plane(lane, words, those, low, high, traversal, scratch)
            if best == NO_PLANE:
                number = wp.bit_count(those)
                if next_member + number > end_member:
                    if lane == 0:
                        mine = wp.atomic_add(counters, MEMBERS, MEMBER_CHUNK)
                    next_member = of_first_lane(mine)
                    end_member = next_member + MEMBER_CHUNK
                place = wp.int32(next_member)
                next_member += number
                members_used += number
                longest = wp.max(longest, number)
                if lane == 0:
                    put_leaf(nodes, node, place, number)
                rank = wp.int32(lane)
                while rank < number:
                    if place + rank < room:
                        members[place + rank] = scratch.triangles[block * MOST_SMALL + set_bit(those, rank)]
                    rank += wp.block_dim()
            else:
                chosen = wp.int32(best & wp.uint64(0xFFFFFFFF))
                plane = scratch.planes[words + chosen]
                axis = chosen % 3
                if next_node == end_node:
                    if lane == 0:
                        mine = wp.atomic_add(counters, NODES, NODE_CHUNK)
                    next_node = of_first_lane(mine)
                    end_node = next_node + NODE_CHUNK
                child = wp.int32(next_node)
                next_node += 2
                nodes_used += 2
                if lane == 0:
                    put_inner(nodes, node, plane, axis, child)
                below_high = wp.vec3f(high[0], high[1], high[2])
                below_high[axis] = plane
                above_low = wp.vec3f(low[0], low[1], low[2])
                above_low[axis] = plane
                stack_node[held] = child + 1
                stack_set[held] = those & scratch.above[words + chosen]
                stack_depth[held] = depth + 1
                stack_low[held] = above_low
                stack_high[held] = high
                held += 1
                stack_node[held] = child
                stack_set[held] = those & scratch.below[words + chosen]
                stack_depth[held] = depth + 1
                stack_low[held] = low
                stack_high[held] = below_high
                held += 1
        wait_for_others()
        slot += blocks
    if lane == 0:
        wp.atomic_add(counters, NODES_USED, nodes_used)
        wp.atomic_add(counters, MEMBERS_USED, members_used)
        wp.atomic_max(counters, LONGEST, longest)


@wp.kernel(enable_backward=False)
def finish_kernel(
    refs: Refs,
    large: Large,
    nodes: wp.array(dtype=wp.vec2i),
    members: wp.array(dtype=wp.int32),
    counters: wp.array(dtype=wp.int32),
    need: wp.array(dtype=wp.int64),
):
    """Write what the frame needed. Where that exceeds the capacity, make a tree without triangles, which rays can
    traverse."""
    need[0] = wp.int64(counters[REFS])
    need[1] = wp.int64(counters[LARGE_NODES])
    need[2] = wp.int64(counters[NODES])
    need[3] = wp.int64(counters[MEMBERS])
    if (
        counters[REFS] > refs.triangle.shape[0]
        or counters[LARGE_NODES] > large.count.shape[0]
        or counters[NODES] > nodes.shape[0]
        or counters[MEMBERS] > members.shape[0]
    ):
        put_leaf(nodes, 0, 0, 0)
