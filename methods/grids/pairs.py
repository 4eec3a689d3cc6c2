"""(triangle, cell) pairs: count, scan, emit, radix sort by cell, cell lists. Kalojanov & Slusallek 2009.

One thread per triangle counts its cells; an int64 scan gives each triangle its place and the total, which is what
the frame *needs*; writers check the capacity and drop nothing silently, because the harness reads the need and
repeats the frame with more room. The sort runs at capacity (its length is fixed in a captured graph); unused
places carry the key ``cells``, which sorts behind every real one.
"""

import warp as wp

from ..common.pairs import need_kernel


@wp.kernel(enable_backward=False)
def mark_lists_kernel(
    cells: wp.int32, keys: wp.array(dtype=wp.int32), begin: wp.array(dtype=wp.int32), end: wp.array(dtype=wp.int32)
):
    i = wp.tid()
    cell = keys[i]
    if cell >= cells:
        return
    if i == 0 or keys[i - 1] != cell:
        begin[cell] = i
    if i == keys.shape[0] // 2 - 1 or keys[i + 1] != cell:
        end[cell] = i + 1


class PairList:
    """Pairs of (cell, triangle) and the list of each cell, at fixed addresses.

    count  int64 [items]: cells of each item, written by the method's counting kernel
    scan   int64 [items]: inclusive scan of ``count``
    keys, values  int32 [2 * capacity]; ``keys.shape[0] // 2`` is the capacity
    begin, end    int32 [cells]: list of a cell is values[begin:end]; (0, 0) where it is empty
    """

    def __init__(self, items: int, cells: int, capacity: int, device: str):
        self.cells = cells
        self.device = device
        self.bits = max(1, int(cells).bit_length())
        self.capacity = max(1, capacity)
        with wp.ScopedDevice(device):
            self.count = wp.zeros(max(1, items), dtype=wp.int64)
            self.scan = wp.zeros(max(1, items), dtype=wp.int64)
            self.keys = wp.zeros(2 * self.capacity, dtype=wp.int32)
            self.values = wp.zeros(2 * self.capacity, dtype=wp.int32)
            self.begin = wp.zeros(cells, dtype=wp.int32)
            self.end = wp.zeros(cells, dtype=wp.int32)

    def launch_scan(self, need: wp.array, slot: int) -> None:
        """Scan the counts and write the total to ``need[slot]``; clear the keys for the emitting kernel."""
        wp.utils.array_scan(self.count, self.scan, inclusive=True)
        wp.launch(need_kernel, dim=1, inputs=[self.scan], outputs=[need, slot], device=self.device)
        self.keys.fill_(self.cells)

    def launch_sort(self) -> None:
        """Sort the pairs by cell; stable, so triangles stay in index order inside a cell."""
        wp.utils.radix_sort_pairs(self.keys, self.values, self.capacity, 0, self.bits)

    def launch_lists(self) -> None:
        """Mark where the list of each cell begins and ends."""
        self.begin.zero_()
        self.end.zero_()
        wp.launch(
            mark_lists_kernel,
            dim=self.capacity,
            inputs=[self.cells, self.keys],
            outputs=[self.begin, self.end],
            device=self.device,
        )


@wp.func
def pair_place(scan: wp.array(dtype=wp.int64), count: wp.array(dtype=wp.int64), i: wp.int32) -> wp.int64:
    """Where item ``i`` writes its first pair."""
    return scan[i] - count[i]
