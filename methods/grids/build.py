"""The kernels that bin triangles into grids, and the passes that build one grid over all of them: place, count, scan,
emit, sort, lists.
"""

# Annotations are evaluated here: the struct is an argument of the factory, which Warp could not look up by its name.

import functools
from typing import Any

import numpy as np
import warp as wp

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Mesh, corners_of, filled
from ...harness.frame.schedule.passes import Pass
from ..common.bounds import launch_bounds
from .binning import BinItem, LargeItems, Pairs, bin_columns, bin_item
from .grid import Grid, place_grid_kernel
from .pairs import PairList

CELL_BYTES = 8
MOST_CELLS = 1 << 28

LANES = 1024
"""Threads that share one large triangle on CUDA."""

LARGE_AT_ONCE = 128
"""Large triangles worked on at the same time on CUDA."""

GRIDS = wp.array(dtype=Grid)
"""The type of an array of grids: one object, by which kernels are kept (:func:`make_bin_kernels`)."""


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


@functools.cache
def make_bin_kernels(structure_type: Any, item_of: Any) -> tuple[Any, Any]:
    """The kernel over all items, and that over the queue of large ones, whose columns ``lanes`` threads share.

    ``item_of(structure, mesh, item)`` is a function of Warp that returns the :class:`.binning.BinItem`.
    """

    @wp.kernel(enable_backward=False, module="unique")
    def bin_kernel(emit: wp.bool, structure: structure_type, mesh: Mesh, pairs: Pairs, large: LargeItems):
        item = wp.tid()
        what = item_of(structure, mesh, item)
        if what.triangle < 0:
            if not emit:
                pairs.count[item] = wp.int64(0)
            return
        bin_item(emit, item, what, corners_of(mesh, what.triangle), pairs, large)

    @wp.kernel(enable_backward=False, module="unique")
    def bin_large_kernel(
        emit: wp.bool,
        lanes: wp.int32,
        at_once: wp.int32,
        structure: structure_type,
        mesh: Mesh,
        pairs: Pairs,
        large: LargeItems,
    ):
        group, lane = wp.tid()
        slot = wp.int32(group)
        while slot < large.size[0]:
            item = large.items[slot]
            what = item_of(structure, mesh, item)
            bin_columns(emit, slot, lane, lanes, item, what, corners_of(mesh, what.triangle), pairs, large)
            slot += at_once

    return bin_kernel, bin_large_kernel


class BinnedItems:
    """Items that are binned: their pairs, and the queue of large ones. See :func:`make_bin_kernels`."""

    def __init__(self, items: int, cells: int, capacity: int, frame: Frame, structure_type: Any, item_of: Any):
        self._frame, self._kernels = frame, make_bin_kernels(structure_type, item_of)
        self.list = pairs = PairList(items, cells, capacity, frame.device)
        with wp.ScopedDevice(frame.device):
            self.large = filled(
                LargeItems, size=wp.zeros(1, dtype=wp.int32), items=wp.zeros(items, dtype=wp.int32),
                cursor=wp.zeros(items, dtype=wp.int32),
            )  # fmt: skip
        self._pairs = filled(Pairs, count=pairs.count, scan=pairs.scan, keys=pairs.keys, values=pairs.values)

    def launch_count(self, structure: Any, need: wp.array, slot: int) -> None:
        """Count the pairs of every item, and scan; their number is written to ``need[slot]``."""
        self.large.size.zero_()
        self._launch(False, structure)
        self.list.launch_scan(need, slot)

    def launch_emit(self, structure: Any) -> None:
        """Write the pairs that were counted."""
        self._launch(True, structure)

    def _launch(self, emit: bool, structure: Any) -> None:
        one, many = self._kernels
        mesh, device = self._frame.mesh, self._frame.device
        at_once, lanes = (1, 1) if wp.get_device(device).is_cpu else (LARGE_AT_ONCE, LANES)
        outputs = [self._pairs, self.large]
        items = self.large.items.shape[0]
        wp.launch(one, dim=items, inputs=[emit, structure, mesh], outputs=outputs, device=device)
        inputs = [emit, lanes, at_once, structure, mesh]
        wp.launch(many, dim=(at_once, lanes), inputs=inputs, outputs=outputs, device=device)


@wp.func
def whole_triangle(grid: wp.array(dtype=Grid), mesh: Mesh, item: wp.int32) -> BinItem:
    """Every valid triangle into one grid; its item is its index."""
    what = BinItem()
    what.grid = grid[0]
    what.triangle = wp.where(mesh.valid[item] == wp.uint8(0), -1, item)
    return what


class TriangleGrid:
    """One grid over all triangles of a frame, rebuilt in the graph: the resources "grid", "cells", "sorted pairs".

    grid    Grid [1]
    binned  its pairs: the triangles of a cell are values[begin[cell]:end[cell]], in index order
    """

    RESOURCES = ("cells", "sorted pairs", "grid")

    def __init__(self, frame: Frame, cells: int, capacity: int):
        self._frame = frame
        self.binned = BinnedItems(frame.triangle_count, cells, capacity, frame, GRIDS, whole_triangle)
        with wp.ScopedDevice(frame.device):
            self.box = wp.zeros(6, dtype=wp.float32)
            self.grid = wp.zeros(1, dtype=Grid)

    def passes(self, need: wp.array, slot: int) -> list[Pass]:
        """The passes. The number of pairs is written to ``need[slot]``."""
        binned, geometry = self.binned, ("points", "triangles")
        return [
            Pass("place grid", "build", (*geometry, "max_coordinate"), ("grid",), self._place),
            Pass(
                "count pairs", "build", (*geometry, "grid"), ("pair counts",),
                lambda: binned.launch_count(self.grid, need, slot),
            ),
            Pass(
                "emit pairs", "build", (*geometry, "grid", "pair counts"), ("pairs",),
                lambda: binned.launch_emit(self.grid),
            ),
            Pass("sort pairs", "build", ("pairs",), ("sorted pairs",), binned.list.launch_sort),
            Pass("cell lists", "build", ("sorted pairs",), ("cells",), binned.list.launch_lists),
        ]  # fmt: skip

    def _place(self) -> None:
        launch_bounds(self._frame, self.box)
        inputs = [self.binned.list.cells, self.box, self._frame.max_coordinate]
        self._frame.launch(place_grid_kernel, 1, inputs, [self.grid])

    def counters(self) -> dict[str, int]:
        """Of the last frame."""
        lists = self.binned.list
        lengths = lists.end.numpy() - lists.begin.numpy()
        return {
            "cells": int(np.prod(self.grid.numpy()["res"][0].astype(np.int64))),
            "pairs": int(lengths.sum()),
            "occupied cells": int(np.count_nonzero(lengths)),
            "longest list": int(lengths.max()),
            "large triangles": int(self.binned.large.size.numpy()[0]),
        }
