"""A grid of grids, rebuilt every frame by sorting: Kalojanov, Billeter & Slusallek 2011.

"Two-Level Grids for Ray Tracing on GPUs" (Eurographics): a top grid, a leaf grid in each of its cells, both by sorting;
then one traversal per ray.
"""

import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.schedule.passes import Pass
from ..grids.build import BinnedItems, TriangleGrid, cells_for, refuse_cells
from ..rays.structure import Built, RayStructure
from .leaves import TopCells, first_kernel, leaf_item, resolution_kernel
from .traversal import LeafCells, make_kernels

TOP, LEAF = 0, 1
"""Slots of the needs."""


@dataclass(frozen=True)
class Build:
    """How the two levels are built.

    top_density    cells of the top grid per triangle (lambda of the resolution rule)
    leaf_density   cells of a leaf grid per triangle of its top cell
    top_capacity   initial capacity, (triangle, top cell) pairs; 0: four per triangle; grows when a frame needs more
    leaf_capacity  initial capacity, (triangle, leaf cell) pairs; 0: eight per triangle; likewise
    """

    top_density: float = 0.12
    leaf_density: float = 2.4
    top_capacity: int = 0
    leaf_capacity: int = 0

    def __post_init__(self) -> None:
        for name, most in (("top_density", 1000.0), ("leaf_density", 100.0)):
            if not 0.0 < getattr(self, name) <= most:
                raise ValueError(f"{name} must lie between 0 and {most:g} cells a triangle")
        for name in ("top_capacity", "leaf_capacity"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must be 0 (automatic) or more pairs")


class TwoLevelGrid(RayStructure):
    """See the package. The need of the leaf level is known only once the top level has enough room."""

    name = "two_level_grid"
    title = "Two-level grid"
    ROOMS = ("(triangle, top cell) pairs", "(triangle, leaf cell) pairs")
    BUILT = ("top_density", "leaf_density")
    Build = Build

    def first_capacity(self, frame: Frame) -> list[int]:
        count = frame.triangle_count
        return [self.build.top_capacity or 4 * count, self.build.leaf_capacity or 8 * count]

    def structure(self, frame: Frame) -> Built:
        pairs = self._capacity[TOP]
        top_cells = cells_for(frame.triangle_count, self.build.top_density, self._memory)
        # A cell that holds n triangles gets at most max(1, density * n) leaf cells.
        leaf_cells = math.ceil(max(1.0, self.build.leaf_density) * pairs)
        refuse_cells(leaf_cells, min(self._memory, 2**33))
        self._top = TriangleGrid(frame, top_cells, pairs)
        self._leaf = BinnedItems(pairs, leaf_cells, self._capacity[LEAF], frame, TopCells, leaf_item)
        top, leaf = self._top.binned.list, self._leaf.list
        with wp.ScopedDevice(frame.device):
            self._leaf_counts = wp.zeros(top_cells, dtype=wp.int64)
            self._leaf_scan = wp.zeros(top_cells, dtype=wp.int64)
            self._res = wp.zeros(top_cells, dtype=wp.int32)
            self._first = wp.zeros(top_cells, dtype=wp.int32)
        self._cells = cells = filled(
            TopCells, grid=self._top.grid, begin=top.begin, end=top.end, keys=top.keys, members=top.values,
            cells=top_cells, res=self._res, first=self._first,
        )  # fmt: skip
        lists = filled(
            LeafCells, grid=self._top.grid, res=self._res, first=self._first, begin=leaf.begin, end=leaf.end,
            members=leaf.values,
        )  # fmt: skip
        geometry = ("points", "triangles", *TriangleGrid.RESOURCES, "leaf grids")
        passes = [
            *self._top.passes(self._need, TOP),
            Pass("leaf resolutions", "build", ("grid", "cells"), ("leaf grids",), self._resolve),
            Pass(
                "count leaf pairs", "build", geometry, ("leaf pair counts",),
                lambda: self._leaf.launch_count(cells, self._need, LEAF),
            ),
            Pass(
                "emit leaf pairs", "build", (*geometry, "leaf pair counts"), ("leaf pairs",),
                lambda: self._leaf.launch_emit(cells),
            ),
            Pass("sort leaf pairs", "build", ("leaf pairs",), ("sorted leaf pairs",), leaf.launch_sort),
            Pass("leaf lists", "build", ("sorted leaf pairs",), ("leaf cells",), leaf.launch_lists),
        ]  # fmt: skip
        return Built(passes, lists, ("leaf cells", "sorted leaf pairs", "leaf grids", "grid"), make_kernels())

    def counted(self) -> dict[str, int]:
        assert self._need is not None
        top_pairs, leaf_pairs = (int(n) for n in self._need.numpy())
        lengths = self._leaf.list.end.numpy() - self._leaf.list.begin.numpy()
        leaf_counts = self._leaf_counts.numpy()
        return {
            "top cells": self._top.counters()["cells"],
            "top pairs": top_pairs,
            "occupied top cells": int(np.count_nonzero(leaf_counts)),
            "leaf cells": int(leaf_counts.sum()),
            "leaf pairs": leaf_pairs,
            "occupied leaf cells": int(np.count_nonzero(lengths)),
            "longest list": int(lengths.max()),
            "large triangles": int(self._leaf.large.size.numpy()[0]),
        }

    def _resolve(self) -> None:
        cells, counts, scan = self._cells, self._leaf_counts, self._leaf_scan
        size = {"dim": cells.cells, "device": self._frame.device}
        wp.launch(resolution_kernel, inputs=[self.build.leaf_density, cells], outputs=[counts], **size)
        wp.utils.array_scan(counts, scan, inclusive=True)
        wp.launch(first_kernel, inputs=[counts, scan, cells], **size)


METHOD = TwoLevelGrid
