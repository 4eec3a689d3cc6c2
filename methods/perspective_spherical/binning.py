"""Putting triangles into the cells of a tiled grid: small ones by their own thread, large ones by rows of tiles.

Both grids of the method (camera and light) bin in the same five steps; only their kernels differ. A triangle
whose box covers more than :data:`INLINE_TILES` tiles is queued as (triangle, row) items, so that one thread
never walks a whole screen of tiles. The order of that queue varies from run to run; answers do not depend on it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..common.pairs import PairList, grown, need_kernel

INLINE_TILES = wp.constant(16)
ROW_BYTES = 24
"""A queued row: two indices of four bytes, a count and a scan value of eight."""

COUNT, EMIT = 0, 1


@wp.func
def queue_rows(
    triangle: wp.int32,
    box: wp.vec4i,
    rows: wp.array(dtype=wp.vec2i),
    row_count: wp.array(dtype=wp.int64),
):
    """Queue every tile row of ``box``. Writers beyond the capacity count on; the harness repeats the frame."""
    number = box[3] - box[1] + 1
    first = wp.atomic_add(row_count, 0, wp.int64(number))
    for j in range(number):
        place = first + wp.int64(j)
        if place < wp.int64(rows.shape[0]):
            rows[wp.int32(place)] = wp.vec2i(triangle, box[1] + j)


@wp.kernel(enable_backward=False)
def mark_tiles_kernel(
    tiles: wp.int32,
    slices: wp.int32,
    keys: wp.array(dtype=wp.int32),
    begin: wp.array(dtype=wp.int32),
    end: wp.array(dtype=wp.int32),
):
    """Where the run of each tile begins and ends: keys are tile * slices + slice, tile in the high bits."""
    i = wp.tid()
    tile = keys[i] // slices
    if tile >= tiles:
        return
    if i == 0 or keys[i - 1] // slices != tile:
        begin[tile] = i
    if i == keys.shape[0] // 2 - 1 or keys[i + 1] // slices != tile:
        end[tile] = i + 1


class TilePairs(PairList):
    """(triangle, cell) pairs whose lists are runs of whole tiles, in them front slices first.

    begin, end  int32 [tiles]: the run of a tile is values[begin:end], its slices keys[j] % slices
    """

    def __init__(self, items: int, tiles: int, slices: int, capacity: int, device: str):
        super().__init__(items, 1, capacity, device)
        self.tiles, self.slices = tiles, slices
        self.cells = tiles * slices
        self.bits = max(1, self.cells.bit_length())
        with wp.ScopedDevice(device):
            self.begin = wp.zeros(tiles, dtype=wp.int32)
            self.end = wp.zeros(tiles, dtype=wp.int32)

    def launch_lists(self) -> None:
        """Mark where the run of each tile begins and ends."""
        self.begin.zero_()
        self.end.zero_()
        wp.launch(
            mark_tiles_kernel,
            dim=self.capacity,
            inputs=[self.tiles, self.slices, self.keys],
            outputs=[self.begin, self.end],
            device=self.device,
        )


class TileBins:
    """Cells of one grid: pairs of items and queued rows, and each item's box of tiles.

    An item is a triangle (in a cube of six rectangles: a triangle in one of them).

    boxes      vec4i [items]: first column, first row, last column, last row; empty if last < first
    rows       vec2i [row_capacity]: (item, row) of large items; row_count int64 [1]
    ``slot`` and ``slot + 1`` of ``needs`` hold the pairs and the rows that the last frame needed.
    """

    def __init__(
        self,
        items: int,
        tiles: int,
        slices: int,
        capacity: tuple[int, ...],
        needs: wp.array,
        slot: int,
        device: str,
    ):
        self.items = max(1, items)
        self.device = device
        self.needs, self.slot = needs, slot
        pair_capacity, row_capacity = capacity[:2]
        self.pairs = TilePairs(self.items + row_capacity, tiles, slices, pair_capacity, device)
        with wp.ScopedDevice(device):
            self.boxes = wp.zeros(self.items, dtype=wp.vec4i)
            self.rows = wp.zeros(row_capacity, dtype=wp.vec2i)
            self.row_count = wp.zeros(1, dtype=wp.int64)

    def launch_clear(self) -> None:
        """Before the kernel that makes the boxes and queues the rows."""
        self.row_count.zero_()

    def launch_count(self, small: Callable[[int], None], large: Callable[[int], None]) -> None:
        """Count the cells of every triangle and row, and scan."""
        small(COUNT)
        large(COUNT)
        self.pairs.launch_scan(self.needs, self.slot)
        wp.launch(
            need_kernel,
            dim=1,
            inputs=[self.row_count],
            outputs=[self.needs, self.slot + 1],
            device=self.device,
        )

    def launch_emit(self, small: Callable[[int], None], large: Callable[[int], None]) -> None:
        """Write the pairs."""
        small(EMIT)
        large(EMIT)

    def launch_sort(self) -> None:
        """Sort the pairs by cell and mark the lists."""
        self.pairs.launch_sort()
        self.pairs.launch_lists()


def grown_bins(
    needed: NDArray[np.int64], capacity: tuple[int, int, int], memory: int
) -> tuple[int, int, int]:
    """Capacities (pairs, rows, items) to go on with. Raises CapacityRejected beyond ``memory`` bytes."""
    return (
        grown(int(needed[0]), capacity[0], memory, "(triangle, cell) pairs"),
        grown(int(needed[1]), capacity[1], memory, "(large triangle, tile row) items"),
        grown(int(needed[2]), capacity[2], memory, "(ray chunk, triangle chunk) items"),
    )
