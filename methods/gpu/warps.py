"""The lanes of a warp working on one item together: sums over lanes, values of other lanes.

A triangle's rows differ in length. Each lane finds one row's pixels or rays; their lengths are summed up over the
lanes, and then all lanes take the pixels or rays of all rows in turn, 32 at a time: every lane has work, however long or
short the rows are. Warp's language has no functions for this, so these are native snippets. They are for the GPU: kernels
for the CPU process the rows one after the other. The functions that these call too apply to one thread
(:func:`least_of_lanes`, :func:`lanes_with`, :func:`of_lane`) or do nothing (:func:`scan_row`).
"""

import warp as wp

from .reserve import WITHIN

LANES = wp.constant(32)


# Shifts, because a division of a number that may be negative takes six instructions.
@wp.func
def lane_of(thread: wp.int32) -> wp.int32:
    """The lane of a thread."""
    return thread & 31


@wp.func
def warp_of(thread: wp.int32) -> wp.int32:
    """The warp of a thread, or the warps of so many threads."""
    return thread >> 5


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int lane = threadIdx.x & 31;
for (int step = 1; step < 32; step <<= 1) {
    int other = __shfl_up_sync(0xffffffffu, value, step);
    if (lane >= step) value += other;
}
#endif
return value;
""")
def sum_to_lane(value: wp.int32) -> wp.int32:
    """The sum of the values of lanes 0 to this one. All lanes must call it."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
for (int step = 16; step; step >>= 1) value = fminf(value, __shfl_xor_sync(0xffffffffu, value, step));
#endif
return value;
""")
def least_of_lanes(value: wp.float32) -> wp.float32:
    """The least of the values of all lanes. All lanes must call it."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __ballot_sync(0xffffffffu, wanted);
#else
return wanted ? 1u : 0u;
#endif
""")
def lanes_with(wanted: wp.bool) -> wp.uint32:
    """A bit for each lane that is ``wanted``. All lanes must call it."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __shfl_sync(0xffffffffu, value, lane);
#else
return value;
#endif
""")
def of_lane(value: wp.int32, lane: wp.int32) -> wp.int32:
    """The value of another lane. All lanes must call it."""


# Lanes are sent through shared memory: a shuffle only fetches.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int lanes[1024];
int lane = threadIdx.x & 31, *mine = lanes + (threadIdx.x & ~31);
unsigned int filled = __ballot_sync(0xffffffffu, value > 0);
if (value > 0) mine[__popc(filled & ((1u << lane) - 1u))] = lane;
__syncwarp();
int found = mine[lane];
__syncwarp();
return lane < __popc(filled) ? found : 32;
#else
return 0;
#endif
""")
def filled_lane(value: wp.int32) -> wp.int32:
    """The lanes whose value is positive, in order, one for each lane; 32 beyond the last. All lanes must call it."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int lane = threadIdx.x & 31;
unsigned int place = start - at, bit = place < 32u ? 1u << place : 0u;
#if __CUDA_ARCH__ >= 800
unsigned int starts = __reduce_or_sync(0xffffffffu, bit);
#else
unsigned int starts = bit;
for (int step = 16; step; step >>= 1) starts |= __shfl_xor_sync(0xffffffffu, starts, step);
#endif
return __popc(__ballot_sync(0xffffffffu, start < at)) + __popc(starts & ((2u << lane) - 1u)) - 1;
#else
return 0;
#endif
""")
def lane_at(start: wp.int32, at: wp.int32) -> wp.int32:
    """The lane that holds element ``at`` + this lane, given where each lane's elements start.

    Starts grow from lane to lane, from 0, and no two are equal but those of lanes that hold nothing, after all
    others. All lanes must call it.
    """


# Shared memory for blocks of 128 threads: a warp writes its pairs out when it holds more than 32. What the warps of a block
# hold at the end they add with one atomic: thousands of warps end at the same time, and atomics on one address take turns.
@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
unsigned int among = __ballot_sync(0xffffffffu, wanted);
if (!among && !last) return held;
__shared__ int2 pairs[256];
__shared__ int ends[5];
int lane = threadIdx.x & 31, warp = (threadIdx.x >> 5) & 3;
int2 *mine = pairs + 64 * warp;
if (wanted) mine[held + __popc(among & ((1u << lane) - 1u))] = make_int2(first, second);
held += __popc(among);
if (held <= 32 && !last) return held;
int base = 0;
if (last) {{
    if (lane == 0) ends[warp] = held;
    __syncthreads();
    if (threadIdx.x == 0) {{
        int number = ends[0] + ends[1] + ends[2] + ends[3];
        if (number) base = atomicAdd(counts.data + slot, number);
        {WITHIN}
        ends[4] = base;
    }}
    __syncthreads();
    base = ends[4];
    for (int k = 0; k < warp; k++) base += ends[k];
}} else {{
    __syncwarp();
    if (lane == 0) {{
        base = atomicAdd(counts.data + slot, held);
        {WITHIN}
    }}
    base = __shfl_sync(0xffffffffu, base, 0);
}}
#pragma unroll 1
for (int k = lane; k < held; k += 32)
    if (base + k < list.shape[0]) reinterpret_cast<int2*>(list.data)[base + k] = mine[k];
