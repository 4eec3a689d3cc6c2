"""H-PLOC: clusters merged bottom-up with their nearest neighbours, within the nodes of the radix tree.

Benthin, Meister, Barczak, Mehalwal, Tsakok & Kensler, "H-PLOC: Hierarchical Parallel Locally-Ordered Clustering for
Bounding Volume Hierarchy Construction" (HPG 2024). The radix tree is climbed (:mod:`.climb`); at each of its nodes with
more than :data:`CLUSTERS` leaves a warp holds the clusters of both halves, in their order, and merges pairs that are each
other's best neighbour within ``radius`` places, by the area of the box of both, until no more than :data:`CLUSTERS` are
left; at the root, until one is left. A warp that has merged a node climbs on from it until it reaches a node whose other
half is not there yet.

The paper gives no bound on the height of the tree: each merge may add one level, so that triangles whose sizes halve from
one to the next make a chain. Here a cluster stores its height. Where one of a node's clusters is :data:`TALL` levels
high, neighbours are merged in pairs, whatever their area: one level for each node of the radix tree that is still to
come, and five at its root. So no tree is higher than TALL + 54 + 5 (:data:`..native.STACK`).

Threads that climb through small nodes write nothing to global memory. A block keeps the boxes of its leaves and the flags
between them in shared memory; the warp that merges a leaf of another block computes its box again. So only warps that
write merged clusters need a release, and only warps that read them an acquire.

The tree depends on the keys alone, not on the order of the threads: a merged cluster is named by the first leaf of its
left part, and the name of the right part becomes the new node's number. The CPU builds the same tree, one leaf after
another.
"""

import functools
from typing import Any

from ..constants import BLOCK
from .climb import make_builder

CLUSTERS = 16
"""Clusters that a node may keep: half the lanes of a warp, so that those of two nodes fit one warp."""

TALL = 64

HEIGHT_BIT = 25
"""A cluster's name takes the bits below, its height those above."""

SHARED = (
    f"""
constexpr int CLUSTERS = {CLUSTERS}, BLOCK = {BLOCK}, HEIGHT_BIT = {HEIGHT_BIT};
constexpr unsigned int TALL = {TALL}u, NAME = (1u << HEIGHT_BIT) - 1u;
struct Cluster {{ float box[6]; unsigned int ref, name; }};
"""
    + """
auto cost_of = [&](const float* p, const float* q) {
    float x = sum(high(p[3], q[3]), -low(p[0], q[0]));
    float y = sum(high(p[4], q[4]), -low(p[1], q[1]));
    float z = sum(high(p[5], q[5]), -low(p[2], q[2]));
    float area = sum(sum(product(x, y), product(y, z)), product(z, x));
    return bits(area < 3.0e38f ? area : 3.0e38f) & ~31u;  // the place of a neighbour goes into the low bits
};
auto merged = [&](const Cluster& p, const Cluster& q) {
    Cluster both;
    for (int k = 0; k < 6; k++) both.box[k] = p.box[k];
    join(both.box, q.box);
    both.ref = q.name & NAME;
    unsigned int height = p.name >> HEIGHT_BIT, other = q.name >> HEIGHT_BIT;
    both.name = (p.name & NAME) | ((height > other ? height : other) + 1u) << HEIGHT_BIT;
    put_node((float*)tree.nodes.data, both.ref, pad, 0, p.box, p.ref, q.box, q.ref);
    return both;
};
"""
)

