"""The radix tree of the keys, built in one pass from the leaves up (Apetrei 2014; Karras 2012; Lauterbach et al. 2009).

One thread per leaf. A node has the number of its flag (:mod:`.climb`), so two builds of the same frame make the same
tree.
"""

from __future__ import annotations

import functools
from typing import Any

from .boxes import EXCHANGED
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
    float sibling_box[6];
    unsigned int sibling = take_box(4 * parent + 2 - side, sibling_box);
    if (left) put_node((float*)tree.nodes.data, parent, pad, box, ref, sibling_box, sibling);
    else put_node((float*)tree.nodes.data, parent, pad, sibling_box, sibling, box, ref);
    join(box, sibling_box);
    ref = (unsigned int)parent;
    if (left) r = (int)(unsigned int)other, after = (unsigned int)(other >> 32);
    else l = (int)(unsigned int)other, before = (unsigned int)(other >> 32);
}
tree.root.data[0] = (int)ref;
"""


@functools.cache
def make_lbvh_kernel() -> Any:
    """One thread per leaf in key order, in blocks of any size."""
    return make_builder(EXCHANGED + BUILD)
