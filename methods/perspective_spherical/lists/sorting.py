"""Sorting (cell, value) pairs by cell, so that each tile has a list: of triangles by slice, or of rays.

The key is (tile, slice) with the tile in the high bits. The sort is the paper's radix sort or a counting sort: pairs are
counted per cell while they are written, which also gives each its number within its cell. Then only a scan of the counts
is missing. That is cheap as long as there are few cells compared with pairs.
"""

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...common.pairs import zeroed
from ...gpu.entries import entry, set_entry

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
class TileLists:
    """The list of each tile: values[begin[tile]:end[tile]]; their cells are ``keys``, front slices first."""

    begin: wp.array(dtype=wp.int32)
    end: wp.array(dtype=wp.int32)
    keys: wp.array(dtype=wp.int32)
    values: wp.array(dtype=wp.int32)


@wp.func
def put_pair(place: wp.int64, cell: wp.int32, value: wp.int32, out: PairSink):
    """Write a pair, and count its cell, unless it is beyond the capacity."""
    if place < wp.int64(out.capacity):
        at = wp.int32(place)
        set_entry(out.keys, at, cell)
        set_entry(out.values, at, value)
        if out.counted:
            set_entry(out.ranks, at, wp.atomic_add(out.cell_count, cell, 1))


@wp.kernel(enable_backward=False, grid_stride=False)
def place_pairs_kernel(
    tiles: wp.int32, slices: wp.int32, pairs: PairSink, cell_end: wp.array(dtype=wp.int32), lists: TileLists
):
    """The counting sort's last step: every pair to its cell; and the run of each tile. Pairs of no tile are left out.

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
        if cell < tiles * slices:
            at = entry(cell_end, cell) - entry(pairs.cell_count, cell) + entry(pairs.ranks, i)
            set_entry(lists.keys, at, cell)
            set_entry(lists.values, at, entry(pairs.values, i))


@wp.kernel(enable_backward=False, grid_stride=False)
def mark_tiles_kernel(tiles: wp.int32, slices: wp.int32, pairs: PairSink, lists: TileLists):
    """The same for pairs that a radix sort has put in order: the run of each tile, which was empty."""
    i = wp.tid()
    tile = lists.keys[i] // slices
    if tile >= tiles or pairs.needs[pairs.slot] > wp.int64(pairs.capacity):
        return
    if i == 0 or lists.keys[i - 1] // slices != tile:
        lists.begin[tile] = i
    if i == pairs.capacity - 1 or lists.keys[i + 1] // slices != tile:
        lists.end[tile] = i + 1


class TileSort:
    """Pairs of (tile * slices + slice, value), and the list of each tile.

    pairs   :class:`PairSink`, before the sort; keys from ``cells`` on belong to no tile
    lists   :class:`TileLists`, after it: begin, end int32 [tiles]; keys, values int32 [capacity]
    """

    def __init__(self, tiles: int, slices: int, capacity: int, needs: wp.array, slot: int, sort: str, device: str):
        self.tiles, self.slices, self.cells = tiles, slices, tiles * slices
        self.capacity, self.device = max(1, capacity), device
        self.counted = sort == "counting" and self.cells <= MOST_COUNTED
        # A radix sort works in place, in arrays twice as long as what they sort; a counting sort from one into another.
        length = self.capacity if self.counted else 2 * self.capacity
        cells, unsorted = (self.cells, length) if self.counted else (1, 1)
        with wp.ScopedDevice(device):
            self.lists = lists = zeroed(TileLists, length, begin=tiles, end=tiles)
            self._cell_end = wp.zeros(cells, dtype=wp.int32)
            in_place = {} if self.counted else {"keys": lists.keys, "values": lists.values}
            self.pairs = zeroed(
                PairSink, unsorted, capacity=self.capacity, counted=self.counted, slot=slot, needs=needs,
                cell_count=cells, **in_place,
            )  # fmt: skip

    def lengths(self) -> NDArray[np.int32]:
        """Of the lists. Reads back."""
        return self.lists.end.numpy() - self.lists.begin.numpy()

    def clear(self) -> None:
        """Before the kernel that writes the pairs."""
        if self.counted:
            self.pairs.cell_count.zero_()
        else:
            self.lists.keys.fill_(self.cells)

    def launch_sort(self) -> None:
        """Sort the pairs by cell and mark the run of each tile."""
        lists, sizes = self.lists, [self.tiles, self.slices, self.pairs]
        if self.counted:
            wp.utils.array_scan(self.pairs.cell_count, self._cell_end, inclusive=True)
            dim = max(self.capacity, self.tiles)
            inputs = [*sizes, self._cell_end]
            wp.launch(place_pairs_kernel, dim=dim, inputs=inputs, outputs=[lists], device=self.device)
            return
        wp.utils.radix_sort_pairs(lists.keys, lists.values, self.capacity, 0, self.cells.bit_length())
        lists.begin.zero_()
        lists.end.zero_()
        wp.launch(mark_tiles_kernel, dim=self.capacity, inputs=sizes, outputs=[lists], device=self.device)
