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


@wp.kernel(enable_backward=False)
def needs_kernel(counts: wp.array(dtype=wp.int32), needs: wp.array(dtype=wp.int64), first: wp.int32):
    """Keep what a stream asked of its queues, before the next stream counts anew."""
    i = wp.tid()
    needs[first + i] = wp.int64(counts[i])
