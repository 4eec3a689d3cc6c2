"""Small nodes by the surface area heuristic: Zhou et al. 2008, with sets of at most 64 triangles as bits of a word.

A block of 32 threads takes a small root and builds the tree below it. The faces of the pairs' boxes are its candidate
planes. For each plane the block makes two words once: which pairs belong below and which above. A node is then a word, and
what a plane costs in it follows from the words' bits. (Zhou et al. go on breadth first; the tree is the same. A block can
stay with its root since nodes are numbered as they come.)

On a CPU a block is one thread.
"""

from __future__ import annotations

import warp as wp

from .nodes import (
    LARGE_NODES,
    MEMBERS,
    NODES,
    REFS,
    ROOTS,
    Large,
    Refs,
    Roots,
    goes_above,
    goes_below,
    put_inner,
    put_leaf,
)
from .parameters import SMALL, SMALL_DEPTH

WIDTH = 32
"""Threads of a block."""

CANDIDATES = 6 * SMALL
MOST_CANDIDATES = wp.constant(CANDIDATES)
MOST_SMALL = wp.constant(SMALL)
DEPTH = wp.constant(SMALL_DEPTH)
STACK_ROOM = wp.constant(SMALL_DEPTH + 1)
NO_PLANE = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))
EMPTY_SPACE = wp.constant(wp.float32(0.8))
"""A plane that cuts off empty space costs this share of what it would: the ray that leaves there is done with the node."""


@wp.struct
class Scratch:
    """Room of each block.

    order  int32 [blocks * SMALL]: the root's pairs, by triangle
    below, above  uint64 [blocks * CANDIDATES]: which pairs a plane leaves below and above it
    """

    order: wp.array(dtype=wp.int32)
    below: wp.array(dtype=wp.uint64)
    above: wp.array(dtype=wp.uint64)


@wp.func
def bit(k: wp.int32) -> wp.uint64:
    return wp.uint64(1) << wp.uint64(k)


@wp.func
def area(low: wp.vec3f, high: wp.vec3f) -> wp.float32:
    """Half the surface of a box."""
    s = high - low
    return s[0] * s[1] + s[1] * s[2] + s[2] * s[0]


