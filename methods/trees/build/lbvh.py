"""The radix tree of the keys, built in one pass from the leaves up (Apetrei 2014; Karras 2012; Lauterbach et al. 2009).

One thread per leaf. A node has the number of its flag (:mod:`.climb`), so two builds of the same frame make the same
tree.
"""

from __future__ import annotations

import functools
from typing import Any

from .climb import make_builder

BUILD = """
if (i >= count) return;
float box[6];
unsigned int ref = box_of(i, box), before = gap(i - 1), after = gap(i);
int l = i, r = i;
while (before != NONE || after != NONE) {
    bool left = is_left(l, r, before, after);
    int parent = left ? r : l - 1, side = left ? 0 : 2;
    Flag other = peek(parent);
    if (other == EMPTY) {
        put_box(4 * parent + side, box, ref);
        other = exchange(parent, left ? far_end(l, before) : far_end(r, after));
        if (other == EMPTY) return;
    }
    float beside[6];
    unsigned int sibling = take_box(4 * parent + 2 - side, beside);
    if (left) put_node((float*)nodes.data, parent, pad, box, ref, beside, sibling);
    else put_node((float*)nodes.data, parent, pad, beside, sibling, box, ref);
    for (int axis = 0; axis < 3; axis++) {
        box[axis] = low(box[axis], beside[axis]);
        box[axis + 3] = high(box[axis + 3], beside[axis + 3]);
    }
    ref = (unsigned int)parent;
    if (left) r = (int)(unsigned int)other, after = (unsigned int)(other >> 32);
    else l = (int)(unsigned int)other, before = (unsigned int)(other >> 32);
}
root.data[0] = (int)ref;
"""

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
    keep(scratch.data, k, b[0], b[1], b[2], real(ref));
    keep(scratch.data, k + 1, b[3], b[4], b[5], 0.0f);
};
auto take_box = [&](int k, float* b) {
    Quad one = fetch(scratch.data, k), two = fetch(scratch.data, k + 1);
    b[0] = one.x, b[1] = one.y, b[2] = one.z, b[3] = two.x, b[4] = two.y, b[5] = two.z;
    return bits(one.w);
};
#endif
"""
"""Boxes for a sibling, written past the first-level cache, which other multiprocessors do not see."""


@functools.cache
def make_lbvh_kernel(node_bytes: int) -> Any:
    """One thread per leaf in key order, in blocks of any size."""
    return make_builder(node_bytes, EXCHANGED + BUILD)
