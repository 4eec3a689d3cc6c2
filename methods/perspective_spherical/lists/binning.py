"""Putting triangles into the cells of a tiled grid: one pass that finds and writes the pairs, then a sort by cell.

A triangle whose box covers at most :data:`INLINE_TILES` tiles is one thread's work. A larger one is queued in pieces,
and on a GPU every tile of a piece has a thread of its own (up to :data:`ENOUGH` per triangle), so that nothing waits for
one thread that visits the tiles of a whole image. A thread counts its pairs, reserves that many places, and writes them;
neither the queue's order nor the list's is the same from run to run, and answers depend on neither.
"""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ....harness.frame.geometry import filled
from ...common.pairs import grown
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import reserve_many
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
def piece_of(thread: wp.int32, boxes: wp.array(dtype=wp.vec4i), queue: PieceQueue) -> Piece:
    """The work of a thread: first one each for the items, then ``queue.lanes`` for each queued piece."""
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


class TileBins(TileSort):
    """Cells of one grid: the box of tiles of each item, queued pieces of large ones, and what :class:`TileSort` has.

    An item is a triangle (in a cube of six rectangles: a triangle in one of them).

    boxes   vec4i [items]: first column, first row, last column, last row; empty if last < first
    queue   :class:`PieceQueue`
    ``slot`` and ``slot + 1`` of ``needs`` hold the pairs and the queued pieces that the last frame needed.
    """

    def __init__(
        self, items: int, tiles: int, slices: int, capacity: tuple[int, ...], needs: wp.array, slot: int, sort: str,
        device: str,
    ):  # fmt: skip
        super().__init__(tiles, slices, capacity[0], needs, slot, sort, device)
        self.items = max(1, items)
        with wp.ScopedDevice(device):
            self.boxes = wp.zeros(self.items, dtype=wp.vec4i)
            self.queue = filled(
                PieceQueue,
                lanes=LANES if wp.get_device(device).is_cuda else 1,
                slot=slot + 1,
                needs=needs,
                pieces=wp.zeros(max(1, capacity[1]), dtype=wp.vec2i),
            )
        self._written, self._queued = needs[slot : slot + 1], needs[slot + 1 : slot + 2]

    @property
    def threads(self) -> int:
        """Threads of a kernel that takes its work from :func:`piece_of`."""
        return self.items + self.queue.pieces.shape[0] * self.queue.lanes

    def clear_queue(self) -> None:
        """Before the kernel that makes the boxes and queues the large ones."""
        self._queued.zero_()

    def clear_pairs(self) -> None:
        """Before the kernel that writes the pairs."""
        self._written.zero_()
        self.clear()


def grown_bins(needed: NDArray[np.int64], capacity: tuple[int, int, int], memory: int) -> tuple[int, int, int]:
    """The new capacities (pairs, rows, items). Raises CapacityRejected beyond ``memory`` bytes."""
    pairs, rows, items = capacity
    return (
        grown(int(needed[0]), pairs, memory, "(triangle, cell) pairs"),
        grown(int(needed[1]), rows, memory, "(large triangle, tiles) items"),
        grown(int(needed[2]), items, memory, "(ray chunk, triangle chunk) items"),
    )
