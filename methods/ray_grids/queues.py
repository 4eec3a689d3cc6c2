"""Work queues on the device: threads reserve places, write what fits, and count on beyond the capacity.

``counts`` (int32) holds one counter a queue. After the frame the harness compares counters with capacities; a
frame that lost an item is discarded, the queue grown, and the frame repeated. Nothing is dropped silently.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Sequence

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.passes import Pass
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

BLOCK_DIM = wp.constant(128)


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


class Room:
    """Queues of one share of a stream's triangles. Without queues (CPU) all but the doubts are one element long.

    items vec4i [item_capacity], with lines vec4f x 3 for each; large vec4i [item_capacity]; parts vec2i
    [part_capacity]; doubts vec2i [doubt_capacity].
    """

    def __init__(self, frame: Frame, queued: bool, capacity: Capacity):
        items, parts, doubts = capacity if queued else (1, 1, capacity[2])
        with wp.ScopedDevice(frame.device):
            self.items = wp.zeros(items, dtype=wp.vec4i)
            self.large = wp.zeros(items, dtype=wp.vec4i)
            self.lines = wp.zeros((items, 3), dtype=wp.vec4f)
            self.parts = wp.zeros(parts, dtype=wp.vec2i)
            self.doubts = wp.zeros(doubts, dtype=wp.vec2i)


class Queues:
    """What the streams of one frame share: queues, counters, and planes of queued triangles.

    Of each stream the triangles may go in ``shares`` beside each other, each with a room and a row of counters of its own.
    counts int32 [streams * shares, 6]; nearest uint64 [pixels]; records vec4f x 4 and depths vec3d [triangles], one
    element long without queues.
    """

    def __init__(self, frame: Frame, queued: bool, capacity: Capacity, streams: int, shares: int = 1):
        self.queued, self.shares = queued, shares
        self.device = frame.device
        device = wp.get_device(frame.device)
        self.cuda = device.is_cuda
        self.threads = THREADS * device.sm_count if self.cuda else 64
        words = COUNTERS // 2 * streams * shares
        with wp.ScopedDevice(frame.device):
            # One array for all that a frame begins by clearing: a launch costs as much as the bytes.
            self.cleared = wp.zeros(frame.pixels + words, dtype=wp.uint64)
            self.nearest = self.cleared[: frame.pixels]
            self.counts = wp.array(
                ptr=self.cleared.ptr + 8 * frame.pixels, shape=(streams * shares, COUNTERS), dtype=wp.int32
            )
            self.depths = wp.zeros(max(1, frame.triangle_count) if queued else 1, dtype=wp.vec3d)
        self._make_rooms(frame, capacity)

    def _make_rooms(self, frame: Frame, capacity: Capacity) -> None:
        self.rooms = [Room(frame, self.queued, capacity) for _ in range(self.shares)]
        triangles = max(1, frame.triangle_count) if self.queued else 1
        self.records = wp.zeros((triangles, 4), dtype=wp.vec4f, device=frame.device)

    def beside(self, frame: Frame, capacity: Capacity) -> Queues:
        """The same counters with rooms and records of their own, for a stream that runs beside those of this one."""
        other = copy.copy(self)
        other._make_rooms(frame, capacity)
        return other

    def counters(self, stream: int) -> wp.array:
        """int32 [shares, 6]: rows of a stream, the camera's (0) or light i's (1 + i)."""
        return self.counts[stream * self.shares : (stream + 1) * self.shares]

    def share_threads(self, triangles: int) -> int:
        """Threads that stream one share of the triangles."""
        blocks = -(-triangles // BLOCK_DIM)
        return BLOCK_DIM * max(1, -(-blocks // self.shares))


@wp.func
def triangle_of(thread: wp.int32, share: wp.int32, shares: wp.int32) -> wp.int32:
    """The triangle of a thread that streams a share: every ``shares``-th block is the share's."""
    block = thread // BLOCK_DIM * shares + share
    return block * BLOCK_DIM + thread % BLOCK_DIM


Step = tuple[str, tuple[str, ...], tuple[str, ...], Callable[[int], None]]
"""What is done to each share: its name, the queues it reads and writes, and what launches it."""


def in_shares(
    who: str,
    part: str,
    steps: Sequence[Step],
    shares: int,
    reads: tuple[str, ...],
    writes: tuple[str, ...],
    effect: str | None = None,
) -> list[Pass]:
    """Passes of a stream's steps, the shares beside each other. All read ``reads`` and add to ``writes``."""
    passes = []
    for name, taken, made, launch in steps:
        for share in range(shares):
            of = f", share {share + 1} of {shares}" if shares > 1 else ""
            passes.append(
                Pass(
                    f"{who}: {name}{of}",
                    part,
                    (*reads, *(f"{who} {queue}{of}" for queue in taken)),
                    (*writes, *(f"{who} {queue}{of}" for queue in made)),
                    functools.partial(launch, share),
                    effect,
                    branch=(share,),
                    adds=True,
                )
            )
    return passes
