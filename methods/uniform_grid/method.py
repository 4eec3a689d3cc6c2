"""The uniform grid as a method: place, count, scan, emit, sort, lists; then one walk a ray.

Kalojanov & Slusallek 2009, "A Parallel Algorithm for Construction of Uniform Grids" (HPG): the grid is built from
sorted (cell, triangle) pairs. It serves any ray, so primary and shadow rays share it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.method import BaseMethod
from ...harness.frame.mirrors import traced_bounces
from ...harness.frame.passes import Pass
from ...harness.frame.specialise import specialised
from ...harness.scene.effects import Effects, Limits
from ..common.bounces import bounced_tests
from ..common.bounds import launch_bounds
from ..common.misses import miss_passes
from ..common.pairs import PairList, grown
from ..common.pixels import thread_count
from ..common.ray_passes import shadow_ray_passes
from .binning import LANES, LARGE_AT_ONCE, LargeTriangles, Pairs, bin_kernel, bin_large_kernel
from .grid import Grid, place_grid_kernel
from .traversal import Cells, primary_kernel, shadow_kernel

CELL_BYTES = 8
MOST_CELLS = 1 << 28


@dataclass(frozen=True)
class Build:
    """How the grid is built.

    density   cells per triangle (lambda of Kalojanov & Slusallek's resolution rule), divided among the axes in
              proportion to the scene's box
    capacity  initial capacity, (triangle, cell) pairs; 0: four per triangle; grows when a frame needs more
    """

    density: float = 4.0
    capacity: int = 0

    def __post_init__(self) -> None:
        if not 0.0 < self.density <= 1000.0:
            raise ValueError("density must lie between 0 and 1000 cells a triangle")
        if self.capacity < 0:
            raise ValueError("capacity must be 0 (automatic) or more pairs")


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    swizzle  whether 32 consecutive threads trace a block of 8x4 pixels (true) or 32 pixels of a row (false)
    """

    swizzle: bool = True


class UniformGrid(BaseMethod):
    """See the module. Exact: float32 rejects, float64 decides, and no ray can miss a cell of a triangle it hits."""

    name = "uniform_grid"
    title = "Uniform grid"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror"})
    Build = Build
    Trace = Trace

    def __init__(self, build: Build | None = None, trace: Trace | None = None):
        super().__init__(build, trace)
        self._capacity = 0
        self._need: wp.array | None = None

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._frame, self._effects = frame, effects
        self._limits = limits
        count = frame.triangle_count
        if count == 0:
            self._need = None
            return miss_passes(frame, effects)
        cells = min(MOST_CELLS, max(1, int(count * self.build.density)))
        if cells * CELL_BYTES > limits.memory:
            raise CapacityRejected(f"needs {cells:,} cells ({cells * CELL_BYTES / 2**30:.1f} GiB)")
        self._capacity = self._capacity or self.build.capacity or 4 * count
        self._threads = thread_count(frame.width, frame.height, self.trace.swizzle)
        on_cpu = wp.get_device(frame.device).is_cpu
        self._lanes, self._at_once = (1, 1) if on_cpu else (LANES, LARGE_AT_ONCE)
        with wp.ScopedDevice(frame.device):
            self._box = wp.zeros(6, dtype=wp.float32)
            self._grid = wp.zeros(1, dtype=Grid)
            self._large = filled(
                LargeTriangles, size=wp.zeros(1, dtype=wp.int32), triangles=wp.zeros(count, dtype=wp.int32),
                cursor=wp.zeros(count, dtype=wp.int32),
            )  # fmt: skip
            self._hit = wp.zeros(frame.pixels, dtype=wp.vec3d)
            bounces = effects.bounces
            self._bounced_hit = wp.zeros((bounces, frame.pixels) if bounces else (0, 0), dtype=wp.vec3d)
            self._need = wp.zeros(1, dtype=wp.int64)
            self._uncounted = wp.zeros(0, dtype=wp.int32)
        self._lights = [i for i, wanted in enumerate(effects.shadows) if wanted]
        self._pairs = PairList(count, cells, self._capacity, frame.device)
        pairs = self._pairs
        self._pair_arrays = filled(
            Pairs, count=pairs.count, scan=pairs.scan, keys=pairs.keys, values=pairs.values
        )
        self._cells = filled(Cells, grid=self._grid, begin=pairs.begin, end=pairs.end, members=pairs.values)
        passes = [
            Pass("place grid", "build", ("points", "triangles", "reach"), ("grid",), self._place),
            Pass("count pairs", "build", ("points", "triangles", "grid"), ("pair counts",), self._count),
            Pass(
                "emit pairs", "build", ("points", "triangles", "grid", "pair counts"), ("pairs",), self._emit
            ),
            Pass("sort pairs", "build", ("pairs",), ("sorted pairs",), self._pairs.launch_sort),
            Pass("cell lists", "build", ("sorted pairs",), ("cells",), self._pairs.launch_lists),
            Pass(
                "primary rays",
                "trace",
                ("cells", "sorted pairs", "grid", "camera", *effects.surface_reads()),
                ("hits",),
                self._primary,
            ),
        ]
        passes += shadow_ray_passes(effects, ("cells", "sorted pairs", "grid", "hits"), self._shadow)
        structure = ("cells", "sorted pairs", "grid", "points", "triangles")
        passes += traced_bounces(
            effects, structure, lambda b: self._primary(bounce=b), lambda i, b: self._shadow(i, bounce=b)
        )
        return passes

    def needs(self) -> wp.array | None:
        return self._need

    def grow(self, needed: NDArray[np.int64]) -> bool:
        capacity = grown(int(needed[0]), self._capacity, self._limits.memory, "(triangle, cell) pairs")
        if capacity == self._capacity:
            return False
        self._capacity = capacity
        return True

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary ray and of its shadow rays: the last frame traced again, counted."""
        primary = wp.zeros(self._frame.pixels, dtype=wp.int32, device=self._frame.device)
        shadow = wp.zeros_like(primary)
        if self._need is not None:
            self._primary(primary)
            for light in self._lights:
                self._shadow(light, shadow)
        return primary.numpy(), shadow.numpy()

    def counters(self) -> dict[str, int]:
        if self._need is None:
            return {}
        primary, shadow = self.tests_per_pixel()
        mirrored = bounced_tests(self._frame, self._effects, self._primary, self._shadow)
        lengths = self._pairs.end.numpy() - self._pairs.begin.numpy()
        return {
            "cells": int(np.prod(self._grid.numpy()["res"][0].astype(np.int64))),
            "pairs": int(self._need.numpy()[0]),
            "occupied cells": int(np.count_nonzero(lengths)),
            "longest list": int(lengths.max()),
            "large triangles": int(self._large.size.numpy()[0]),
            "primary tests": int(primary.sum(dtype=np.int64)),
            "shadow tests": int(shadow.sum(dtype=np.int64)),
            **mirrored,
        }

    def built(self) -> dict[str, Any]:
        return {"density": self.build.density}

    def _place(self) -> None:
        launch_bounds(self._frame, self._box)
        wp.launch(
            place_grid_kernel,
            dim=1,
            inputs=[self._pairs.cells, self._box, self._frame.reach],
            outputs=[self._grid],
            device=self._frame.device,
        )

    def _bin(self, emit: bool) -> None:
        frame = self._frame
        wp.launch(
            bin_kernel,
            dim=frame.triangle_count,
            inputs=[emit, self._grid, frame.mesh],
            outputs=[self._pair_arrays, self._large],
            device=frame.device,
        )
        wp.launch(
            bin_large_kernel,
            dim=(self._at_once, self._lanes),
            inputs=[emit, self._lanes, self._at_once, self._grid, frame.mesh],
            outputs=[self._pair_arrays, self._large],
            device=frame.device,
        )

    def _count(self) -> None:
        assert self._need is not None
        self._large.size.zero_()
        self._bin(emit=False)
        self._pairs.launch_scan(self._need, 0)

    def _emit(self) -> None:
        self._bin(emit=True)

    def _hits(self, bounce: int) -> wp.array:
        return self._bounced_hit[bounce - 1] if bounce else self._hit

    def _primary(self, tests: wp.array | None = None, bounce: int = 0) -> None:
        frame = self._frame
        wp.launch(
            specialised(primary_kernel, self._effects.switches(bounce=bounce)),
            dim=self._threads,
            inputs=[
                self.trace.swizzle, self._cells, frame.camera, frame.mesh, frame.alpha, frame.rays(bounce)
            ],
            outputs=[frame.hits(bounce), self._hits(bounce), self._uncounted if tests is None else tests],
            device=frame.device,
        )  # fmt: skip

    def _shadow(self, light: int, tests: wp.array | None = None, bounce: int = 0) -> None:
        frame = self._frame
        wp.launch(
            specialised(shadow_kernel, self._effects.switches(light, bounce)),
            dim=self._threads,
            inputs=[
                self.trace.swizzle, light, self._cells, frame.camera, frame.mesh, frame.alpha, frame.lights,
                frame.hits(bounce), self._hits(bounce), frame.masks(bounce), frame.rays(bounce),
            ],
            outputs=[frame.bits(bounce), self._uncounted if tests is None else tests],
            device=frame.device,
        )  # fmt: skip
