"""The leaves of a rebuilt tree with their Morton keys.

Exporters write the two triangles of a quad, and generators those of a strip, one after the other. Two of them share a leaf
where the box of both is hardly larger than one of theirs: the sort and the tree then have half as many leaves, and a ray
does a step less before it tests them. Whether they do is decided anew in each frame, from their boxes.

A key interleaves the bits of the middle of a leaf's box, on a cube as large as the scene's longest side (Lauterbach
et al. 2009). A triangle that is never hit (without area, or with a coordinate that is not a number) has no leaf, nor has
the second of two that share one: they get the largest key, which no leaf has, and the sort leaves them out.
"""

import warp as wp

from ....harness.frame.geometry import Mesh, value_struct
from ...common.bounds import box_high, box_low
from ...gpu.entries import entry, set_entry
from .. import constants
from ..native import BASICS, PAIR
from ..nodes import Tree
from .sort import Pairs, count_digits, passes_of

EMPTY = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))
"""A flag at which neither child has arrived."""

PAIRED = wp.constant(PAIR)
CELLS = wp.constant(1 << constants.KEY_BITS // 3)
"""Cells along the longest side of the scene."""

NO_LEAF = wp.constant((1 << constants.KEY_BITS) - 1)
"""The key of a triangle without a leaf of its own."""

PASSES = wp.constant(passes_of(constants.KEY_BITS))


@wp.func
def spread(x: wp.int32) -> wp.int32:
    """Ten bits, two zeros after each."""
    x = (x | (x << 16)) & 0x030000FF
    x = (x | (x << 8)) & 0x0300F00F
    x = (x | (x << 4)) & 0x030C30C3
    return (x | (x << 2)) & 0x09249249


@wp.func
def cell(x: wp.float32, low: wp.float32, scale: wp.float32, last: wp.float32) -> wp.int32:
    """The cell of x, clamped to 0..last."""
    return wp.int32(wp.min(wp.max((x - low) * scale, 0.0), last))


@value_struct
class Box:
    """Low and high corner."""

    low: wp.vec3f
    high: wp.vec3f


@wp.func
def box_at(mesh: Mesh, triangle: wp.int32) -> Box:
    """Of a triangle."""
    face = entry(mesh.triangles, triangle)
    a = entry(mesh.points, face[0])
    b = entry(mesh.points, face[1])
    c = entry(mesh.points, face[2])
    return Box(wp.min(a, wp.min(b, c)), wp.max(a, wp.max(b, c)))


@wp.func_native(
    BASICS
    + """
auto area = [&](const wp::vec3f& l, const wp::vec3f& h) {
    float x = sum(h[0], -l[0]), y = sum(h[1], -l[1]), z = sum(h[2], -l[2]);
    return sum(sum(product(x, y), product(y, z)), product(z, x));
};
wp::vec3f l(low(p[0], r[0]), low(p[1], r[1]), low(p[2], r[2])), h(high(q[0], s[0]), high(q[1], s[1]), high(q[2], s[2]));
return area(l, h) <= product(most, sum(area(p, q), area(r, s)));
"""
)
def share_a_leaf(p: wp.vec3f, q: wp.vec3f, r: wp.vec3f, s: wp.vec3f, most: wp.float32) -> wp.bool:
    """Whether the area of the common box of (p, q) and (r, s) is at most ``most`` times the sum of theirs."""


@wp.func
def key_of(of: Box, used: wp.bool, box: wp.array[wp.float32]) -> wp.int32:
    """Of the middle of a leaf's box; the largest one if there is no leaf."""
    if not used:
        return NO_LEAF
    low = box_low(box)
    size = wp.max(box_high(box) - low)
    cells = wp.float32(CELLS)
    scale = wp.float32(0.0)
    # In a scene too large or too small for this all keys are equal: the tree is correct, but slow to traverse.
    if size > 1.0e-30 and size < 1.0e30:
        scale = cells / size
    # Halves first: a sum may overflow.
    middle = 0.5 * of.low + 0.5 * of.high
    x = cell(middle[0], low[0], scale, cells - 1.0)
    y = cell(middle[1], low[1], scale, cells - 1.0)
    z = cell(middle[2], low[2], scale, cells - 1.0)
    return wp.min((spread(x) << 2) | (spread(y) << 1) | spread(z), NO_LEAF - 1)


@wp.kernel(enable_backward=False, grid_stride=False)
def key_kernel(
    mesh: Mesh,
    count: wp.int32,
    shared_area: wp.float32,
    box: wp.array[wp.float32],
    leaves: Pairs,
    flags: wp.array[wp.uint64],
    tree: Tree,
    state: wp.array[wp.int32],
):
    """One thread for two triangles that follow each other: their keys and references, of one leaf or of two. Counts the
    keys' digits for the sort, and empties the flags and the tree. Whole blocks.
    """
    i = 2 * wp.tid()
    key = NO_LEAF
    other_key = NO_LEAF
    if i < count:
        if i == 0:
            tree.root[0] = -1
        flags[i] = EMPTY
        first = box_at(mesh, i)
        used = entry(mesh.valid, i) != wp.uint8(0)
        followed = i + 1 < count
        second = first
        if followed:
            flags[i + 1] = EMPTY
            second = box_at(mesh, i + 1)
        other_used = followed and entry(mesh.valid, wp.min(i + 1, count - 1)) != wp.uint8(0)
        value = i
        if used and other_used and share_a_leaf(first.low, first.high, second.low, second.high, shared_area):
            first = Box(wp.min(first.low, second.low), wp.max(first.high, second.high))
            value = i | PAIRED
            other_used = False
        key = key_of(first, used, box)
        set_entry(leaves.keys, i, key)
        set_entry(leaves.values, i, value)
        if followed:
            other_key = key_of(second, other_used, box)
            set_entry(leaves.keys, i + 1, other_key)
            set_entry(leaves.values, i + 1, i + 1)
    count_digits(key, other_key, NO_LEAF, PASSES, state)
