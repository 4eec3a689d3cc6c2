"""A light's passes where the region of its rays is known before there are rays (:mod:`.region`)."""

from __future__ import annotations

from typing import Any, ClassVar

import warp as wp

from ...common.pixels import thread_count
from .. import aim as light_aim
from ..queues import BLOCK_DIM
from . import region as light_region
from .passes import LightStream


class KnownRegionLight(LightStream):
    """Shadow rays of one light without restrictions, counted in their cells where they are placed.

    touched int32 [6]: 1 for the faces of the cube that triangles in view touch.
    """

    marks = False
    aim_reads: ClassVar[tuple[str, ...]] = (*LightStream.aim_reads, "camera")

    def __init__(self, *given: Any):
        super().__init__(*given)
        assert not self.effects.has_receivers(self.index)
        self.touched = wp.zeros(int(light_aim.FACES), dtype=wp.int32, device=self.frame.device)

    def launch_aim(self) -> None:
        super().launch_aim()
        f = self.frame
        self.touched.zero_()
        threads = max(1, f.triangle_count)
        wp.launch(
            light_region.bounds_kernel,
            dim=threads,
            inputs=[threads, self.index, f.camera, self.aims.cubes, f.mesh],
            outputs=[self.touched, self.cells],
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
            inputs=[self.index, f.camera, self.aims.posts, self.aims.axes, f.hits(0), self.hit, self.touched],
            outputs=[cells, f.answers.visibility],
            device=f.device,
        )

    def launch_count(self) -> None:
        self.launch_scan(light_region.scan_kernel, self.touched)
