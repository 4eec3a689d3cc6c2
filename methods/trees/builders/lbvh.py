"""The radix tree of the keys, built in one pass from the leaves up (Apetrei 2014; Karras 2012; Lauterbach et al. 2009).

One thread per leaf; those of a block meet in shared memory first (:mod:`.climb`). A node has the number of its flag
(:mod:`.climb`), so two builds of the same frame make the same tree.
"""

import functools
from typing import Any

from .climb import EXCHANGED, NEAR, make_builder

START = """
if (i >= count) return;
float box[6];
unsigned int ref = box_of(i, box), before = gap(i - 1), after = gap(i);
int l = i, r = i;
auto is_whole = [&]() { return before == NONE && after == NONE; };
auto end_of = [&](bool left) { return left ? far_end(l, before) : far_end(r, after); };
auto join_sibling = [&](bool left, const float* sibling_box, unsigned int sibling, Flag end) {
    int parent = left ? r : l - 1;
    put_node((float*)tree.nodes.data, parent, pad, !left, box, ref, sibling_box, sibling);
    join(box, sibling_box);
    ref = (unsigned int)parent;
    if (left) r = (int)(unsigned int)end, after = (unsigned int)(end >> 32);
    else l = (int)(unsigned int)end, before = (unsigned int)(end >> 32);
};
"""

CLIMB_NEAR = """
__shared__ unsigned int near_ref[2][BLOCK];
__shared__ Flag near_end[2][BLOCK];
int waits = -1;
while (waits < 0 && !is_whole()) {
    bool left = is_left(l, r, before, after);
    int parent = left ? r : l - 1, side = !left, at = parent - begin;
    if (!is_near(parent)) break;
    put_near_box(parent, side, box);
    near_ref[side][at] = ref;
    near_end[side][at] = end_of(left);
    if (is_first(parent)) {
        waits = at;
    } else {
        float sibling_box[6];
        take_near_box(parent, !side, sibling_box);
        join_sibling(left, sibling_box, near_ref[!side][at], near_end[!side][at]);
    }
}
__syncthreads();
if (waits >= 0 && arrived[waits] == 2) return;
"""

CLIMB_ON = """
while (!is_whole()) {
    bool left = is_left(l, r, before, after);
    int parent = left ? r : l - 1, side = left ? 0 : 2;
    Flag end = peek(parent);
    if (end == EMPTY) {
        put_box(4 * parent + side, box, ref);
        end = exchange(parent, end_of(left));
        if (end == EMPTY) return;
    }
    float sibling_box[6];
    unsigned int sibling = take_box(4 * parent + 2 - side, sibling_box);
    join_sibling(left, sibling_box, sibling, end);
}
tree.root.data[0] = (int)ref;
"""


@functools.cache
def make_lbvh_kernel() -> Any:
    """One thread per leaf in key order, in blocks of :data:`..constants.BLOCK` threads on a GPU."""
    near = f"\n#if defined(__CUDA_ARCH__)\n{NEAR}{CLIMB_NEAR}\n#endif\n"
    return make_builder(EXCHANGED + START + near + CLIMB_ON)