BY_WARPS = """
const unsigned int ALL = 0xffffffffu;
__shared__ int lanes[BLOCK];
int lane = threadIdx.x & 31, begin = i - (int)threadIdx.x, *mine = lanes + (threadIdx.x & ~31);
float4* kept = reinterpret_cast<float4*>(scratch.data);
auto acquire = []() { asm volatile("fence.acq_rel.gpu;" ::: "memory"); };
auto store = [&](int k, const Cluster& c) {
    __stcg(kept + 2 * k, make_float4(c.box[0], c.box[1], c.box[2], real(c.ref)));
    __stcg(kept + 2 * k + 1, make_float4(c.box[3], c.box[4], c.box[5], real(c.name)));
};
__shared__ float leaf_box[6][BLOCK];
__shared__ unsigned int leaf_ref[BLOCK];
bool on = i < count;
if (on) {
    float box[6];
    leaf_ref[threadIdx.x] = box_of(i, box);
    for (int axis = 0; axis < 6; axis++) leaf_box[axis][threadIdx.x] = box[axis];
}
auto load = [&](int k, bool leaf) {
    if (leaf) {
        Cluster c;
        int here = k - begin;
        if (here < 0 || here >= BLOCK) {
            c.ref = box_of(k, c.box);
        } else {
            for (int axis = 0; axis < 6; axis++) c.box[axis] = leaf_box[axis][here];
            c.ref = leaf_ref[here];
        }
        c.name = (unsigned int)k;
        return c;
    }
    float4 p = __ldcg(kept + 2 * k), q = __ldcg(kept + 2 * k + 1);
    return Cluster{{p.x, p.y, p.z, q.x, q.y, q.z}, bits(p.w), bits(q.w)};
};
auto of_lane = [&](const Cluster& c, int from) {
    Cluster there;
    for (int k = 0; k < 6; k++) there.box[k] = __shfl_sync(ALL, c.box[k], from);
    there.ref = __shfl_sync(ALL, c.ref, from);
    there.name = __shfl_sync(ALL, c.name, from);
    return there;
};
auto merge_down = [&](Cluster& c, int& number, int enough) {
    while (number > enough) {
        unsigned int best = NONE;
        if (__any_sync(ALL, lane < number && (c.name >> HEIGHT_BIT) >= TALL)) {
            if ((lane ^ 1) < number) best = lane ^ 1;
        } else {
#pragma unroll
            for (int step = 1; step <= RADIUS; step++) {
                float neighbour[6];
                for (int k = 0; k < 6; k++) neighbour[k] = __shfl_sync(ALL, c.box[k], lane + step);
                unsigned int cost = lane + step < number ? cost_of(c.box, neighbour) : NONE;
                if (cost != NONE) best = min(best, cost | (lane + step));
                unsigned int back = __shfl_sync(ALL, cost, lane - step);
                if (lane >= step && back != NONE) best = min(best, back | (lane - step));
            }
        }
        int other = best & 31;
        int chosen = __shfl_sync(ALL, best == NONE ? 32 : other, other);
        bool held = lane < number, paired = held && best != NONE && chosen == lane;
        Cluster neighbour = of_lane(c, other);
        bool first = paired && lane < other;
        if (first) c = merged(c, neighbour);
        unsigned int stay = __ballot_sync(ALL, first || (held && !paired));
        number = __popc(stay);
        if (stay >> lane & 1u) mine[__popc(stay & ((1u << lane) - 1u))] = lane;
        __syncwarp();
        int from = lane < number ? mine[lane] : lane;
        __syncwarp();
        c = of_lane(c, from);
        if (lane >= number) c.ref = NONE;
    }
};
int left = i, right = i, split = i + 1;
unsigned int before = NONE, after = NONE;
if (on) {
    before = gap(i - 1);
    after = gap(i);
}
// First in shared memory, as long as both halves are leaves of this block.
__shared__ Flag near[BLOCK];
near[threadIdx.x] = EMPTY;
__syncthreads();
int wait = -1;
Flag told = EMPTY;
while (on && wait < 0 && right - left < CLUSTERS && (before != NONE || after != NONE)) {
    bool lower = is_left(left, right, before, after);
    int flag = (lower ? right : left - 1) - begin;
    if (flag < 0 || flag >= BLOCK - 1) break;
    told = lower ? far_end(left, before) : far_end(right, after);
    Flag other = atomicExch(near + flag, told);
    if (other == EMPTY) wait = flag;
    else if (lower) split = right + 1, right = (int)(unsigned int)other, after = other >> 32;
    else split = left, left = (int)(unsigned int)other, before = other >> 32;
}
__syncthreads();
// Who waited goes on, unless the other half came and took this one along.
if (wait >= 0) on = near[wait] == told;
while (true) {
    bool ready = false;
    while (on && !ready) {
        if (right - left >= CLUSTERS || (before == NONE && after == NONE)) {
            ready = true;
            break;
        }
        Flag other;
        if (is_left(left, right, before, after)) {
            other = atomicExch((Flag*)flags.data + right, far_end(left, before));
            if (other != EMPTY) split = right + 1, right = (int)(unsigned int)other, after = other >> 32;
        } else {
            other = atomicExch((Flag*)flags.data + left - 1, far_end(right, after));
            if (other != EMPTY) split = left, left = (int)(unsigned int)other, before = other >> 32;
        }
        on = other != EMPTY;
    }
    unsigned int waiting = __ballot_sync(ALL, ready);
    if (!waiting) break;
    while (waiting) {
        int source = __ffs(waiting) - 1;
        waiting &= waiting - 1;
        int l = __shfl_sync(ALL, left, source), r = __shfl_sync(ALL, right, source);
        int middle = __shfl_sync(ALL, split, source);
        unsigned int lower = __shfl_sync(ALL, before, source), upper = __shfl_sync(ALL, after, source);
        Cluster c;
        for (int k = 0; k < 6; k++) c.box[k] = 0.0f;
        c.ref = NONE;
        c.name = 0;
        int first = lane < CLUSTERS ? l : middle, length = lane < CLUSTERS ? middle - l : r + 1 - middle;
        int place = first + (lane & (CLUSTERS - 1));
        // A half that a warp merged: acquires what that warp released. Leaves were there before.
        if (middle - l > CLUSTERS || r + 1 - middle > CLUSTERS) acquire();
        __syncwarp();
        if (place < first + length) c = load(place, length <= CLUSTERS);
        unsigned int filled = __ballot_sync(ALL, c.ref != NONE);
        int number = __popc(filled), halfway = __popc(filled & 0xffffu);
        c = of_lane(c, lane < halfway ? lane : CLUSTERS + lane - halfway);
        if (lane >= number) c.ref = NONE;
        while (true) {
            bool whole = lower == NONE && upper == NONE;
            merge_down(c, number, whole ? 1 : CLUSTERS);
            if (whole) {
                if (lane == 0) tree.root.data[0] = (int)c.ref;
                break;
            }
            bool is_lower = is_left(l, r, lower, upper);
            int flag = is_lower ? r : l - 1;
            Flag other = EMPTY;
            if (lane == 0) other = peek(flag);
            other = __shfl_sync(ALL, other, 0);
            __syncwarp();
            if (other == EMPTY) {
                if (lane < CLUSTERS) store(l + lane, c);
                __syncwarp();
                if (lane == 0) other = exchange(flag, is_lower ? far_end(l, lower) : far_end(r, upper));
                other = __shfl_sync(ALL, other, 0);
                __syncwarp();
                if (other == EMPTY) break;
            }
            int first = is_lower ? r + 1 : (int)(unsigned int)other;
            int end = is_lower ? (int)(unsigned int)other : l - 1;
            Cluster neighbour = c;
            neighbour.ref = NONE;
            if (lane < CLUSTERS && first + lane <= end) neighbour = load(first + lane, end - first < CLUSTERS);
            int more = __popc(__ballot_sync(ALL, neighbour.ref != NONE));
            if (is_lower) {
                Cluster moved = of_lane(neighbour, lane - number);
                if (lane >= number) c = moved;
                r = end, upper = other >> 32;
            } else {
                Cluster moved = of_lane(c, lane - more);
                c = lane < more ? neighbour : moved;
                l = first, lower = other >> 32;
            }
            number += more;
            if (lane >= number) c.ref = NONE;
        }
        if (lane == source) on = false;
    }
}
"""

