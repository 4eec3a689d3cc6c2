"""Passes of the visibility buffer and of the irregular z-buffers: what ``ray_grids`` has in other kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import warp as wp

from ...harness.frame.effects.specialise import specialised
from ...harness.frame.frame import Frame
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects
from ..common.pixels import thread_count
from ..gpu.warps import LANES
from ..streams.camera.passes import CameraStream
from ..streams.cube.aims import LightAims
from ..streams.light import LightStream
from ..streams.queues import BLOCK_DIM, Queues, Step
from ..streams.settings import Streams
from . import lists, raster, shadow


def tile_steps(split: Callable[[int], None], fill: Callable[[int], None]) -> list[Step]:
    """The passes of each share for larger triangles: which tiles they cover, and the pixels or texels of these."""
    return [
        ("tiles of larger triangles", ("items",), ("tiles",), split),
        ("inside of tiles", ("tiles",), (), fill),
    ]


def threads_of(queues: Queues) -> list[int]:
    """Threads that empty a queue, and how many of them take one entry."""
    return [queues.threads, int(LANES) if queues.cuda else 1]


class CameraRaster(CameraStream):
    """Primary rays: clear, rasterise, decide the undecided pairs, resolve."""

    def steps(self) -> list[Step]:
        first: Step = ("rasterise triangles", (), ("items",), self.launch_stream)
        return [first, *tile_steps(self.launch_split, self.launch_tiles), self.undecided()]

    def launch_stream(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(raster.raster_kernel, self.effects.switches()),
            dim=q.share_threads,
            inputs=[q.share(share), self.build.inline_pixels, f.camera, f.mesh, f.alpha],
            outputs=[q.nearest, q.exact_path, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_split(self, share: int) -> None:
        wp.launch(
            raster.split_kernel,
            dim=self.queues.threads,
            inputs=[*threads_of(self.queues), self.frame.camera],
            outputs=[self.queue[share]],
            device=self.frame.device,
            block_dim=BLOCK_DIM,
        )

    def launch_tiles(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(raster.tile_kernel, self.effects.switches()),
            dim=q.threads,
            inputs=[*threads_of(q), f.camera, f.alpha],
            outputs=[q.nearest, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )


class LightRaster(LightStream):
    """Shadow rays of one light: aim the map, map the hit points, put them in lists, rasterise, decide the undecided
    pairs."""

    keeps: ClassVar[bool] = True

    def __init__(
        self,
        frame: Frame,
        index: int,
        build: Streams,
        hit: wp.array,
        queues: Queues,
        arrays: dict[str, Any],
        aims: LightAims,
        effects: Effects,
    ):
        self.head = arrays["head"]
        cells = {name: array for name, array in arrays.items() if name != "head"}
        super().__init__(frame, index, build, hit, queues, cells, aims, effects)

    def cell_passes(self, seen: tuple[str, ...], place: str, rays: str, effect: str) -> list[Pass]:
        name = f"light {self.index}: lists of texels"
        return [Pass(name, "light build", (*seen, place), (rays,), self.launch_insert, effect)]

    def steps(self) -> list[Step]:
        return [
            ("rasterise triangles", (), ("large triangles",), self.launch_stream),
            ("larger triangles", ("large triangles",), ("items",), self.launch_setup),
            *tile_steps(self.launch_split, self.launch_tiles),
        ]

    def launch_insert(self) -> None:
        f = self.frame
        self.head.zero_()
        wp.launch(
            specialised(lists.insert_kernel, self.switches),
            dim=thread_count(f.width, f.height, True),
            inputs=[self.index, f.camera, self.rays, f.receivers],
            outputs=[self.cells, self.head],
            device=f.device,
        )

    def launch_stream(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(shadow.raster_kernel, self.switches),
            dim=q.share_threads,
            inputs=[
                q.share(share), self.build.inline_cells, self.build.inline_rays, f.lights, self.aims.cubes, self.cells,
                self.head, f.mesh, f.alpha,
            ],
            outputs=[self.bits, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )  # fmt: skip

    def launch_setup(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            shadow.setup_kernel,
            dim=q.threads,
            inputs=[q.threads, self.index, f.lights, self.aims.cubes, self.cells, f.mesh],
            outputs=[self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )

    def launch_split(self, share: int) -> None:
        wp.launch(
            shadow.split_kernel,
            dim=self.queues.threads,
            inputs=[*threads_of(self.queues), self.cells],
            outputs=[self.queue[share]],
            device=self.frame.device,
            block_dim=BLOCK_DIM,
        )

    def launch_tiles(self, share: int) -> None:
        f, q = self.frame, self.queues
        wp.launch(
            specialised(shadow.tile_kernel, self.switches),
            dim=q.threads,
            inputs=[*threads_of(q), self.cells, self.head, f.alpha],
            outputs=[self.bits, self.queue[share]],
            device=f.device,
            block_dim=BLOCK_DIM,
        )
