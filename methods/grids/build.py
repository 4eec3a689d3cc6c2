"""One grid over all triangles of a frame: its parameters, its size, and the passes that build it."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Mesh
from ...harness.frame.schedule.passes import Pass
from ..common.bounds import launch_bounds
from .binning import BinItem
from .grid import Grid, place_grid_kernel
from .pairs import BinnedItems

CELL_BYTES = 8
MOST_CELLS = 1 << 28

GRIDS = wp.array(dtype=Grid)
"""The type of an array of grids: one object, by which kernels are kept (:func:`.pairs.make_bin_kernels`)."""


@dataclass(frozen=True)
class Build:
    """How the grid is built.

    density   cells per triangle, divided among the axes in proportion to the scene's box; the default is lambda of
              Kalojanov & Slusallek
    capacity  initial capacity, (triangle, cell) pairs; 0: four per triangle; grows when a frame needs more
    """

    density: float = 5.0
    capacity: int = 0

    def __post_init__(self) -> None:
        if not 0.0 < self.density <= 1000.0:
            raise ValueError("density must lie between 0 and 1000 cells a triangle")
        if self.capacity < 0:
            raise ValueError("capacity must be 0 (automatic) or more pairs")


def cells_for(triangles: int, density: float, memory: int) -> int:
    """The number of cells at ``density`` cells per triangle. Raises CapacityRejected if their lists exceed ``memory``
    bytes.
    """
    cells = min(MOST_CELLS, max(1, int(triangles * density)))
    refuse_cells(cells, memory)
    return cells


def refuse_cells(cells: int, memory: int) -> None:
    """Raise CapacityRejected if the lists of ``cells`` cells exceed ``memory`` bytes."""
    if cells * CELL_BYTES > memory:
        raise CapacityRejected(f"needs {cells:,} cells ({cells * CELL_BYTES / 2**30:.1f} GiB)")


@wp.func
def whole_triangle(grid: wp.array(dtype=Grid), mesh: Mesh, item: wp.int32) -> BinItem:
    """Every valid triangle into one grid; its item is its index."""
    what = BinItem()
    what.grid = grid[0]
    what.triangle = wp.where(mesh.valid[item] == wp.uint8(0), -1, item)
    return what


class TriangleGrid(BinnedItems):
    """One grid over all triangles of a frame, rebuilt in the graph: the resources "grid", "cells", "sorted pairs".

    grid  Grid [1]     box  float32 [6]: the scene's
    """

    RESOURCES = ("cells", "sorted pairs", "grid")

    def __init__(self, frame: Frame, cells: int, capacity: int):
        super().__init__(frame.triangle_count, cells, capacity, frame, GRIDS, whole_triangle)
        with wp.ScopedDevice(frame.device):
            self.box = wp.zeros(6, dtype=wp.float32)
            self.grid = wp.zeros(1, dtype=Grid)

    def built(self, need: wp.array, slot: int) -> list[Pass]:
        """The passes. The number of pairs is written to ``need[slot]``."""
        geometry = ("points", "triangles")
        place = Pass("place grid", "build", (*geometry, "max_coordinate"), ("grid",), self._place)
        return [place, *self.passes("", (*geometry, "grid"), self.grid, need, slot)]

    def _place(self) -> None:
        launch_bounds(self._frame, self.box)
        self._frame.launch(place_grid_kernel, 1, [self.cells, self.box, self._frame.max_coordinate], [self.grid])

    def counters(self) -> dict[str, int]:
        """Of the last frame."""
        lengths = self.lengths()
        return {
            "cells": int(np.prod(self.grid.numpy()["res"][0].astype(np.int64))),
            "pairs": int(lengths.sum()),
            "occupied cells": int(np.count_nonzero(lengths)),
            "longest list": int(lengths.max()),
            "large triangles": int(self.large.size.numpy()[0]),
        }