ONE_BY_ONE = """
if (i >= count) return;
auto store = [&](int k, const Cluster& c) {
    store16(scratch.data, 2 * k, c.box[0], c.box[1], c.box[2], real(c.ref));
    store16(scratch.data, 2 * k + 1, c.box[3], c.box[4], c.box[5], real(c.name));
};
auto load = [&](int k) {
    Quad p = load16(scratch.data, 2 * k), q = load16(scratch.data, 2 * k + 1);
    return Cluster{{p.x, p.y, p.z, q.x, q.y, q.z}, bits(p.w), bits(q.w)};
};
auto merge_down = [&](Cluster* held, int& number, int enough) {
    while (number > enough) {
        bool tall = false;
        for (int k = 0; k < number; k++) tall = tall || (held[k].name >> HEIGHT_BIT) >= TALL;
        int other[32];
        for (int k = 0; k < number; k++) {
            unsigned int best = NONE;
            for (int near = k - RADIUS; near <= k + RADIUS; near++)
                if (!tall && near >= 0 && near < number && near != k) {
                    unsigned int cost = cost_of(held[near < k ? near : k].box, held[near < k ? k : near].box) | near;
                    if (cost < best) best = cost;
                }
            other[k] = best == NONE ? 32 : (int)(best & 31u);
            if (tall && (k ^ 1) < number) other[k] = k ^ 1;
        }
        int stay = 0;
        Cluster next[32];
        for (int k = 0; k < number; k++) {
            bool paired = other[k] < number && other[other[k]] == k;
            if (paired && k < other[k]) next[stay++] = merged(held[k], held[other[k]]);
            else if (!paired) next[stay++] = held[k];
        }
        for (int k = 0; k < stay; k++) held[k] = next[k];
        number = stay;
    }
};
Cluster own;
own.ref = box_of(i, own.box);
own.name = (unsigned int)i;
store(i, own);
int left = i, right = i, split = i + 1;
unsigned int before = gap(i - 1), after = gap(i);
while (true) {
    bool whole = before == NONE && after == NONE;
    if (right - left >= CLUSTERS || whole) {
        Cluster held[32];
        int number = 0;
        for (int half = 0; half < 2; half++) {
            int first = half ? split : left, end = half ? right + 1 : split;
            for (int k = first; k < end && k < first + CLUSTERS; k++) {
                Cluster c = load(k);
                if (c.ref != NONE) held[number++] = c;
            }
        }
        merge_down(held, number, whole ? 1 : CLUSTERS);
        if (whole) {
            tree.root.data[0] = (int)held[0].ref;
            return;
        }
        for (int k = 0; k < CLUSTERS; k++) {
            if (k >= number) held[k].ref = NONE;
            store(left + k, held[k]);
        }
    }
    Flag other;
    if (is_left(left, right, before, after)) {
        other = exchange(right, far_end(left, before));
        if (other == EMPTY) return;
        split = right + 1, right = (int)(unsigned int)other, after = (unsigned int)(other >> 32);
    } else {
        other = exchange(left - 1, far_end(right, after));
        if (other == EMPTY) return;
        split = left, left = (int)(unsigned int)other, before = (unsigned int)(other >> 32);
    }
}
"""


@functools.cache
def make_hploc_kernel(radius: int) -> Any:
    """A thread for each leaf in key order, and up to a full block."""
    by_device = f"\n#if defined(__CUDA_ARCH__)\n{BY_WARPS}\n#else\n{ONE_BY_ONE}\n#endif\n"
    return make_builder(f"constexpr int RADIUS = {radius};" + SHARED + by_device)
