"""Arrays of the tree and of its build, and how a node is packed into eight bytes."""

import enum

import warp as wp

SMALL = 64
"""Most triangles of a small node: a set of them has 64 bits."""

SMALL_DEPTH = 16
"""Most levels of the tree within a small node."""

LARGE_DEPTH = 40
"""Most levels of large nodes. Together with those of small nodes they must not exceed 64, because a ray keeps one bit per
level.
"""

LEAF = wp.constant(3)
"""Lowest bits of a leaf's second word; of an inner node, they are the axis of its plane."""

SETTLED = wp.constant(-1)
"""Depth of a node that is not visited again."""


class Count(enum.IntEnum):
    """Places in ``Work.counters``."""

    REFS = 0  # pairs
    NODES = 1
    MEMBERS = 2  # of leaves
    ROOTS = 3
    LISTED = 4  # pairs in roots
    LEVEL_BEGIN = 5  # the level's first node
    LEVEL_END = 6  # and the first beyond it
    REFS_END = 7  # pairs at the level's start
    LARGE_NODES = 8  # nodes when the large ones are done
    NODES_USED = 9  # of those reserved for small nodes
    MEMBERS_USED = 10  # likewise
    LONGEST = 11  # list of a leaf


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

    low, high  vec3f: the node's region       tight   int32 [6 * nodes]: box of its pairs' boxes (:func:`.large.ordered`)
    count  int32: its pairs                   parent  int32: pairs of its parent
    depth  int32: level, or SETTLED           growth  float32: how often its ancestors' divisions multiplied their pairs
    target int32: the node whose plane divides its pairs, or -1 - the root that they are in
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
class Scratch:
    """Memory of each block that builds small nodes.

    planes  float32 [blocks * CANDIDATES]: the faces of the root's pairs, low x y z and high x y z of each; by triangle
    triangles  int32 [blocks * SMALL]: the triangles of those pairs
    below, above  uint64 [blocks * CANDIDATES]: which pairs a plane leaves below and above it
    """

    planes: wp.array(dtype=wp.float32)
    triangles: wp.array(dtype=wp.int32)
    below: wp.array(dtype=wp.uint64)
    above: wp.array(dtype=wp.uint64)


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


@wp.struct
class Work:
    """All arrays of the build.

    counters  int32, by :class:`Count`    going  int32 [1]: whether there is a level to divide
    need      int64 [4]: what the frame needed of pairs, large nodes, nodes and members
    """

    refs: Refs
    large: Large
    roots: Roots
    scratch: Scratch
    tree: Tree
    counters: wp.array(dtype=wp.int32)
    going: wp.array(dtype=wp.int32)
    need: wp.array(dtype=wp.int64)


@wp.func
def bit(k: wp.int32) -> wp.uint64:
    return wp.uint64(1) << wp.uint64(k)


@wp.func
def with_coordinate(v: wp.vec3f, axis: wp.int32, x: wp.float32) -> wp.vec3f:
    """v with another coordinate along an axis."""
    moved = wp.vec3f(v[0], v[1], v[2])
    moved[axis] = x
    return moved


@wp.func
def put_leaf(tree: Tree, node: wp.int32, begin: wp.int32, count: wp.int32):
    if node < tree.nodes.shape[0]:
        tree.nodes[node] = wp.vec2i(begin, LEAF | (count << 2))


@wp.func
def put_inner(tree: Tree, node: wp.int32, plane: wp.float32, axis: wp.int32, child: wp.int32):
    if node < tree.nodes.shape[0]:
        tree.nodes[node] = wp.vec2i(wp.cast(plane, wp.int32), axis | (child << 2))


@wp.func
def goes_below(low: wp.float32, high: wp.float32, plane: wp.float32) -> wp.bool:
    """Whether a pair with this interval belongs below the plane; one that only touches the plane belongs to one side."""
    return low < plane or high <= plane


@wp.func
def goes_above(low: wp.float32, high: wp.float32, plane: wp.float32) -> wp.bool:
    return high > plane
