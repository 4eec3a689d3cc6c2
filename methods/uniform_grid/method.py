"""The uniform grid as a method: place, count, scan, emit, sort, lists; then one traversal per ray.

Kalojanov & Slusallek 2009, "A Parallel Algorithm for Construction of Uniform Grids" (HPG): the grid is built from
sorted (cell, triangle) pairs. It serves any ray, so primary and shadow rays share it.
"""

from __future__ import annotations

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
from ..common.grid_build import TriangleGrid, cells_for
from ..common.misses import miss_passes
from ..common.pairs import grown
from ..common.ray_launches import PixelRays, check_registers
from .traversal import Cells, make_kernels


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


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    swizzle    whether 32 consecutive threads trace a block of 8x4 pixels (true) or 32 pixels of a row (false)
    registers  limit of registers per thread on the GPU; 0: the compiler decides. 64 was the best on balls-40k and
               balls-300k
    threads    of a CPU: each traces a band of the image; 0: one for each core that this process may use, at most 16
    """

    swizzle: bool = True
    registers: int = 64
    threads: int = 0

    def __post_init__(self) -> None:
        check_registers(self.registers)
        check_threads(self.threads)


class UniformGrid(BaseMethod):
    """See the module. Exact: float32 rejects, float64 decides, and no ray can miss a cell of a triangle it hits."""

    name = "uniform_grid"
    title = "Uniform grid"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror", "orthographic"})
    Build = Build
    Trace = Trace

    def __init__(self, build: Build | None = None, trace: Trace | None = None):
        super().__init__(build, trace)
        self._capacity = 0
        self._need: wp.array | None = None
        self._workers: dict[str, int] = {}

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._limits = limits
        count = frame.triangle_count
        if count == 0:
            self._need = None
            return miss_passes(frame, effects)
        cells = cells_for(count, self.build.density, limits.memory)
        self._capacity = self._capacity or self.build.capacity or 4 * count
        with wp.ScopedDevice(frame.device):
            self._need = wp.zeros(1, dtype=wp.int64)
        self._grid = TriangleGrid(frame, cells, self._capacity)
        pairs = self._grid.binned.list
        lists = filled(Cells, grid=self._grid.grid, begin=pairs.begin, end=pairs.end, members=pairs.values)
        kernels, trace = make_kernels(self.trace.registers), self.trace
        self._rays = PixelRays(frame, effects, lists, *kernels, trace.swizzle, threads=trace.threads)
        self._workers = self._rays.bands.built()
        return [*self._grid.passes(self._need, 0), *self._rays.passes(("cells", "sorted pairs", "grid"))]

    def needs(self) -> wp.array | None:
        return self._need

    def grow(self, needed: NDArray[np.int64]) -> bool:
        capacity = grown(int(needed[0]), self._capacity, self._limits.memory, "(triangle, cell) pairs")
        if capacity == self._capacity:
            return False
        self._capacity = capacity
        return True

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary ray and of its shadow rays. The last frame is traced again to count
        them."""
        return self._rays.tests_per_pixel()

    def counters(self) -> dict[str, int]:
        if self._need is None:
            return {}
        binned = self._grid.binned
        lengths = binned.list.end.numpy() - binned.list.begin.numpy()
        return {
            "cells": int(np.prod(self._grid.grid.numpy()["res"][0].astype(np.int64))),
            "pairs": int(self._need.numpy()[0]),
            "occupied cells": int(np.count_nonzero(lengths)),
            "longest list": int(lengths.max()),
            "large triangles": int(binned.large.size.numpy()[0]),
            **self._rays.counters(),
        }

    def built(self) -> dict[str, Any]:
        return {"density": self.build.density, **self._workers}
