"""Putting triangles into the cells of a tiled grid: one pass that finds and writes the pairs, then a sort by cell.

A triangle whose box covers at most :data:`INLINE_TILES` tiles is one thread's work. A larger one is queued in pieces,
and on a GPU every tile of a piece has a thread of its own (up to :data:`ENOUGH` per triangle), so that nothing waits for
one thread that visits the tiles of a whole image. A thread counts its pairs, reserves that many places, and writes them;
neither the queue's order nor the list's is the same from run to run, and answers depend on neither.

The sort, by (tile, slice) with the tile in the high bits, is the paper's radix sort or a counting sort: pairs are counted
per cell while they are written, which also gives each its number within its cell. Then only a scan of the counts is
missing. That is cheap as long as there are few cells compared with pairs.
"""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ....harness.frame.geometry import filled
from ...common.pairs import grown
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import reserve_many

INLINE_TILES = wp.constant(16)
LANES = 32
"""Threads of a queued piece on a GPU."""

THREAD_TILES = wp.constant(32)
"""Most tiles of one thread: what was found in them is stored in the bits of an int32."""

ENOUGH = wp.constant(2048)
"""Threads for one triangle, from which on each of them takes more tiles instead: all its pieces are queued by one."""

BIN_BLOCK = 128

MOST_COUNTED = 1 << 22
"""Most cells of a counting sort: beyond them clearing and scanning the counts costs more than a radix sort."""


@wp.struct
class PairSink:
    """Where pairs are written: lists in any order, and with a counting sort each pair's number in its cell.

    needs[slot]: pairs so far, also those beyond ``capacity``   counted: whether cells are counted
    """

    capacity: wp.int32
    counted: wp.bool
    slot: wp.int32
    needs: wp.array(dtype=wp.int64)
    keys: wp.array(dtype=wp.int32)
    values: wp.array(dtype=wp.int32)
    ranks: wp.array(dtype=wp.int32)
    cell_count: wp.array(dtype=wp.int32)


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
class TileLists:
    """The list of each tile: values[begin[tile]:end[tile]] are triangles; their cells are ``keys``, front slices first."""

    begin: wp.array(dtype=wp.int32)
    end: wp.array(dtype=wp.int32)
    keys: wp.array(dtype=wp.int32)
    values: wp.array(dtype=wp.int32)


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
def write_pair(place: wp.int64, cell: wp.int32, triangle: wp.int32, out: PairSink):
    if place < wp.int64(out.capacity):
        at = wp.int32(place)
        set_entry(out.keys, at, cell)
        set_entry(out.values, at, triangle)
        if out.counted:
            set_entry(out.ranks, at, wp.atomic_add(out.cell_count, cell, 1))


@wp.kernel(enable_backward=False, grid_stride=False)
def clear_need_kernel(slot: wp.int32, needs: wp.array(dtype=wp.int64)):
    needs[slot] = wp.int64(0)


@wp.kernel(enable_backward=False, grid_stride=False)
def place_pairs_kernel(
    tiles: wp.int32,
    slices: wp.int32,
    pairs: PairSink,
    cell_end: wp.array(dtype=wp.int32),
    lists: TileLists,
):
    """The counting sort's last step: every pair to its cell; and the run of each tile.

    Where pairs did not fit, all lists are empty: the frame is discarded, and tracing it could take very long.
    """
    i = wp.tid()
    needed = pairs.needs[pairs.slot]
    if i < tiles:
        first = wp.int32(0)
        last = wp.int32(0)
        if needed <= wp.int64(pairs.capacity):
            last = cell_end[(i + 1) * slices - 1]
            if i > 0:
                first = cell_end[i * slices - 1]
        lists.begin[i] = first
        lists.end[i] = last
    if i < pairs.capacity and wp.int64(i) < needed:
        cell = entry(pairs.keys, i)
        at = entry(cell_end, cell) - entry(pairs.cell_count, cell) + entry(pairs.ranks, i)
        set_entry(lists.keys, at, cell)
        set_entry(lists.values, at, entry(pairs.values, i))


@wp.kernel(enable_backward=False, grid_stride=False)
def drop_lists_kernel(pairs: PairSink, lists: TileLists):
    """The same for pairs that a radix sort has put in order."""
    tile = wp.tid()
    if pairs.needs[pairs.slot] > wp.int64(pairs.capacity):
        lists.begin[tile] = 0
        lists.end[tile] = 0


@wp.kernel(enable_backward=False, grid_stride=False)
def mark_tiles_kernel(
    tiles: wp.int32,
    slices: wp.int32,
    length: wp.int32,
    keys: wp.array(dtype=wp.int32),
    begin: wp.array(dtype=wp.int32),
    end: wp.array(dtype=wp.int32),
):
    """Where the run of each tile begins and ends in ``length`` sorted keys tile * slices + slice."""
    i = wp.tid()
    tile = keys[i] // slices
    if tile >= tiles:
        return
    if i == 0 or keys[i - 1] // slices != tile:
        begin[tile] = i
    if i == length - 1 or keys[i + 1] // slices != tile:
        end[tile] = i + 1


