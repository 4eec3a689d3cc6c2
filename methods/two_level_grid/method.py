"""The two-level grid as a method: a top grid, a leaf grid in each of its cells, both by sorting; then one traversal per
ray.

Kalojanov, Billeter & Slusallek 2011, "Two-Level Grids for Ray Tracing on GPUs" (Eurographics).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.frame.schedule.threads import check_threads
from ...harness.scene.effects import Effects, Limits
from ..common.grid_build import BinnedItems, TriangleGrid, cells_for, refuse_cells
from ..common.misses import miss_passes
from ..common.pairs import grown
from ..common.ray_launches import PixelRays, check_registers
from .leaves import TopCells, bin_large_leaf_kernel, bin_leaf_kernel, first_kernel, resolution_kernel
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


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    swizzle    whether 32 consecutive threads trace a block of 8x4 pixels (true) or 32 pixels of a row (false)
    registers  limit of registers per thread on the GPU; 0: the compiler decides. 128 was the best on balls-40k and
               balls-300k
    threads    of a CPU: each traces a band of the image; 0: one for each core that this process may use, at most 16
    """

    swizzle: bool = True
    registers: int = 128
    threads: int = 0

    def __post_init__(self) -> None:
        check_registers(self.registers)
        check_threads(self.threads)


class TwoLevelGrid(BaseMethod):
    """See the module. Exact: float32 rejects, float64 decides, and no ray can miss a leaf cell of a triangle it hits.

    Needs: (triangle, top cell) pairs, then (triangle, leaf cell) pairs.
    """

    name = "two_level_grid"
    title = "Two-level grid"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror", "orthographic"})
    Build = Build
    Trace = Trace

    def __init__(self, build: Build | None = None, trace: Trace | None = None):
        super().__init__(build, trace)
        self._capacity = [self.build.top_capacity, self.build.leaf_capacity]
        self._need: wp.array | None = None
        self._workers: dict[str, int] = {}

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._frame, self._limits = frame, limits
        count = frame.triangle_count
        if count == 0:
            self._need = None
            return miss_passes(frame, effects)
        top_cells = cells_for(count, self.build.top_density, limits.memory)
        self._capacity[TOP] = self._capacity[TOP] or 4 * count
        self._capacity[LEAF] = self._capacity[LEAF] or 8 * count
        # A cell that holds n triangles gets at most max(1, density * n) leaf cells.
        leaf_cells = math.ceil(max(1.0, self.build.leaf_density) * self._capacity[TOP])
        refuse_cells(leaf_cells, min(limits.memory, 2**33))
        self._top = TriangleGrid(frame, top_cells, self._capacity[TOP])
        self._leaf = BinnedItems(self._capacity[TOP], leaf_cells, self._capacity[LEAF], frame.device)
        top, leaf = self._top.binned.list, self._leaf.list
        with wp.ScopedDevice(frame.device):
            self._need = wp.zeros(2, dtype=wp.int64)
            self._leaf_counts = wp.zeros(top_cells, dtype=wp.int64)
            self._leaf_scan = wp.zeros(top_cells, dtype=wp.int64)
            self._res = wp.zeros(top_cells, dtype=wp.int32)
            self._first = wp.zeros(top_cells, dtype=wp.int32)
        self._cells = filled(
            TopCells, grid=self._top.grid, begin=top.begin, end=top.end, keys=top.keys, members=top.values,
            cells=top_cells, res=self._res, first=self._first,
        )  # fmt: skip
        lists = filled(
            LeafCells, grid=self._top.grid, res=self._res, first=self._first, begin=leaf.begin, end=leaf.end,
            members=leaf.values,
        )  # fmt: skip
        kernels, trace = make_kernels(self.trace.registers), self.trace
        self._rays = PixelRays(frame, effects, lists, *kernels, trace.swizzle, threads=trace.threads)
        self._workers = self._rays.bands.built()
        levels = ("grid", "cells", "sorted pairs", "leaf grids")
        geometry = ("points", "triangles", *levels)
        return [
            *self._top.passes(self._need, TOP),
            Pass("leaf resolutions", "build", levels[:2], ("leaf grids",), self._resolve),
            Pass("count leaf pairs", "build", geometry, ("leaf pair counts",), self._count),
            Pass("emit leaf pairs", "build", (*geometry, "leaf pair counts"), ("leaf pairs",), self._emit),
            Pass("sort leaf pairs", "build", ("leaf pairs",), ("sorted leaf pairs",), leaf.launch_sort),
            Pass("leaf lists", "build", ("sorted leaf pairs",), ("leaf cells",), leaf.launch_lists),
            *self._rays.passes(("leaf cells", "sorted leaf pairs", "leaf grids", "grid")),
        ]  # fmt: skip

    def needs(self) -> wp.array | None:
        return self._need

    def grow(self, needed: NDArray[np.int64]) -> bool:
        # The need of the leaf level is known only once the top level has enough room.
        for slot, what in ((TOP, "(triangle, top cell) pairs"), (LEAF, "(triangle, leaf cell) pairs")):
            capacity = grown(int(needed[slot]), self._capacity[slot], self._limits.memory, what)
            if capacity != self._capacity[slot]:
                self._capacity[slot] = capacity
                return True
        return False

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary ray and of its shadow rays. The last frame is traced again to count
        them."""
        return self._rays.tests_per_pixel()

    def counters(self) -> dict[str, int]:
        if self._need is None:
            return {}
        lengths = self._leaf.list.end.numpy() - self._leaf.list.begin.numpy()
        leaf_counts = self._leaf_counts.numpy()
        return {
            "top cells": int(np.prod(self._top.grid.numpy()["res"][0].astype(np.int64))),
            "top pairs": int(self._need.numpy()[TOP]),
            "occupied top cells": int(np.count_nonzero(leaf_counts)),
            "leaf cells": int(leaf_counts.sum()),
            "leaf pairs": int(self._need.numpy()[LEAF]),
            "occupied leaf cells": int(np.count_nonzero(lengths)),
            "longest list": int(lengths.max()),
            "large triangles": int(self._leaf.large.size.numpy()[0]),
            **self._rays.counters(),
        }

    def built(self) -> dict[str, Any]:
        return {
            "top_density": self.build.top_density,
            "leaf_density": self.build.leaf_density,
            **self._workers,
        }

    def _resolve(self) -> None:
        top_cells, device = self._cells.cells, self._frame.device
        wp.launch(
            resolution_kernel,
            dim=top_cells,
            inputs=[self.build.leaf_density, self._cells],
            outputs=[self._leaf_counts],
            device=device,
        )
        wp.utils.array_scan(self._leaf_counts, self._leaf_scan, inclusive=True)
        wp.launch(
            first_kernel, dim=top_cells, inputs=[self._leaf_counts, self._leaf_scan, self._cells], device=device
        )  # fmt: skip

    def _bin(self, emit: bool) -> None:
        leaf, mesh, device = self._leaf, self._frame.mesh, self._frame.device
        wp.launch(
            bin_leaf_kernel,
            dim=self._capacity[TOP],
            inputs=[emit, self._cells, mesh],
            outputs=[leaf.pairs, leaf.large],
            device=device,
        )
        wp.launch(
            bin_large_leaf_kernel,
            dim=(leaf.at_once, leaf.lanes),
            inputs=[emit, leaf.lanes, leaf.at_once, self._cells, mesh],
            outputs=[leaf.pairs, leaf.large],
            device=device,
        )

    def _count(self) -> None:
        assert self._need is not None
        self._leaf.large.size.zero_()
        self._bin(emit=False)
        self._leaf.list.launch_scan(self._need, LEAF)

    def _emit(self) -> None:
        self._bin(emit=True)
