"""(triangle, cell) pairs: count, scan, emit, radix sort by cell, cell lists. Kalojanov & Slusallek 2009.

One thread per triangle counts its cells; an int64 scan gives each triangle its place and the total, which is what
the frame *needs*; writers check the capacity and drop nothing silently, because the harness reads the need and
repeats the frame with more room. The sort runs at capacity (its length is fixed in a captured graph); unused
places carry the key ``cells``, which sorts behind every real one.
"""

# Annotations are evaluated here: the struct is an argument of the factory, which Warp could not look up by its name.

import functools
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Mesh, corners_of
from ...harness.frame.schedule.passes import Pass
from ..common.pairs import need_kernel, zeroed
from .binning import LargeItems, Pairs, bin_cells, bin_item, span_of

LANES = 1024
"""Threads that share one large triangle on CUDA."""

LARGE_AT_ONCE = 128
"""Large triangles worked on at the same time on CUDA."""


@functools.cache
def make_bin_kernels(structure_type: Any, item_of: Any) -> tuple[Any, Any]:
    """The kernel over all items, and that over the queue of large ones, whose columns ``lanes`` threads share.

    ``item_of(structure, mesh, item)`` is a function of Warp that returns the :class:`.binning.BinItem`.
    """

    @wp.kernel(enable_backward=False, module="unique")
    def bin_kernel(emit: wp.bool, structure: structure_type, mesh: Mesh, pairs: Pairs, large: LargeItems):
        item = wp.tid()
        what = item_of(structure, mesh, item)
        if what.triangle >= 0:
            bin_item(emit, item, what, corners_of(mesh, what.triangle), pairs, large)
        elif not emit:
            pairs.count[item] = wp.int64(0)

    @wp.kernel(enable_backward=False, module="unique")
    def bin_large_kernel(
        emit: wp.bool, lanes: wp.int32, at_once: wp.int32, structure: structure_type, mesh: Mesh, pairs: Pairs,
        large: LargeItems,
    ):  # fmt: skip
        group, lane = wp.tid()
        slot = wp.int32(group)
        while slot < large.size[0]:
            item = large.items[slot]
            what = item_of(structure, mesh, item)
            s = span_of(what.grid, corners_of(mesh, what.triangle))
            found = bin_cells(emit, slot, lane, lanes, item, s, what, pairs, large)
            if not emit and found > wp.int64(0):
                wp.atomic_add(pairs.count, item, found)
            slot += at_once

    return bin_kernel, bin_large_kernel


@wp.kernel(enable_backward=False)
def mark_lists_kernel(cells: wp.int32, pairs: Pairs):
    i = wp.tid()
    cell = pairs.keys[i]
    if cell >= cells:
        return
    if i == 0 or pairs.keys[i - 1] != cell:
        pairs.begin[cell] = i
    if i == pairs.keys.shape[0] // 2 - 1 or pairs.keys[i + 1] != cell:
        pairs.end[cell] = i + 1


class BinnedItems:
    """Items that are binned into ``cells``, for kernels of :func:`make_bin_kernels`.

    pairs  :class:`.binning.Pairs`     large  :class:`.binning.LargeItems`
    """

    def __init__(self, items: int, cells: int, capacity: int, frame: Frame, structure_type: Any, item_of: Any):
        self._frame, self._kernels = frame, make_bin_kernels(structure_type, item_of)
        self.items, self.cells, self.capacity = items, cells, max(1, capacity)
        with wp.ScopedDevice(frame.device):
            room = 2 * self.capacity
            self.pairs = zeroed(Pairs, cells, count=items, scan=items, keys=room, values=room)
            self.large = zeroed(LargeItems, items, size=1)

    def passes(self, level: str, reads: tuple[str, ...], structure: Any, need: wp.array, slot: int) -> list[Pass]:
        """The passes from ``structure`` to lists; the number of pairs is written to ``need[slot]``.

        level  in their names, and in those of their resources: "" or "leaf "
        """
        counts, pairs, in_order = f"{level}pair counts", f"{level}pairs", f"sorted {level}pairs"

        def count() -> None:
            self.large.size.zero_()
            self._bin(False, structure)
            wp.utils.array_scan(self.pairs.count, self.pairs.scan, inclusive=True)
            self._frame.launch(need_kernel, 1, [self.pairs.scan], [need, slot])
            self.pairs.keys.fill_(self.cells)

        return [
            Pass(f"count {level}pairs", "build", reads, (counts,), count),
            Pass(f"emit {level}pairs", "build", (*reads, counts), (pairs,), lambda: self._bin(True, structure)),
            Pass(f"sort {level}pairs", "build", (pairs,), (in_order,), self._sort),
            Pass(f"{level or 'cell '}lists", "build", (in_order,), (f"{level}cells",), self._mark),
        ]

    def _bin(self, emit: bool, structure: Any) -> None:
        (one, many), frame = self._kernels, self._frame
        at_once, lanes = (1, 1) if wp.get_device(frame.device).is_cpu else (LARGE_AT_ONCE, LANES)
        arrays = [structure, frame.mesh, self.pairs, self.large]
        frame.launch(one, self.items, [emit, *arrays])
        wp.launch(many, dim=(at_once, lanes), inputs=[emit, lanes, at_once, *arrays], device=frame.device)

    def _sort(self) -> None:
        """By cell; stable, so triangles stay in index order inside a cell."""
        wp.utils.radix_sort_pairs(self.pairs.keys, self.pairs.values, self.capacity, 0, self.cells.bit_length())

    def _mark(self) -> None:
        self.pairs.begin.zero_()
        self.pairs.end.zero_()
        self._frame.launch(mark_lists_kernel, self.capacity, [self.cells, self.pairs])

    def lengths(self) -> NDArray[np.int32]:
        """Of the lists of the last frame."""
        return self.pairs.end.numpy() - self.pairs.begin.numpy()
