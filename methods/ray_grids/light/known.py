"""A light's passes where the region of its rays is known before there are rays (:mod:`.region`)."""

from __future__ import annotations

from typing import ClassVar

import warp as wp

from ...common.bands import Threads
from ..queues import BLOCK_DIM
from . import receivers as light_receivers
from . import region as light_region
from .passes import LightStream


class KnownRegionLight(LightStream):
    """Shadow rays of one light in all directions, counted in their cells where they are placed."""

    aim_reads: ClassVar[tuple[str, ...]] = (*LightStream.aim_reads, "camera")

    def launch_aim(self) -> None:
        super().launch_aim()
        f = self.frame
        threads = max(1, f.triangle_count)
        wp.launch(
            light_region.bounds_kernel,
            dim=threads,
            inputs=[threads, self.index, f.camera, self.aims.cubes, f.mesh],
            outputs=[self.cells],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def _begin(self) -> None:
        cells = self.cells
        if not self.queues.cuda:
            cells.count.zero_()
        if len(self.effects.shadows) > 1:
            cells.farthest.zero_()  # another light of the branch has used it since launch_aim

    def launch_map(self) -> None:
        self._begin()
        self.ranges.run(self._place)

    def _place(self, threads: Threads) -> None:
        f, a = self.frame, self.aims
        wp.launch(
            light_region.place_kernel,
            dim=threads.number,
            inputs=[threads.first, self.index, f.camera, a.posts, a.axes, f.mesh, self.rays],
            outputs=[self.cells, f.answers.visibility],
            device=f.device,
        )

    def launch_marking_map(self) -> None:
        self._begin()
        self.launch_marking(light_receivers.place_kernel)

    def launch_count(self) -> None:
        self.launch_scan()

    def launch_scatter(self) -> None:
        if self.marking:
            super().launch_scatter()
        else:
            self.ranges.run(self._scatter_hits)

    def _scatter_hits(self, threads: Threads) -> None:
        f = self.frame
        wp.launch(
            light_region.scatter_kernel,
            dim=threads.number,
            inputs=[threads.first, f.camera, self.rays],
            outputs=[self.cells],
            device=f.device,
        )
