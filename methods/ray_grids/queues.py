"""Work queues on the device: threads reserve places, write what fits, and count on beyond the capacity.

``counts`` (int32) holds one counter a queue. After the frame the harness compares counters with capacities; a
frame that lost an item is discarded, the queue grown, and the frame repeated. Nothing is dropped silently.
"""

from __future__ import annotations

import copy

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame import Frame
from ..common.pairs import grown
from ..common.reserve import counted, reserve

ITEMS, PARTS, DOUBTS, LARGE = 0, 1, 2, 3
"""Counters of one stream: groups of rows of a larger triangle; further parts of groups with many pixels or
rays; (triangle, pixel or ray) pairs left to float64; larger triangles on a face of a light's cube."""

RAYS = 4
"""In the same row, no queue: where the next row of cells puts its rays."""

COUNTERS = 6
"""Words of a row: an even number, since all rows are cleared with the 64-bit words of the pixels."""

THREADS = 9 * 128
"""Threads a multiprocessor of a kernel that empties a queue: as many as fit, since they stride over what is there. The
count stays on the device."""

BLOCK_DIM = 128


@wp.func
def queue_parts(
    item: wp.int32,
    number: wp.int32,
    size: wp.int32,
    lane: wp.int32,
    counts: wp.array(dtype=wp.int32),
    parts: wp.array(dtype=wp.vec2i),
):
    """Queue what an item of ``number`` elements has beyond its first ``size``: (item, part), by one lane."""
    if number > size and lane == 0:
        further = (number - 1) // size
        place = reserve(counts, PARTS, further)
        for part in range(further):
            if place + part < parts.shape[0]:
                parts[place + part] = wp.vec2i(item, part + 1)


@wp.kernel(enable_backward=False)
def keep_kernel(counts: wp.array(dtype=wp.int32), needs: wp.array(dtype=wp.int64)):
    """Copy a stream's counters to where another method counts its own needs."""
    i = wp.tid()
    needs[i] = wp.int64(counts[i])


Capacity = tuple[int, int, int]
"""Room for items (and for large triangles), parts and doubts."""


def more_room(needed: NDArray[np.int64], before: Capacity, memory: int) -> Capacity:
    """What the queues must hold, given the counters of one or more streams."""
    most = counted(needed).reshape(-1, COUNTERS).max(axis=0)
    items, parts, doubts = before
    return (
        grown(int(max(most[ITEMS], most[LARGE])), items, memory, "work items"),
        grown(int(most[PARTS]), parts, memory, "parts of work items"),
        grown(int(most[DOUBTS]), doubts, memory, "doubtful pairs"),
    )


class Queues:
    """What the streams of one frame share: queues, counters, and planes of queued triangles.

    items vec4i [item_capacity], with lines vec4f x 3 for each; large vec4i [item_capacity]; parts vec2i
    [part_capacity]; doubts vec2i [doubt_capacity]; counts int32 [streams, 6]; nearest uint64 [pixels]; records
    vec4f x 4 and depths vec3d [triangles]. Without queues (CPU) all but the counts, nearest and the doubts are one
    element long.
    """

    def __init__(self, frame: Frame, queued: bool, capacity: Capacity, streams: int):
        self.queued = queued
        self.device = frame.device
        device = wp.get_device(frame.device)
        self.cuda = device.is_cuda
        self.threads = THREADS * device.sm_count if self.cuda else 64
        words = COUNTERS // 2 * streams
        with wp.ScopedDevice(frame.device):
            # One array for all that a frame begins by clearing: a launch costs as much as the bytes.
            self.cleared = wp.zeros(frame.pixels + words, dtype=wp.uint64)
            self.nearest = self.cleared[: frame.pixels]
            self.counts = wp.array(
                ptr=self.cleared.ptr + 8 * frame.pixels, shape=(streams, COUNTERS), dtype=wp.int32
            )
        self._allocate(frame, capacity)

    def _allocate(self, frame: Frame, capacity: Capacity) -> None:
        items, parts, doubts = capacity if self.queued else (1, 1, capacity[2])
        triangles = max(1, frame.triangle_count) if self.queued else 1
        with wp.ScopedDevice(frame.device):
            self.items = wp.zeros(items, dtype=wp.vec4i)
            self.large = wp.zeros(items, dtype=wp.vec4i)
            self.lines = wp.zeros((items, 3), dtype=wp.vec4f)
            self.parts = wp.zeros(parts, dtype=wp.vec2i)
            self.doubts = wp.zeros(doubts, dtype=wp.vec2i)
            self.depths = wp.zeros(triangles, dtype=wp.vec3d)
            self.records = wp.zeros((triangles, 4), dtype=wp.vec4f)

    def beside(self, frame: Frame, capacity: Capacity) -> Queues:
        """The same counters with queues of their own, for a stream that runs beside those of this one."""
        other = copy.copy(self)
        other._allocate(frame, capacity)
        return other
