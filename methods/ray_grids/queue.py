"""Work queues on the device: threads reserve places, write what fits, and count on beyond the capacity.

``counts`` (int32) holds one counter a queue. After the frame the harness compares counters with capacities; a
frame that lost an item is discarded, the queue grown, and the frame repeated. Nothing is dropped silently.
"""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..common.pairs import grown
from ..common.reserve import counted, reserve

ITEMS, PARTS, DOUBTS, LARGE = 0, 1, 2, 3
"""Counters of one stream: groups of rows of a larger triangle; further parts of groups with many rays; (triangle,
ray) pairs left to float64; larger triangles on a face of a light's cube."""

RAYS = 4
"""In the same row, no queue: where the next row of cells puts its rays."""

COUNTERS = 6
"""Words of a row: an even number, since all rows are cleared with the 64-bit words of the pixels."""


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
