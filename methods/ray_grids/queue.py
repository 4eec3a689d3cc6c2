"""Work queues on the device: threads reserve places, write what fits, and count on beyond the capacity.

``counts`` (int32) holds one counter a queue. After the frame the harness compares counters with capacities; a
frame that lost an item is discarded, the queue grown, and the frame repeated. Nothing is dropped silently.
"""

from __future__ import annotations

import warp as wp

STRIPS, ITEMS, BLOCKS, DOUBTS = 0, 1, 2, 3
"""Counters of one stream: rows of blocks of large triangles; work items; (triangle, block) pairs on their way to
items; (triangle, ray) pairs left to float64."""

COUNTERS = 4


# One atomic for all lanes that reserve at the same time: a hundred thousand atomics on one address cost more than
# the work they hand out. On the CPU it is a plain addition.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
unsigned int active = __activemask();
int lane = threadIdx.x & 31, before = 0, sum = 0;
for (unsigned int left = active; left; left &= left - 1) {
    int other = __ffs(left) - 1;
    int value = __shfl_sync(active, number, other);
    if (other < lane) before += value;
    sum += value;
}
int leader = __ffs(active) - 1, base = 0;
if (lane == leader) base = atomicAdd(counts.data + slot, sum);
return __shfl_sync(active, base, leader) + before;
#else
int base = counts.data[slot];
counts.data[slot] = base + number;
return base;
#endif
""")
def reserve(counts: wp.array(dtype=wp.int32), slot: wp.int32, number: wp.int32) -> wp.int32: ...


@wp.kernel(enable_backward=False)
def needs_kernel(counts: wp.array(dtype=wp.int32), needs: wp.array(dtype=wp.int64), first: wp.int32):
    """Keep what a stream asked of its queues, before the next stream counts anew."""
    i = wp.tid()
    needs[first + i] = wp.int64(counts[i])
