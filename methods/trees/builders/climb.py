"""Climbing a radix tree of sorted keys from its leaves without building it first (Apetrei 2014, section 3).

A node is a range of leaves [l, r]. Its parent joins it to the range on that side where the keys differ less, judged by
the difference of the keys at both ends; equal differences are distinguished by the positions themselves, as if each key
were extended by the bits of its position (Karras 2012, section 4). So a tree of keys of b bits and up to 2^24 triangles
is at most b + 24 deep, also where all keys are equal.

The parent of a left child [l, r] and of the right child [r + 1, s] has the flag r. The first thread to arrive stores the
far end of its range and the difference there, and stops; the second thread to arrive continues with both. The tree ends
after the last leaf: what has none was left out by the sort (:mod:`.keys`).

On the GPU an exchange of a flag releases what was written before it, and acquires what the first arrival wrote.
"""

from typing import Any

import warp as wp

from ....harness.frame.geometry import Mesh
from ...gpu.entries import entry
from ..native import BASICS
from ..nodes import WRITE, Tree, padding
from .boxes import BOXES
from .sort import Pairs

CLIMB = """
typedef unsigned long long Flag;
const Flag EMPTY = ~0ull;
auto gap = [&](int k) {
    if (k < 0 || k + 1 >= count) return NONE;
    return (unsigned int)(leaves.pairs.keys.data[k] ^ leaves.pairs.keys.data[k + 1]);
};
auto is_left = [&](int l, int r, unsigned int before, unsigned int after) {
    if (before == NONE || after == NONE) return before == NONE;
    return before != after ? after < before : (unsigned int)(r ^ (r + 1)) < (unsigned int)((l - 1) ^ l);
};
auto far_end = [&](int end, unsigned int difference) { return ((Flag)difference << 32) | (unsigned int)end; };
#if defined(__CUDA_ARCH__)
auto exchange = [&](int k, Flag value) {
    Flag before;
    asm volatile("atom.acq_rel.gpu.global.exch.b64 %0, [%1], %2;"
                 : "=l"(before) : "l"((Flag*)flags.data + k), "l"(value) : "memory");
    return before;
};
auto peek = [&](int k) {
    Flag value;
    asm volatile("ld.acquire.gpu.global.u64 %0, [%1];" : "=l"(value) : "l"((Flag*)flags.data + k) : "memory");
    return value;
};
#else
auto exchange = [&](int k, Flag value) {
    Flag before = flags.data[k];
    flags.data[k] = value;
    return before;
};
auto peek = [&](int k) { return (Flag)flags.data[k]; };
#endif
auto box_of = [&](int k, float* box) {
    unsigned int ref = LEAF | (unsigned int)leaves.pairs.values.data[k];
    clear(box);
    int at = (int)(ref & INDEX), stop = at + (ref & PAIR ? 2 : 1);
    for (; at < stop; at++) {
        float own[6];
        box_of_triangle(at, own);
        join(box, own);
    }
    return ref;
};
"""


@wp.struct
class Leaves:
    """The sorted leaves: count int32 [1]; pairs: their Morton keys, and references without the bit of a leaf."""

    count: wp.array(dtype=wp.int32)
    pairs: Pairs


def make_builder(text: str) -> Any:
    """The kernel of a builder: the thread of leaf i in key order runs :data:`CLIMB` and ``text``."""

    @wp.func_native(BASICS + BOXES + CLIMB + "constexpr bool SOME_EMPTY = false;" + WRITE + text)
    def build(
        i: wp.int32,
        count: wp.int32,
        pad: wp.float32,
        leaves: Leaves,
        mesh: Mesh,
        scratch: wp.array(dtype=wp.vec4f),
        flags: wp.array(dtype=wp.uint64),
        tree: Tree,
    ): ...

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def build_kernel(
        leaves: Leaves, mesh: Mesh, scratch: wp.array(dtype=wp.vec4f), flags: wp.array(dtype=wp.uint64), tree: Tree
    ):
        pad = padding(entry(tree.max_coordinate, 0))
        build(wp.tid(), entry(leaves.count, 0), pad, leaves, mesh, scratch, flags, tree)

    return build_kernel
