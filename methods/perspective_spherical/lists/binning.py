"""Putting triangles into the cells of a tiled grid: one pass that finds and writes the pairs, then a sort by cell.

A triangle whose box covers at most :data:`INLINE_TILES` tiles is one thread's work. A larger one is queued in pieces,
and on a GPU every tile of a piece has a thread of its own (up to :data:`ENOUGH` per triangle), so that nothing waits for
one thread that visits the tiles of a whole image. A thread counts its pairs, reserves that many places, and writes them;
neither the queue's order nor the list's is the same from run to run, and answers depend on neither.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ....harness.frame.frame import Frame
from ....harness.scene.effects import Effects
from ...common.pairs import grown, zeroed
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import reserve_many
from ..parameters import TRIANGLE_TESTS, Build, Trace
from .sorting import PairSink, TileSort, put_pair

INLINE_TILES = wp.constant(16)
LANES = 32
"""Threads of a queued piece on a GPU."""

THREAD_TILES = wp.constant(32)
"""Most tiles of one thread: what was found in them is stored in the bits of an int32."""

ENOUGH = wp.constant(2048)
"""Threads for one triangle, from which on each of them takes more tiles instead: all its pieces are queued by one."""

BIN_BLOCK = 128


@wp.struct
class PieceQueue:
    """Pieces of large items: pieces vec2i [row_capacity], each (item, first tile of its box); ``needs[slot]`` of them.

    lanes  threads of a piece
    """

    lanes: wp.int32
    slot: wp.int32
    needs: wp.array(dtype=wp.int64)
    pieces: wp.array(dtype=wp.vec2i)


@wp.struct
class Bins:
    """Where items go: boxes vec4i [items] of tiles (first column, first row, last column, last row; empty if last < first),
    the queue of large ones, the pairs.
    """

    boxes: wp.array(dtype=wp.vec4i)
    queue: PieceQueue
    pairs: PairSink


@wp.struct
class Piece:
    """One thread's tiles: numbers ``first``, ``first + step`` ... below ``stop`` of item's box, row by row.

    item: -1 for nothing to do   x, y, w: the box's first column and row, and its width
    """

    item: wp.int32
    x: wp.int32
    y: wp.int32
    w: wp.int32
    first: wp.int32
    stop: wp.int32
    step: wp.int32


@wp.func
def piece_size(tiles: wp.int32, lanes: wp.int32) -> wp.int32:
    """Tiles of a queued piece of a box: per thread as many as keep the pieces few and fit into the bits of an int32."""
    if lanes == 1:
        return THREAD_TILES
    return lanes * wp.clamp((tiles + ENOUGH - 1) // ENOUGH, 1, THREAD_TILES)


@wp.func
def queue_large(item: wp.int32, box: wp.vec4i, queue: PieceQueue):
    """Queue every piece of ``box``. Beyond the capacity only counted; the harness repeats the frame."""
    tiles = (box[2] - box[0] + 1) * (box[3] - box[1] + 1)
    if tiles <= INLINE_TILES:
        return
    size = piece_size(tiles, queue.lanes)
    number = (tiles + size - 1) // size
    first = reserve_many(queue.needs, queue.slot, number)
    for j in range(number):
        place = first + wp.int64(j)
        if place < wp.int64(queue.pieces.shape[0]):
            set_entry(queue.pieces, wp.int32(place), wp.vec2i(item, j * size))


@wp.func
def piece_of(thread: wp.int32, bins: Bins) -> Piece:
    """The work of a thread: first one each for the items, then ``queue.lanes`` for each queued piece."""
    boxes = bins.boxes
    queue = bins.queue
    p = Piece()
    p.item = -1
    p.step = 1
    item = thread
    k = (thread - boxes.shape[0]) // queue.lanes
    if thread >= boxes.shape[0]:
        if k >= queue.pieces.shape[0] or wp.int64(k) >= queue.needs[queue.slot]:
            return p
        item = entry(queue.pieces, k)[0]
    box = entry(boxes, item)
    p.x = box[0]
    p.y = box[1]
    p.w = box[2] - box[0] + 1
    tiles = p.w * (box[3] - box[1] + 1)
    if thread >= boxes.shape[0]:
        p.item = item
        begin = entry(queue.pieces, k)[1]
        p.first = begin + (thread - boxes.shape[0]) % queue.lanes
        p.stop = wp.min(tiles, begin + piece_size(tiles, queue.lanes))
        p.step = queue.lanes
    elif box[2] >= box[0] and tiles <= INLINE_TILES:
        p.item = item
        p.stop = tiles
    return p


@wp.func
def write_pairs(
    slices_of: wp.Function, work: Any, p: Piece, tiles: wp.vec2i, slices: wp.int32, value: wp.int32, out: PairSink
):  # fmt: skip
    """Write the pairs of one piece of work: count them, reserve their places, find them again.

    ``slices_of(work, column, row, known)`` is the first and last slice in a tile, last < first for none; ``known``: the
    tile was found to hold the item. ``tiles``: the first tile of the item's rectangle, and tiles in a row of it.
    """
    number = wp.int32(0)
    hits = wp.int32(0)
    kept_at = wp.int32(-1)
    kept = wp.vec2i(0, -1)
    for at in range(p.first, p.stop, p.step):
        found = slices_of(work, p.x + at % p.w, p.y + at // p.w, False)
        if found[1] >= found[0]:
            number += found[1] - found[0] + 1
            hits = hits | (1 << ((at - p.first) // p.step))
            kept_at = at
            kept = found
    if number == 0:
        return
    place = reserve_many(out.needs, out.slot, number)
    for at in range(p.first, p.stop, p.step):
        if (hits >> ((at - p.first) // p.step)) & 1 != 0:
            column = p.x + at % p.w
            row = p.y + at // p.w
            found = kept
            if at != kept_at:
                found = slices_of(work, column, row, True)
            cell = (tiles[0] + row * tiles[1] + column) * slices
            for slice in range(found[0], found[1] + 1):
                put_pair(place, cell + slice, value, out)
                place += wp.int64(1)


@dataclass(frozen=True, eq=False)
class GridSettings:
    """What a grid is made for.

    outward   how faces are wound, for culling (:func:`..culling.faces_away`); 0 keeps back faces
    capacity  room for pairs, for queued pieces of large triangles, and for items of split lists
    needs     int64: from ``slot`` on, what the last frame needed of each
    """

    frame: Frame
    build: Build
    trace: Trace
    effects: Effects
    outward: float
    capacity: tuple[int, ...]
    needs: wp.array
    slot: int

    @property
    def test(self) -> int:
        """The number of the triangle test."""
        return TRIANGLE_TESTS.index(self.build.triangle_test)


class TileBins(TileSort):
    """Cells of one grid, and what is put into them. An item is a triangle (in a cube of six rectangles: in one of them)."""

    def __init__(self, items: int, tiles: int, slices: int, settings: GridSettings):
        needs, slot, device = settings.needs, settings.slot, settings.frame.device
        super().__init__(tiles, slices, settings.capacity[0], needs, slot, settings.build.sort, device)
        self.items = max(1, items)
        lanes = LANES if wp.get_device(device).is_cuda else 1
        with wp.ScopedDevice(device):
            queue = zeroed(PieceQueue, max(1, settings.capacity[1]), lanes=lanes, slot=slot + 1, needs=needs)
            self.bins = zeroed(Bins, self.items, queue=queue, pairs=self.pairs)
        self._written, self._queued = needs[slot : slot + 1], needs[slot + 1 : slot + 2]
        self.threads = self.items + queue.pieces.shape[0] * lanes
        """Of a kernel that takes its work from :func:`piece_of`."""

    def clear_queue(self) -> None:
        """Before the kernel that makes the boxes and queues the large ones."""
        self._queued.zero_()

    def clear_pairs(self) -> None:
        """Before the kernel that writes the pairs."""
        self._written.zero_()
        self.clear()


ROOMS = ("(triangle, cell) pairs", "(large triangle, tiles) items", "(ray chunk, triangle chunk) items")


def grown_bins(needed: NDArray[np.int64], capacity: tuple[int, ...], memory: int) -> tuple[int, ...]:
    """The new capacities of a grid. Raises CapacityRejected beyond ``memory`` bytes."""
    rooms = zip(needed, capacity, ROOMS, strict=True)
    return tuple(grown(int(need), room, memory, what) for need, room, what in rooms)
