"""A light's passes where the region of its rays is known before there are rays (:mod:`.region`), and those of a spot."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ...common.bands import Threads
from ...gpu.warps import LANES
from ..cube.aim import FACES
from ..light import LightStream
from ..queues import BLOCK_DIM
from . import cone as light_spots
from . import region as light_region
from . import sort as light_bins


class KnownRegionLight(LightStream):
    """Shadow rays of one light, counted in their cells where they are placed.

    facing: uint8 [triangles]: whether those in view face the light, if only then their hits have a ray; or [0].
    alone: whether no other light uses the arrays of the branch. Lights do not aim in turns: what :meth:`launch_aim` writes
    belongs to this light.
    """

    tabled: ClassVar[bool] = True

    def __init__(self, *given: Any):
        super().__init__(*given)
        self.alone = len(self.effects.shadows) == 1
        # Where the stream tests rays, or counts them, they must lie in their cells.
        self.beside = self.queues.queued and self.build.streamed == "beside" and self.build.groups == "stream"
        count = max(1, self.frame.triangle_count) if self.by_facing() else 0
        self.facing = wp.zeros(count, dtype=wp.uint8, device=self.frame.device)

    def by_facing(self) -> bool:
        return self.marking

    def launch_aim(self) -> None:
        super().launch_aim()
        self._launch_bounds()
        wp.launch(
            self.of_cells(light_bins.table_kernel),
            dim=int(FACES) + 1,
            inputs=[],
            outputs=[self.cells],
            device=self.frame.device,
        )
        if self.spaced:
            self.launch_spacing()

    def _launch_bounds(self) -> None:
        """The region."""
        f = self.frame
        threads = -(-max(1, f.triangle_count) // BLOCK_DIM) * BLOCK_DIM
        lanes = int(LANES) if self.queues.cuda else 1
        kernel = self.of_cells(light_region.bounds_kernel)
        wp.launch(
            specialised(kernel, replace(self.switches, receivers=self.facing.size > 0)),
            dim=threads,
            inputs=[threads, lanes, self.alone, self.index, f.camera, self.aims.cubes, f.mesh, f.lights],
            outputs=[self.cells, self.facing],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_map(self) -> None:
        cells = self.cells
        if not self.queues.cuda:
            cells.count.zero_()
        if not self.alone:
            cells.farthest.zero_()
        if self.reached.size:
            self.reached.zero_()
        self.ranges.run(self._place)

    def _place(self, threads: Threads) -> None:
        f, a = self.frame, self.aims
        wp.launch(
            specialised(self.of_cells(light_region.place_kernel), self.switches),
            dim=threads.number,
            inputs=[
                threads.first, self.index, f.camera, a.proxy_positions, a.axes, f.mesh, self.rays, self.facing,
            ],
            outputs=[self.cells, f.receivers, self.reached, f.answers.shadowed],
            device=f.device,
        )  # fmt: skip

    def launch_marking_map(self) -> None:
        self.launch_map()

    def launch_count(self) -> None:
        self.launch_scan()

    def launch_scatter(self) -> None:
        self.ranges.run(self._scatter_hits)

    def _scatter_hits(self, threads: Threads) -> None:
        f = self.frame
        wp.launch(
            specialised(self.of_cells(light_region.scatter_kernel), self.switches),
            dim=threads.number,
            inputs=[threads.first, self.index, f.camera, f.mesh, self.rays, f.receivers],
            outputs=[self.cells],
            device=f.device,
        )


class SpotLight(KnownRegionLight):
    """Shadow rays of a spot (:mod:`.cone`). With ``facing`` only if it is known which triangles may face the light."""

    def __init__(self, *given: Any):
        super().__init__(*given)
        self.outside_rays = wp.zeros(1 + self.frame.pixels, dtype=wp.int32, device=self.frame.device)
        # Whenever rays are placed again, the list of outside rays must have been emptied.
        self.aim_reads = (*self.aim_reads, *self.effects.surface_reads())

    def by_facing(self) -> bool:
        return False

    def _launch_bounds(self) -> None:
        super()._launch_bounds()
        wp.launch(
            light_spots.cone_kernel,
            dim=1,
            inputs=[self.index, self.aims.axes, self.frame.spots],
            outputs=[self.cells.rectangle, self.outside_rays],
            device=self.frame.device,
        )

    def _place(self, threads: Threads) -> None:
        f, a = self.frame, self.aims
        wp.launch(
            self.of_cells(light_spots.place_kernel),
            dim=threads.number,
            inputs=[
                threads.first, self.index, f.camera, f.mesh, f.lights, f.spots, f.front_facing, a.cones,
                a.proxy_positions, a.axes, self.rays,
            ],
            outputs=[self.cells, f.receivers, self.reached, f.answers.shadowed, self.outside_rays],
            device=f.device,
        )  # fmt: skip
