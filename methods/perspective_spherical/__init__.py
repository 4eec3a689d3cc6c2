"""The paper's method: a perspective grid for primary rays and a spherical grid per light, rebuilt every frame."""

from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.errors import UserError
from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ...harness.scene.scene import Scene
from .camera.grid import CameraGrid
from .counters import work
from .culling import loses_hits, orientation, refusal
from .light.grid import LightGrid
from .lists.binning import GridSettings, grown_bins
from .lists.chunks import most_chunks
from .lists.staging import staged
from .parameters import Build, Trace, known_inexact

SLOTS = 3
"""Needs of one grid: pairs, rows of large triangles, and work items of split lists."""

MOST_TRACED = 1 << 14
"""Pixels along a tracing tile: the threads of one must fit into a launch."""

MOST_SPLIT = 1 << 24
"""Triangles that a packed hit of split lists can name."""


class PerspectiveSpherical(BaseMethod):
    """Guntury & Narayanan 2010. Slot 0 of the needs is the camera's grid, slot 1 + i that of light i."""

    name: ClassVar[str] = "perspective_spherical"
    title: ClassVar[str] = "Perspective + spherical grids"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha"})
    cannot: ClassVar[dict[str, str]] = {
        "mirror": "its camera grid holds rays that start at the eye: mirrored rays share no origin"
    }
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        side = self.build.tile * self.trace.k
        if side > MOST_TRACED:
            raise UserError(
                f"{self.name}: tile={self.build.tile} with k={self.trace.k} traces tiles of {side} pixels a side; "
                f"tile times k must be at most {MOST_TRACED}"
            )
        self._capacity: dict[int, tuple[int, ...]] = {}
        self._needs: wp.array | None = None
        self._memory = 0
        self.camera: CameraGrid | None = None
        self.lights: list[LightGrid] = []

    @property
    def known_inexact(self) -> str | None:
        return known_inexact(self.build)

    def applies(self, scene: Scene, device: str) -> str | None:
        reason = super().applies(scene, device)
        if reason is None and self.build.cull != "off":
            reason = loses_hits(self.build.triangle_test) or refusal(scene, self.build.cull == "primary+light")
        return reason

    def built(self) -> dict[str, Any]:
        """The values of the parameters that may change an answer; the others do not."""
        built = {"triangle test": self.build.triangle_test, "culling": self.build.cull}
        if self.build.light_bounds != "exact":
            built["light bounds"] = self.build.light_bounds
        if self.camera is not None:
            in_blocks = staged(self.trace.staging, self.camera.settings.frame.device)
            built["staging"] = "shared" if in_blocks else "none"
        return built

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._memory = limits.memory
        if self.trace.triangle_chunk and frame.triangle_count > MOST_SPLIT:
            raise UserError(f"{self.name}: triangle_chunk takes at most {MOST_SPLIT:,} triangles; set it to 0")
        outward = 0.0
        if self.build.cull != "off" and frame.triangle_count:
            outward = orientation(frame.prepared.points(0)[0], frame.prepared.faces)
        light_outward = outward if self.build.cull == "primary+light" else 0.0
        self._needs = wp.zeros(SLOTS * (1 + len(effects.shadows)), dtype=wp.int64, device=frame.device)

        def settings(grid: int, turned: float) -> GridSettings:
            room = self._capacity.setdefault(grid, self._guess(frame))
            return GridSettings(frame, self.build, self.trace, effects, turned, room, self._needs, SLOTS * grid)

        self.camera = camera = CameraGrid(settings(0, outward))
        self.lights = [
            LightGrid(settings(1 + i, light_outward), i, camera) for i, wanted in enumerate(effects.shadows) if wanted
        ]
        return [*camera.passes(), *(work for light in self.lights for work in light.passes())]

    def _guess(self, frame: Frame) -> tuple[int, ...]:
        """First capacities of a grid: pairs, rows of large triangles, and items of split lists of rays."""
        build, rays = self.build, frame.pixels
        items = 1
        if self.trace.triangle_chunk:
            items = 2 * most_chunks(rays, build.light_tile_count, self.trace.r)
        return build.pair_capacity or 2 * frame.triangle_count + 65536, build.row_capacity or 16384, items

    def needs(self) -> wp.array | None:
        return self._needs

    def grow(self, needed: NDArray[np.int64]) -> bool:
        before = dict(self._capacity)
        for grid, capacity in before.items():
            self._capacity[grid] = grown_bins(needed[SLOTS * grid : SLOTS * (grid + 1)], capacity, self._memory)
        return self._capacity != before

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary ray and of its shadow rays. The last frame is traced again to count
        them.
        """
        assert self.camera is not None
        frame = self.camera.settings.frame
        with wp.ScopedDevice(frame.device):
            primary = wp.zeros(max(2, frame.pixels), dtype=wp.int32)
            shadow = wp.zeros(max(2, frame.pixels), dtype=wp.int32)
        self.camera.launch_trace(primary)
        for light in self.lights:
            if light.traced():
                light.launch_trace(shadow)
        return primary.numpy()[: frame.pixels], shadow.numpy()[: frame.pixels]

    def counters(self) -> dict[str, int]:
        """Work of the last frame, exact counts; see :func:`~.counters.work`."""
        assert self.camera is not None
        primary, shadow = self.tests_per_pixel()
        return work(self.camera, self.lights, primary, shadow)


METHOD = PerspectiveSpherical
