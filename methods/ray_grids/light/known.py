"""A light's passes where the region of its rays is known before there are rays (:mod:`.region`)."""

from __future__ import annotations

from typing import Any, ClassVar

import warp as wp

from ...common.pixels import thread_count
from ..queues import BLOCK_DIM
from . import region as light_region
from .passes import LightStream


class KnownRegionLight(LightStream):
    """Shadow rays of one light without restrictions, counted in their cells where they are placed."""

    marks = False
    aim_reads: ClassVar[tuple[str, ...]] = (*LightStream.aim_reads, "camera")

    def __init__(self, *given: Any):
        super().__init__(*given)
        assert not self.effects.has_receivers(self.index)

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

    def launch_map(self) -> None:
        f, cells = self.frame, self.cells
        if not self.queues.cuda:
            cells.count.zero_()
        if len(self.effects.shadows) > 1:
            cells.farthest.zero_()  # another light of the branch has used it since launch_aim
        wp.launch(
            light_region.place_kernel,
            dim=thread_count(f.width, f.height, True),
            inputs=[self.index, f.camera, self.aims.posts, self.aims.axes, f.mesh, self.rays],
            outputs=[cells, f.answers.visibility],
            device=f.device,
        )

    def launch_count(self) -> None:
        self.launch_scan()

    def launch_scatter(self) -> None:
        f = self.frame
        wp.launch(
            light_region.scatter_kernel,
            dim=thread_count(f.width, f.height, True),
            inputs=[f.camera, self.rays],
            outputs=[self.cells],
            device=f.device,
        )