__syncwarp();
#endif
return 0;
""")
def append_pairs(
    wanted: wp.bool,
    first: wp.int32,
    second: wp.int32,
    held: wp.int32,
    last: wp.bool,
    counts: wp.array[wp.int32],
    slot: wp.int32,
    list: wp.array[wp.vec2i],
) -> wp.int32:
    """Add the pairs of lanes that want it to a list whose length is ``counts[slot]``; how many the warp still holds.

    ``held`` is what the last call returned, at first 0. All lanes must call it. The ``last`` call, which all threads of the
    block must make, leaves none.
    """


KEPT = 288
"""Pairs that a warp keeps at most: those of a part of 256 pixels, and fewer than 32 left from before."""


@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
__shared__ int2 kept[4 * {KEPT}];
return (int)__cvta_generic_to_shared(kept) + 8 * {KEPT} * ((threadIdx.x >> 5) & 3);
#else
return 0;
#endif
""")
def place_of_kept() -> wp.int32:
    """Where the pairs that this warp keeps lie in shared memory."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
unsigned int among = __ballot_sync(0xffffffffu, wanted);
int place = kept + 8 * (held + __popc(among & ((1u << (threadIdx.x & 31)) - 1u)));
if (wanted) asm volatile("st.shared.v2.b32 [%0], {%1, %2};" :: "r"(place), "r"(first), "r"(second) : "memory");
return held + __popc(among);
#else
return 0;
#endif
""")
def keep_pairs(wanted: wp.bool, first: wp.int32, second: wp.int32, held: wp.int32, kept: wp.int32) -> wp.int32:
    """Keep the pairs of lanes that want it, after the ``held`` ones in :func:`place_of_kept`; how many there are then. All
    lanes must call it.
    """


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int first, second;
__syncwarp();
asm volatile("ld.shared.v2.b32 {%0, %1}, [%2];" : "=r"(first), "=r"(second) : "r"(kept + 8 * number));
return {first, second};
#else
return {0, 0};
#endif
""")
def kept_pair(kept: wp.int32, number: wp.int32) -> wp.vec2i:
    """A pair of those that a warp keeps. All lanes must call it."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int base = 0;
if (number > 0 && (threadIdx.x & 31) == 0) base = atomicAdd(counts.data + slot, number);
return base;
#else
return 0;
#endif
""")
def claim(counts: wp.array[wp.int32], slot: wp.int32, number: wp.int32) -> wp.int32:
    """Reserve places for a warp, by its first lane. The atomic is not waited for before :func:`claimed_place`."""


@wp.func_native(f"""
#if defined(__CUDA_ARCH__)
{WITHIN}
return __shfl_sync(0xffffffffu, base, 0);
#else
return 0;
#endif
""")
def claimed_place(base: wp.int32) -> wp.int32:
    """The first of the places that :func:`claim` has reserved. All lanes must call it."""


# Rows are laid out in the order in which their blocks come by, so no block waits for another; no answer depends on
# that order. The counts are left empty for the next frame.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int sums[33];
int thread = threadIdx.x & 127, lane = thread & 31, part = thread >> 5;
int *from = count.data + first, *to = offset.data + first;
int sum = 0;
for (int x = thread * 4; x < length; x += 512) {
    int4 v = *reinterpret_cast<const int4*>(from + x);
    sum += v.x + v.y + v.z + v.w;
}
for (int step = 16; step; step >>= 1) sum += __shfl_down_sync(0xffffffffu, sum, step);
if (lane == 0) sums[part] = sum;
__syncthreads();
if (thread == 0) sums[32] = atomicAdd(cursor.data + slot, sums[0] + sums[1] + sums[2] + sums[3]);
__syncthreads();
int base = sums[32];
for (int start = 0; start < length; start += 512) {
    int x = start + thread * 4;
    int4 v = make_int4(0, 0, 0, 0);
    if (x < length) v = *reinterpret_cast<const int4*>(from + x);
    int own = v.x + v.y + v.z + v.w, upto = own;
    for (int step = 1; step < 32; step <<= 1) {
        int other = __shfl_up_sync(0xffffffffu, upto, step);
        if (lane >= step) upto += other;
    }
    __syncthreads();
    if (lane == 31) sums[part] = upto;
    __syncthreads();
    int before = base + upto - own;
    for (int k = 0; k < part; k++) before += sums[k];
    if (x < length) {
        *reinterpret_cast<int4*>(from + x) = make_int4(0, 0, 0, 0);
        *reinterpret_cast<int4*>(to + x) = make_int4(before, before + v.x, before + v.x + v.y, before + v.x + v.y + v.z);
        if (x + 4 >= length) to[length] = before + own;
    }
    base += sums[0] + sums[1] + sums[2] + sums[3];
}
#endif
""")
def scan_row(
    count: wp.array[wp.int32],
    offset: wp.array[wp.int32],
    first: wp.int32,
    length: wp.int32,
    cursor: wp.array[wp.int32],
    slot: wp.int32,
):
    """A block of 128 threads: offsets of a row of cells from their counts, and one beyond its end. GPU only.

    Reads and clears count[first : first + length] (a multiple of 4, as is ``first``); the row's place is taken from
    ``cursor[slot]``.
    """
