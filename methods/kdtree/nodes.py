"""Arrays of the tree and of its build, and how a node is packed into eight bytes."""

import warp as wp

SMALL = 64
"""Most triangles of a small node: a set of them has 64 bits."""

SMALL_DEPTH = 16
"""Most levels of the tree within a small node."""

LARGE_DEPTH = 40
"""Most levels of large nodes. Together with those of small nodes they must not exceed 64, because a ray keeps one bit per
level."""

LEAF = wp.constant(3)
"""Lowest bit of the axis of an inner node."""

REFS = wp.constant(0)
NODES = wp.constant(1)
MEMBERS = wp.constant(2)
ROOTS = wp.constant(3)
LISTED = wp.constant(4)
LEVEL_BEGIN = wp.constant(5)
LEVEL_END = wp.constant(6)
REFS_END = wp.constant(7)
LARGE_NODES = wp.constant(8)
NODES_USED = wp.constant(9)
MEMBERS_USED = wp.constant(10)
LONGEST = wp.constant(11)
COUNTERS = 12
"""Indices of the counters: pairs, nodes, members of leaves, small roots, pairs in small roots; the level's first node,
the first beyond it, and the number of pairs at its start; nodes when the large ones are done; how many of the nodes and
members that are reserved for small nodes they use; the longest list of a leaf."""

SETTLED = wp.constant(-1)
"""Depth of a node that is not visited again."""


@wp.struct
class Refs:
    """(triangle, node) pairs. A triangle is once in each node that its box meets; the box is cut to that node.

    triangle, node  int32 [capacity]: node is -1 where a pair has gone      low, high  vec3f [capacity]
    """

    triangle: wp.array(dtype=wp.int32)
    node: wp.array(dtype=wp.int32)
    low: wp.array(dtype=wp.vec3f)
    high: wp.array(dtype=wp.vec3f)


@wp.struct
class Large:
    """Large nodes, arrays [large capacity] by node.

    low, high  vec3f: the node's region       tight   int32 [6 * nodes]: box of its pairs' boxes (:func:`ordered`)
    count  int32: its pairs                   parent  int32: pairs of its parent
    depth  int32: level, or SETTLED           growth  float32: how often its ancestors' divisions multiplied their pairs
    target int32: the node whose plane divides its pairs, or -1 - the small root that they are in
    """

    low: wp.array(dtype=wp.vec3f)
    high: wp.array(dtype=wp.vec3f)
    tight: wp.array(dtype=wp.int32)
    count: wp.array(dtype=wp.int32)
    parent: wp.array(dtype=wp.int32)
    depth: wp.array(dtype=wp.int32)
    growth: wp.array(dtype=wp.float32)
    target: wp.array(dtype=wp.int32)


@wp.struct
class Roots:
    """Nodes where the division of large nodes ends, arrays [large capacity].

    node    int32: which node             begin, count  int32: its pairs are listed[begin : begin + count]
    cursor  int32: pairs listed so far    listed        int32 [pair capacity]
    """

    node: wp.array(dtype=wp.int32)
    begin: wp.array(dtype=wp.int32)
    count: wp.array(dtype=wp.int32)
    cursor: wp.array(dtype=wp.int32)
    listed: wp.array(dtype=wp.int32)


@wp.struct
class Tree:
    """The arrays that rays read. A node's children follow one another, the one below the plane first.

    nodes    vec2i [node capacity]: (plane's bits, axis | first child * 4), or (first member, LEAF | members * 4)
    members  int32 [member capacity]: triangles of leaves
    box      float32 [6]: the scene's box (:func:`..common.bounds.launch_bounds`)
    """

    nodes: wp.array(dtype=wp.vec2i)
    members: wp.array(dtype=wp.int32)
    box: wp.array(dtype=wp.float32)


@wp.func
def bit(k: wp.int32) -> wp.uint64:
    return wp.uint64(1) << wp.uint64(k)


@wp.func
def ordered(x: wp.float32) -> wp.int32:
    """An integer in the order of x, for atomics."""
    bits = wp.cast(x, wp.int32)
    return wp.where(bits < 0, bits ^ 0x7FFFFFFF, bits)


@wp.func
def unordered(key: wp.int32) -> wp.float32:
    return wp.cast(wp.where(key < 0, key ^ 0x7FFFFFFF, key), wp.float32)


@wp.func
def put_leaf(nodes: wp.array(dtype=wp.vec2i), node: wp.int32, begin: wp.int32, count: wp.int32):
    if node < nodes.shape[0]:
        nodes[node] = wp.vec2i(begin, LEAF | (count << 2))


@wp.func
def put_inner(nodes: wp.array(dtype=wp.vec2i), node: wp.int32, plane: wp.float32, axis: wp.int32, child: wp.int32):
    if node < nodes.shape[0]:
        nodes[node] = wp.vec2i(wp.cast(plane, wp.int32), axis | (child << 2))


@wp.func
def goes_below(low: wp.float32, high: wp.float32, plane: wp.float32) -> wp.bool:
    """Whether a pair with this interval belongs below the plane; a pair that only touches the plane belongs to one
    side."""
    return low < plane or high <= plane


@wp.func
def goes_above(low: wp.float32, high: wp.float32, plane: wp.float32) -> wp.bool:
    return high > plane