class TileBins:
    """Cells of one grid: the box of tiles of each item, queued pieces of rows, pairs, and the list of each tile.

    An item is a triangle (in a cube of six rectangles: a triangle in one of them).

    boxes   vec4i [items]: first column, first row, last column, last row; empty if last < first
    queue   :class:`PieceQueue`
    pairs   :class:`PairSink`, before the sort
    lists   :class:`TileLists`, after it: begin, end int32 [tiles]; keys (tile * slices + slice), values int32 [capacity]
    ``slot`` and ``slot + 1`` of ``needs`` hold the pairs and the queued pieces that the last frame needed.
    """

    def __init__(
        self,
        items: int,
        tiles: int,
        slices: int,
        capacity: tuple[int, ...],
        needs: wp.array,
        slot: int,
        sort: str,
        device: str,
    ):
        self.items = max(1, items)
        self.tiles, self.slices, self.cells = tiles, slices, tiles * slices
        self.bits = max(1, self.cells.bit_length())
        self.device = device
        self.needs, self.slot = needs, slot
        self.capacity = max(1, capacity[0])
        self.counted = sort == "counting" and self.cells <= MOST_COUNTED
        # A radix sort works in place, in arrays twice as long as what they sort.
        length = self.capacity if self.counted else 2 * self.capacity
        with wp.ScopedDevice(device):
            self.boxes = wp.zeros(self.items, dtype=wp.vec4i)
            self.queue = filled(
                PieceQueue,
                lanes=LANES if wp.get_device(device).is_cuda else 1,
                slot=slot + 1,
                needs=needs,
                pieces=wp.zeros(max(1, capacity[1]), dtype=wp.vec2i),
            )
            self.lists = filled(
                TileLists,
                begin=wp.zeros(tiles, dtype=wp.int32),
                end=wp.zeros(tiles, dtype=wp.int32),
                keys=wp.zeros(length, dtype=wp.int32),
                values=wp.zeros(length, dtype=wp.int32),
            )
            self.cell_end = wp.zeros(self.cells if self.counted else 1, dtype=wp.int32)
            self.pairs = filled(
                PairSink,
                capacity=self.capacity,
                counted=self.counted,
                slot=slot,
                needs=needs,
                keys=wp.zeros(length, dtype=wp.int32) if self.counted else self.lists.keys,
                values=wp.zeros(length, dtype=wp.int32) if self.counted else self.lists.values,
                ranks=wp.zeros(length if self.counted else 1, dtype=wp.int32),
                cell_count=wp.zeros(self.cells if self.counted else 1, dtype=wp.int32),
            )

    @property
    def threads(self) -> int:
        """Threads of a kernel that takes its work from :func:`piece_of`."""
        return self.items + self.queue.pieces.shape[0] * self.queue.lanes

    def clear_queue(self) -> None:
        """Before the kernel that makes the boxes and queues the large ones."""
        wp.launch(clear_need_kernel, dim=1, inputs=[self.slot + 1], outputs=[self.needs], device=self.device)

    def clear_pairs(self) -> None:
        """Before the kernel that writes the pairs."""
        wp.launch(clear_need_kernel, dim=1, inputs=[self.slot], outputs=[self.needs], device=self.device)
        if self.counted:
            self.pairs.cell_count.zero_()
        else:
            self.lists.keys.fill_(self.cells)

    def launch_sort(self) -> None:
        """Sort the pairs by cell and mark the run of each tile."""
        if self.counted:
            wp.utils.array_scan(self.pairs.cell_count, self.cell_end, inclusive=True)
            wp.launch(
                place_pairs_kernel,
                dim=max(self.capacity, self.tiles),
                inputs=[self.tiles, self.slices, self.pairs, self.cell_end],
                outputs=[self.lists],
                device=self.device,
            )
            return
        lists = self.lists
        wp.utils.radix_sort_pairs(lists.keys, lists.values, self.capacity, 0, self.bits)
        lists.begin.zero_()
        lists.end.zero_()
        wp.launch(
            mark_tiles_kernel,
            dim=self.capacity,
            inputs=[self.tiles, self.slices, self.capacity, lists.keys],
            outputs=[lists.begin, lists.end],
            device=self.device,
        )
        wp.launch(
            drop_lists_kernel,
            dim=self.tiles,
            inputs=[self.pairs],
            outputs=[lists],
            device=self.device,
        )


def grown_bins(
    needed: NDArray[np.int64], capacity: tuple[int, int, int], memory: int
) -> tuple[int, int, int]:
    """The new capacities (pairs, rows, items). Raises CapacityRejected beyond ``memory`` bytes."""
    return (
        grown(int(needed[0]), capacity[0], memory, "(triangle, cell) pairs"),
        grown(int(needed[1]), capacity[1], memory, "(large triangle, tiles) items"),
        grown(int(needed[2]), capacity[2], memory, "(ray chunk, triangle chunk) items"),
    )
