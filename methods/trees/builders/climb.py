"""Climbing a radix tree of sorted keys from its leaves without building it first (Apetrei 2014, section 3).

A node is a range of leaves [l, r]. Its parent joins it to the range on that side where the keys differ less, judged by
the difference of the keys at both ends; equal differences are distinguished by the positions themselves, as if each key
were extended by the bits of its position (Karras 2012, section 4). So a tree of keys of b bits and up to 2^24 triangles
is at most b + 24 deep, also where all keys are equal.

The parent of a left child [l, r] and of the right child [r + 1, s] has the flag r. The first thread to arrive stores the
far end of its range and the difference there, and stops; the second thread to arrive continues with both. The tree ends
after the last leaf: what has none was left out by the sort (:mod:`.keys`).

On the GPU an exchange of a flag releases what was written before it, and acquires what the first arrival wrote. The leaves
of a block lie side by side, and most nodes above them have leaves of that block only. Threads that climb through those
meet in shared memory: an exchange takes a tenth of the time that one in global memory takes, and the time of a build is that
of one exchange after another. A node is numbered by the last leaf of its left child.
"""

from typing import Any

import warp as wp

from ....harness.frame.geometry import Mesh
from ...gpu.entries import entry
from ..constants import BLOCK
from ..native import BASICS
from ..nodes import WRITE, Tree, padding
from .sort import Pairs

BOXES = """
auto clear = [&](float* box) { for (int k = 0; k < 6; k++) box[k] = k < 3 ? 3.4e38f : -3.4e38f; };
auto join = [&](float* box, const float* other) {
    for (int axis = 0; axis < 3; axis++) {
        box[axis] = low(box[axis], other[axis]);
        box[axis + 3] = high(box[axis + 3], other[axis + 3]);
    }
};
auto box_of_triangle = [&](int at, float* box) {
    wp::vec3i face = mesh.triangles.data[at];
    const float* a = (const float*)(mesh.points.data + face[0]);
    const float* b = (const float*)(mesh.points.data + face[1]);
    const float* c = (const float*)(mesh.points.data + face[2]);
    for (int axis = 0; axis < 3; axis++) {
        box[axis] = low(a[axis], low(b[axis], c[axis]));
        box[axis + 3] = high(a[axis], high(b[axis], c[axis]));
    }
};
"""
"""Boxes of triangles, low then high corner."""

EXCHANGED = """
#if defined(__CUDA_ARCH__)
auto put_box = [&](int k, const float* b, unsigned int ref) {
    float4* at = reinterpret_cast<float4*>(scratch.data) + k;
    __stcg(at, make_float4(b[0], b[1], b[2], real(ref)));
    __stcg(at + 1, make_float4(b[3], b[4], b[5], 0.0f));
};
auto take_box = [&](int k, float* b) {
    const float4* at = reinterpret_cast<const float4*>(scratch.data) + k;
    float4 one = __ldcg(at), two = __ldcg(at + 1);
    b[0] = one.x, b[1] = one.y, b[2] = one.z, b[3] = two.x, b[4] = two.y, b[5] = two.z;
    return bits(one.w);
};
#else
auto put_box = [&](int k, const float* b, unsigned int ref) {
    store16(scratch.data, k, b[0], b[1], b[2], real(ref));
    store16(scratch.data, k + 1, b[3], b[4], b[5], 0.0f);
};
auto take_box = [&](int k, float* b) {
    Quad one = load16(scratch.data, k), two = load16(scratch.data, k + 1);
    b[0] = one.x, b[1] = one.y, b[2] = one.z, b[3] = two.x, b[4] = two.y, b[5] = two.z;
    return bits(one.w);
};
#endif
"""
"""``put_box`` and ``take_box``: boxes for a sibling, with a reference, written past the first-level cache, which other
multiprocessors do not see.
"""

NEAR = (
    f"constexpr int BLOCK = {BLOCK};"
    + """
__shared__ float near_box[12][BLOCK];
__shared__ int arrived[BLOCK];
const int begin = i - (int)threadIdx.x;
arrived[threadIdx.x] = 0;
__syncthreads();
auto is_near = [&](int node) { return node >= begin && node < begin + BLOCK - 1; };
auto put_near_box = [&](int node, int side, const float* b) {
    for (int k = 0; k < 6; k++) near_box[6 * side + k][node - begin] = b[k];
};
auto take_near_box = [&](int node, int side, float* b) {
    for (int k = 0; k < 6; k++) b[k] = near_box[6 * side + k][node - begin];
};
auto is_first = [&](int node) {
    __threadfence_block();
    bool first = atomicAdd(arrived + node - begin, 1) == 0;
    __threadfence_block();
    return first;
};
"""
)
"""``is_near``: whether leaves of this block lie on both sides of a node's split. ``is_first``: of the two threads that come
to a near node; the other takes what the first has put. Those that stay the first after all threads of the block have
climbed wait for a child with leaves of another block.
"""

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

    count: wp.array[wp.int32]
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
        scratch: wp.array[wp.vec4f],
        flags: wp.array[wp.uint64],
        tree: Tree,
    ): ...

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def build_kernel(leaves: Leaves, mesh: Mesh, scratch: wp.array[wp.vec4f], flags: wp.array[wp.uint64], tree: Tree):
        pad = padding(entry(tree.max_coordinate, 0))
        build(wp.tid(), entry(leaves.count, 0), pad, leaves, mesh, scratch, flags, tree)

    return build_kernel
