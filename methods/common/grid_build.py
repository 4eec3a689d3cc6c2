"""The passes that build one grid over all triangles: place, count, scan, emit, sort, lists."""

from __future__ import annotations

import warp as wp

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.schedule.passes import Pass
from .bounds import launch_bounds
from .grid import Grid, place_grid_kernel
from .grid_binning import LANES, LARGE_AT_ONCE, LargeItems, Pairs, bin_kernel, bin_large_kernel
from .pairs import PairList

CELL_BYTES = 8
MOST_CELLS = 1 << 28


def cells_for(triangles: int, density: float, memory: int) -> int:
    """The number of cells at ``density`` cells per triangle. Raises CapacityRejected if their lists exceed ``memory``
    bytes."""
    cells = min(MOST_CELLS, max(1, int(triangles * density)))
    refuse_cells(cells, memory)
    return cells


def refuse_cells(cells: int, memory: int) -> None:
    """Raise CapacityRejected if the lists of ``cells`` cells exceed ``memory`` bytes."""
    if cells * CELL_BYTES > memory:
        raise CapacityRejected(f"needs {cells:,} cells ({cells * CELL_BYTES / 2**30:.1f} GiB)")


class BinnedItems:
    """Arrays of items that are binned: the pairs, and the queue of large ones.

    lanes, at_once  how many threads share a large item, and how many large items are worked on at the same time
    """

    def __init__(self, items: int, cells: int, capacity: int, device: str):
        self.list = PairList(items, cells, capacity, device)
        pairs = self.list
        self.lanes, self.at_once = (1, 1) if wp.get_device(device).is_cpu else (LANES, LARGE_AT_ONCE)
        with wp.ScopedDevice(device):
            self.large = filled(
                LargeItems, size=wp.zeros(1, dtype=wp.int32), items=wp.zeros(items, dtype=wp.int32),
                cursor=wp.zeros(items, dtype=wp.int32),
            )  # fmt: skip
        self.pairs = filled(Pairs, count=pairs.count, scan=pairs.scan, keys=pairs.keys, values=pairs.values)


class TriangleGrid:
    """One grid over all triangles of a frame, rebuilt in the graph: the resources "grid", "cells", "sorted pairs".

    grid    Grid [1]
    binned  its pairs: the triangles of a cell are values[begin[cell]:end[cell]], in index order
    """

    def __init__(self, frame: Frame, cells: int, capacity: int):
        self._frame = frame
        self.binned = BinnedItems(frame.triangle_count, cells, capacity, frame.device)
        with wp.ScopedDevice(frame.device):
            self.box = wp.zeros(6, dtype=wp.float32)
            self.grid = wp.zeros(1, dtype=Grid)

    def passes(self, need: wp.array, slot: int) -> list[Pass]:
        """The passes. The number of pairs is written to ``need[slot]``."""
        pairs, geometry = self.binned.list, ("points", "triangles")
        return [
            Pass("place grid", "build", (*geometry, "max_coordinate"), ("grid",), self._place),
            Pass("count pairs", "build", (*geometry, "grid"), ("pair counts",), lambda: self._count(need, slot)),
            Pass("emit pairs", "build", (*geometry, "grid", "pair counts"), ("pairs",), self._emit),
            Pass("sort pairs", "build", ("pairs",), ("sorted pairs",), pairs.launch_sort),
            Pass("cell lists", "build", ("sorted pairs",), ("cells",), pairs.launch_lists),
        ]  # fmt: skip

    def _place(self) -> None:
        launch_bounds(self._frame, self.box)
        wp.launch(
            place_grid_kernel,
            dim=1,
            inputs=[self.binned.list.cells, self.box, self._frame.max_coordinate],
            outputs=[self.grid],
            device=self._frame.device,
        )

    def _bin(self, emit: bool) -> None:
        frame, b = self._frame, self.binned
        wp.launch(
            bin_kernel,
            dim=frame.triangle_count,
            inputs=[emit, self.grid, frame.mesh],
            outputs=[b.pairs, b.large],
            device=frame.device,
        )
        wp.launch(
            bin_large_kernel,
            dim=(b.at_once, b.lanes),
            inputs=[emit, b.lanes, b.at_once, self.grid, frame.mesh],
            outputs=[b.pairs, b.large],
            device=frame.device,
        )

    def _count(self, need: wp.array, slot: int) -> None:
        self.binned.large.size.zero_()
        self._bin(emit=False)
        self.binned.list.launch_scan(need, slot)

    def _emit(self) -> None:
        self._bin(emit=True)
