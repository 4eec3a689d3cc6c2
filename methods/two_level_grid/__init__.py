"""A grid of grids, rebuilt every frame by sorting: Kalojanov, Billeter & Slusallek 2011.

"Two-Level Grids for Ray Tracing on GPUs" (Eurographics): a top grid, a leaf grid in each of its cells, both by sorting;
then one traversal per ray.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.schedule.passes import Pass
from ..common.pairs import zeroed
from ..grids.build import TriangleGrid, cells_for, refuse_cells
from ..grids.pairs import BinnedItems
from ..rays.structure import Built, RayStructure
from .leaves import Levels, first_kernel, leaf_item, resolution_kernel
from .traversal import make_kernels

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
        self._levels: Any = None  # what a smaller capacity held is not needed beside the new
        self._top = top = TriangleGrid(frame, top_cells, pairs)
        self._leaf = leaf = BinnedItems(pairs, leaf_cells, self._capacity[LEAF], frame, Levels, leaf_item)
        with wp.ScopedDevice(frame.device):
            self._levels = zeroed(Levels, top_cells, grid=top.grid, cells=top_cells, top=top.pairs, leaf=leaf.pairs)
        reads = ("points", "triangles", *TriangleGrid.RESOURCES, "leaf grids")
        passes = [
            *top.built(self._need, TOP),
            Pass("leaf resolutions", "build", ("grid", "cells"), ("leaf grids",), self._resolve),
            *leaf.passes("leaf ", reads, self._levels, self._need, LEAF),
        ]
        resources = ("leaf cells", "sorted leaf pairs", "leaf grids", "grid")
        return Built(passes, self._levels, resources, make_kernels())

    def counted(self) -> dict[str, int]:
        assert self._need is not None
        top_pairs, leaf_pairs = (int(n) for n in self._need.numpy())
        lengths, leaf_counts = self._leaf.lengths(), self._levels.counts.numpy()
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
        levels = self._levels
        self._frame.launch(resolution_kernel, levels.cells, [self.build.leaf_density, levels])
        wp.utils.array_scan(levels.counts, levels.scan, inclusive=True)
        self._frame.launch(first_kernel, levels.cells, [levels])


METHOD = TwoLevelGrid
