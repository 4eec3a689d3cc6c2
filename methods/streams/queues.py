"""Work queues on the device: threads reserve places, write what fits, and count on beyond the capacity.

``counts`` (int32) holds one counter per queue. After the frame the harness compares counters with capacities; a
frame that lost an item is discarded, the queue grown, and the frame repeated. Nothing is dropped silently.

The undecided pairs of a frame are not as many each time: none is queued for a pixel that other threads have found to be
shadowed or nearer. So there is room to spare, and a frame that exceeded it is remembered (:meth:`Queues.needs`).
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.schedule.passes import Hints, Pass
from ...harness.frame.schedule.threads import Launch, at_once
from ..common.pairs import grown
from ..gpu.entries import entry, set_entry
from ..gpu.prefetch import GROUP_WORDS
from ..gpu.reserve import counted, next_number, reserve
from ..gpu.warps import LANES, claim, claimed_place

ITEMS, CHUNKS, UNDECIDED, LARGE = 0, 1, 2, 3
"""Counters of one stream: groups of rows of a larger triangle; further chunks of groups with many pixels or
rays; (triangle, pixel or ray) pairs left to float64; larger triangles on a face of a light's cube.
"""

RAYS = 4
"""In the same row, but not of a queue: the place for the rays of the next row of cells."""

SMALL = 5
"""Groups of few rows (a light's), which lie at the end of the groups' array, from its last entry on downwards."""

COUNTERS = 6
"""Words of a row: an even number, since all rows are cleared with the 64-bit words of the pixels."""

THREADS = 9 * 128
"""Threads per multiprocessor of a kernel that processes a queue: as many as fit, since they stride over the entries. The
count stays on the device.
"""

BLOCK_SHIFT = wp.constant(7)
BLOCK_DIM = wp.constant(128)

WORDS = "nearest words"
"""The resource that the camera's stream makes: the nearest hit of every pixel, and for which triangles hit points are
computed exactly.
"""


@wp.struct
class Queue:
    """The queues of one share of one stream's triangles; their counters continue beyond the capacities.

    counts   int32 [6]: ITEMS, CHUNKS, UNDECIDED, LARGE, RAYS, SMALL
    touched  int32 [1]: not 0 after a frame that left out what it may not (:mod:`.occlusion.closed`); one of all streams
    exceeded  int32 [1]: UNDECIDED of the last frame in which not all found room; 0: there was none
    large    vec4i [item_capacity]: triangles to be split into groups (a light's)
    items    vec4i [item_capacity]: groups of rows of a triangle (the camera's)
    groups   vec4f [item_capacity, 8]: groups of rows of a triangle, and its planes (a light's)
    chunks   vec2i [chunk capacity]: (item, chunk), chunks from 1
    undecided  vec2i [capacity]: (triangle, pixel)
    records  vec4f [triangles, 4]: planes of queued triangles; depths vec3d [triangles]: (the camera's)
    """

    counts: wp.array(dtype=wp.int32)
    touched: wp.array(dtype=wp.int32)
    exceeded: wp.array(dtype=wp.int32)
    large: wp.array(dtype=wp.vec4i)
    items: wp.array(dtype=wp.vec4i)
    groups: wp.array2d(dtype=wp.vec4f)
    chunks: wp.array(dtype=wp.vec2i)
    undecided: wp.array(dtype=wp.vec2i)
    records: wp.array2d(dtype=wp.vec4f)
    depths: wp.array(dtype=wp.vec3d)


@wp.struct
class Share:
    """A part of a stream's triangles: share ``number`` of ``count``, of ``triangles`` in all."""

    number: wp.int32
    count: wp.int32
    triangles: wp.int32


@wp.func
def triangle_of(thread: wp.int32, share: Share) -> wp.int32:
    """The triangle of a thread that streams a share: every ``share.count``-th block of threads is the share's."""
    # Shifts and masks, because divisions of a number that may be negative take more.
    block = (thread >> BLOCK_SHIFT) * share.count + share.number
    return (block << BLOCK_SHIFT) | (thread & (BLOCK_DIM - 1))


@wp.func
def queue_undecided(queue: Queue, i: wp.int32, pixel: wp.int32):
    """Leave a (triangle, pixel) pair to float64."""
    place = next_number(queue.counts, UNDECIDED)
    if place < queue.undecided.shape[0]:
        set_entry(queue.undecided, place, wp.vec2i(i, pixel))


@wp.func
def held_undecided(queue: Queue, thread: wp.int32) -> wp.int32:
    """How many undecided pairs the queue holds, when all are queued; the first thread notes that some found no room."""
    number = entry(queue.counts, UNDECIDED)
    if thread == 0 and wp.uint32(number) > wp.uint32(queue.undecided.shape[0]):
        set_entry(queue.exceeded, 0, number)
    return wp.min(number, queue.undecided.shape[0])


@wp.func
def queue_chunks(queue: Queue, item: wp.int32, number: wp.int32, size: wp.int32, lane: wp.int32):
    """Queue the elements of an item beyond its first ``size``, of ``number`` in all: (item, chunk), by one lane."""
    if number > size and lane == 0:
        further = (number - 1) // size
        place = reserve(queue.counts, CHUNKS, further)
        for chunk in range(further):
            if place + chunk < queue.chunks.shape[0]:
                queue.chunks[place + chunk] = wp.vec2i(item, chunk + 1)


@wp.func
def claim_chunks(queue: Queue, number: wp.int32, size: wp.int32) -> wp.int32:
    """Reserve places for the chunks of an item beyond its first ``size`` elements, for a warp: what :func:`store_chunks`
    needs later.
    """
    return claim(queue.counts, CHUNKS, wp.where(number > size, (number - 1) // size, 0))


@wp.func
def store_chunks(queue: Queue, claimed: wp.int32, item: wp.int32, number: wp.int32, size: wp.int32, lane: wp.int32):
    """:func:`queue_chunks` by all lanes of a warp, which must all call it, in the places of :func:`claim_chunks`."""
    if number > size:
        first = claimed_place(claimed)
        for chunk in range(lane, (number - 1) // size, LANES):
            if first + chunk < queue.chunks.shape[0]:
                set_entry(queue.chunks, first + chunk, wp.vec2i(item, chunk + 1))


Capacity = tuple[int, int, int]
"""Room for items (and for large triangles), chunks and undecided pairs."""


def more_room(needed: NDArray[np.int64], before: Capacity, memory: int) -> Capacity:
    """The capacities that the queues need, given the counters of one or more streams."""
    most = counted(needed).reshape(-1, COUNTERS).max(axis=0)
    items, chunks, undecided = before
    return (
        grown(int(max(most[ITEMS] + most[SMALL], most[LARGE])), items, memory, "work items"),
        grown(int(most[CHUNKS]), chunks, memory, "chunks of work items"),
        grown(int(most[UNDECIDED]), undecided, memory, "undecided pairs", varies=True),
    )


class Queues:
    """Memory that the streams of one frame share: queues, counters, and planes of queued triangles.

    The triangles of a stream may be divided into ``shares`` that run at the same time, each with queues and a row of
    counters of its own. nearest uint64 [pixels]; counts int32 [streams * shares, 6]; exact_path uint8 [triangles]: of
    those in view, whether hit points take their corners (not ``steep`` in :class:`.camera.pixels.Planes`); exceeded int32
    [streams * shares]. Without queues (CPU) all arrays of a :class:`Queue` but the undecided pairs are one element long.
    """

    def __init__(
        self, frame: Frame, queued: bool, capacity: Capacity, streams: int, shares: int = 1, threaded: bool = False
    ):
        self.queued, self.shares, self.threaded = queued, shares, threaded
        self.triangle_count, self.device = frame.triangle_count, frame.device
        self._capacity = capacity if queued else (1, 1, capacity[2])
        self._rows = max(1, frame.triangle_count) if queued else 1
        device = wp.get_device(frame.device)
        self.cuda = device.is_cuda
        self.threads = THREADS * device.sm_count if self.cuda else 64
        # For large triangles and undecided pairs: blocks without work take time too.
        self.few_threads = self.threads // 4
        rows = streams * shares
        with wp.ScopedDevice(frame.device):
            # One array for everything that is cleared at the start of a frame: a launch costs as much as the bytes.
            self.cleared = wp.zeros(frame.pixels + COUNTERS // 2 * rows, dtype=wp.uint64)
            self.nearest = self.cleared[: frame.pixels]
            self.counts = wp.array(ptr=self.cleared.ptr + 8 * frame.pixels, shape=(rows, COUNTERS), dtype=wp.int32)
            self.touched = wp.zeros(1, dtype=wp.int32)
            self._exceeded = wp.zeros(rows, dtype=wp.int32)
            self._depths = wp.zeros(self._rows, dtype=wp.vec3d)
            self.exact_path = wp.zeros(max(1, frame.triangle_count), dtype=wp.uint8)
        self._make_lists()

    def _make_lists(self) -> None:
        items, chunks, undecided = self._capacity
        with wp.ScopedDevice(self.device):
            self._records = wp.zeros((self._rows, 4), dtype=wp.vec4f)
            self._lists = [
                {
                    "large": wp.zeros(items, dtype=wp.vec4i),
                    "items": wp.zeros(items, dtype=wp.vec4i),
                    "groups": wp.zeros((items, GROUP_WORDS), dtype=wp.vec4f),
                    "chunks": wp.zeros(chunks, dtype=wp.vec2i),
                    "undecided": wp.zeros(undecided, dtype=wp.vec2i),
                }
                for _ in range(self.shares)
            ]

    def with_own_lists(self) -> Queues:
        """The same counters, lists and records of their own: for a stream that runs at the same time as these."""
        other = copy.copy(self)
        other._make_lists()
        return other

    def needs(self) -> wp.array:
        """int64 [streams * shares, 6] on the host: the counters of the last frame, or of undecided pairs what exceeded the
        room in an earlier frame since the queues were made.
        """
        found, exceeded = (counted(array.numpy().astype(np.int64)) for array in (self.counts, self._exceeded))
        found[:, UNDECIDED] = np.maximum(found[:, UNDECIDED], exceeded)
        return wp.array(found, dtype=wp.int64, device="cpu")

    def counters(self, stream: int) -> wp.array:
        """int32 [shares, 6]: rows of a stream, the camera's (0) or light i's (1 + i)."""
        return self.counts[stream * self.shares : (stream + 1) * self.shares]

    def of_stream(self, stream: int) -> list[Any]:
        """The :class:`Queue` of each share of a stream."""
        rows, first = self.counters(stream), stream * self.shares
        return [
            filled(
                Queue, counts=rows[k], touched=self.touched, exceeded=self._exceeded[first + k : first + k + 1],
                records=self._records, depths=self._depths, **lists,
            )
            for k, lists in enumerate(self._lists)
        ]  # fmt: skip

    def share(self, number: int) -> Any:
        """The :class:`Share` of a number."""
        return filled(Share, number=number, count=self.shares, triangles=self.triangle_count)

    @property
    def share_threads(self) -> int:
        """Threads that stream one share of the triangles."""
        blocks = -(-self.triangle_count // BLOCK_DIM)
        return BLOCK_DIM * max(1, -(-blocks // self.shares))


Step = tuple[str, tuple[str, ...], tuple[str, ...], Callable[[int], None]]
"""A step of each share: its name, the queues it reads and writes, and what launches it."""


def in_shares(
    who: str,
    part: str,
    steps: Sequence[Step],
    queues: Queues,
    reads: tuple[str, ...],
    writes: tuple[str, ...],
    effect: str | None = None,
) -> list[Pass]:
    """Passes of a stream's steps; the shares may run at the same time. All read ``reads`` and add to ``writes``.

    On a GPU each share has passes of its own, in a branch; threads of a CPU take the shares of one pass.
    """
    passes = []
    for name, taken, made, launch in steps:
        launches: list[Launch] = [functools.partial(launch, share) for share in range(queues.shares)]
        if queues.threaded:
            launches = [at_once(launches)]
        for share, launched in enumerate(launches):
            of = f", share {share + 1} of {len(launches)}" if len(launches) > 1 else ""
            read, written = (tuple(f"{who} {queue}{of}" for queue in some) for some in (taken, made))
            work = Pass(f"{who}: {name}{of}", part, (*reads, *read), (*writes, *written), launched, effect)
            passes.append(work if queues.threaded else replace(work, hints=Hints(parallel=(share,)), adds=True))
    return passes