@wp.func
def plane_of(refs: Refs, scratch: Scratch, base: wp.int32, candidate: wp.int32) -> wp.float32:
    """Candidate 6 k + axis is the low face of pair k, 6 k + 3 + axis its high face."""
    at = scratch.order[base + candidate // 6]
    side = candidate % 6
    if side < 3:
        return refs.low[at][side]
    return refs.high[at][side - 3]


@wp.func
def split_cost(
    traversal: wp.float32, low: wp.vec3f, high: wp.vec3f, plane: wp.float32, axis: wp.int32, below: wp.int32, above: wp.int32
) -> wp.float32:  # fmt: skip
    """What a ray through the node is expected to cost, in triangle tests."""
    middle_high = wp.vec3f(high[0], high[1], high[2])
    middle_high[axis] = plane
    middle_low = wp.vec3f(low[0], low[1], low[2])
    middle_low[axis] = plane
    of_below = area(low, middle_high) * wp.float32(below)
    of_above = area(middle_low, high) * wp.float32(above)
    cost = traversal + (of_below + of_above) / area(low, high)
    if below == 0 or above == 0:
        cost *= EMPTY_SPACE
    return cost


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
    block, lane = wp.tid()
    stack_node = wp.zeros(shape=STACK_ROOM, dtype=wp.int32)
    stack_set = wp.zeros(shape=STACK_ROOM, dtype=wp.uint64)
    stack_depth = wp.zeros(shape=STACK_ROOM, dtype=wp.int32)
    stack_low = wp.zeros(shape=STACK_ROOM, dtype=wp.vec3f)
    stack_high = wp.zeros(shape=STACK_ROOM, dtype=wp.vec3f)
    room = members.shape[0]
    base = block * MOST_SMALL
    words = block * MOST_CANDIDATES
    slot = wp.int32(block)
    while slot < counters[ROOTS]:
        begin = roots.begin[slot]
        count = roots.count[slot]
        held = wp.int32(0)
        if count > MOST_SMALL:
            # What could not be divided: one leaf, however many it holds.
            mine = wp.int32(0)
            if lane == 0:
                mine = wp.atomic_add(counters, MEMBERS, count)
                put_leaf(nodes, roots.node[slot], mine, count)
            place = wp.tile_sum(wp.tile(mine))[0]
            k = wp.int32(lane)
            while k < count:
                if place + k < room:
                    members[place + k] = refs.triangle[roots.listed[begin + k]]
                k += wp.block_dim()
        else:
            # In the order of their triangles: the order in which they were listed is chance.
            k = wp.int32(lane)
            while k < count:
                at = roots.listed[begin + k]
                i = refs.triangle[at]
                rank = wp.int32(0)
                for other in range(count):
                    if refs.triangle[roots.listed[begin + other]] < i:
                        rank += 1
                scratch.order[base + rank] = at
                k += wp.block_dim()
            together = wp.tile_sum(wp.tile(lane))[0]  # what other lanes have written can be read
            k = wp.int32(lane)
            while k < 6 * count:
                plane = plane_of(refs, scratch, base, k)
                axis = k % 3
                below = wp.uint64(0)
                above = wp.uint64(0)
                for other in range(count):
                    at = scratch.order[base + other]
                    low_side = refs.low[at][axis]
                    high_side = refs.high[at][axis]
                    if goes_below(low_side, high_side, plane):
                        below = below | bit(other)
                    if goes_above(low_side, high_side, plane):
                        above = above | bit(other)
                scratch.below[words + k] = below
                scratch.above[words + k] = above
                k += wp.block_dim()
            together += wp.tile_sum(wp.tile(lane))[0]
            stack_node[0] = roots.node[slot]
            all_of = NO_PLANE
            if count < 64:
                all_of = bit(count) - wp.uint64(1)
            stack_set[0] = all_of
            stack_depth[0] = 0
            stack_low[0] = large.low[roots.node[slot]]
            stack_high[0] = large.high[roots.node[slot]]
            held = wp.where(together >= 0, 1, 0)
        while held > 0:
            held -= 1
            node = stack_node[held]
            those = stack_set[held]
            depth = stack_depth[held]
            low = stack_low[held]
            high = stack_high[held]
            number = wp.bit_count(those)
            best = NO_PLANE
            if depth < DEPTH and number > 0 and area(low, high) > 0.0:
                k = wp.int32(lane)
                while k < 6 * count:
                    if (those & bit(k // 6)) != wp.uint64(0):
                        plane = plane_of(refs, scratch, base, k)
                        axis = k % 3
                        if plane > low[axis] and plane < high[axis]:
                            below_number = wp.bit_count(those & scratch.below[words + k])
                            above_number = wp.bit_count(those & scratch.above[words + k])
                            cost = split_cost(traversal, low, high, plane, axis, below_number, above_number)
                            if cost < wp.float32(number):
                                key = (wp.uint64(wp.cast(cost, wp.uint32)) << wp.uint64(32)) | wp.uint64(k)
                                best = wp.min(best, key)
                    k += wp.block_dim()
            best = wp.tile_min(wp.tile(best))[0]
            mine = wp.int32(0)
            if best == NO_PLANE:
                if lane == 0:
                    mine = wp.atomic_add(counters, MEMBERS, number)
                    put_leaf(nodes, node, mine, number)
                place = wp.tile_sum(wp.tile(mine))[0]
                k = wp.int32(lane)
                while k < count:
                    if (those & bit(k)) != wp.uint64(0):
                        to = place + wp.bit_count(those & (bit(k) - wp.uint64(1)))
                        if to < room:
                            members[to] = refs.triangle[scratch.order[base + k]]
                    k += wp.block_dim()
            else:
                chosen = wp.int32(best & wp.uint64(0xFFFFFFFF))
                plane = plane_of(refs, scratch, base, chosen)
                axis = chosen % 3
                if lane == 0:
                    mine = wp.atomic_add(counters, NODES, 2)
                    put_inner(nodes, node, plane, axis, mine)
                child = wp.tile_sum(wp.tile(mine))[0]
                cut_high = wp.vec3f(high[0], high[1], high[2])
                cut_high[axis] = plane
                cut_low = wp.vec3f(low[0], low[1], low[2])
                cut_low[axis] = plane
                stack_node[held] = child + 1
                stack_set[held] = those & scratch.above[words + chosen]
                stack_depth[held] = depth + 1
                stack_low[held] = cut_low
                stack_high[held] = high
                held += 1
                stack_node[held] = child
                stack_set[held] = those & scratch.below[words + chosen]
                stack_depth[held] = depth + 1
                stack_low[held] = low
                stack_high[held] = cut_high
                held += 1
        slot += blocks


@wp.kernel(enable_backward=False)
def finish_kernel(
    refs: Refs,
    large: Large,
    nodes: wp.array(dtype=wp.vec2i),
    members: wp.array(dtype=wp.int32),
    counters: wp.array(dtype=wp.int32),
    need: wp.array(dtype=wp.int64),
):
    """What the frame needed; where it was more than there is, a tree without triangles, which rays can walk."""
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
