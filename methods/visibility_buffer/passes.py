"""Passes of the visibility buffer and of the irregular z-buffers: what the streams have in other kernels."""

from collections.abc import Callable
from functools import partial

import warp as wp

from ...harness.frame.schedule.passes import Pass
from ..common.pixels import thread_count
from ..gpu.warps import LANES
from ..streams.camera.passes import Camera, undecided_step
from ..streams.light import Occlusion
from ..streams.queues import Queues, Step
from ..streams.rays.placing import ByRays, LightRays
from . import raster, shadow


def tile_steps(split: Callable[[int], None], fill: Callable[[int], None]) -> list[Step]:
    """The passes of each share for larger triangles: which tiles they cover, and the pixels or texels of these."""
    return [("tiles of larger triangles", ("items",), ("tiles",), split), ("inside of tiles", ("tiles",), (), fill)]


def threads_of(queues: Queues) -> list[int]:
    """Threads that empty a queue, and how many of them take one entry."""
    return [queues.threads, int(LANES) if queues.cuda else 1]


def raster_steps(camera: Camera) -> list[Step]:
    """Primary rays: rasterise, tiles of larger triangles, undecided pairs."""
    first: Step = ("rasterise triangles", (), ("items",), partial(launch_raster, camera))
    tiles = tile_steps(partial(launch_split, camera), partial(launch_tiles, camera))
    return [first, *tiles, undecided_step(camera)]


def launch_raster(camera: Camera, share: int) -> None:
    f, q = camera.frame, camera.queues
    inputs = [q.share(share), camera.settings.inline_pixels, f.camera, f.mesh, f.alpha]
    camera.launch(raster.raster_kernel, share, q.share_threads, inputs, [q.nearest, q.exact_path])


def launch_split(camera: Camera, share: int) -> None:
    q = camera.queues
    camera.launch(raster.split_kernel, share, q.threads, [*threads_of(q), camera.frame.camera], [])


def launch_tiles(camera: Camera, share: int) -> None:
    f, q = camera.frame, camera.queues
    inputs = [*threads_of(q), f.camera, f.alpha]
    camera.launch(raster.tile_kernel, share, q.threads, inputs, [q.nearest])


class ByLists(ByRays):
    """Places the rays of a light and puts them into the lists of its map's texels. head int32 [texels]: of each list."""

    def __init__(self, rays: LightRays, head: wp.array):
        super().__init__(rays, keeps=True)
        self.head = head

    def sorting(self) -> list[Pass]:
        r = self.rays
        reads = (*r.seen(), r.name("ray places"))
        return [r.work("lists of texels", reads, (r.name("ray cells"),), self.launch_insert)]

    def launch_insert(self) -> None:
        r, f = self.rays, self.rays.frame
        self.head.zero_()
        inputs = [r.index, r.hits, f.receivers]
        r.launch(shadow.insert_kernel, thread_count(f.width, f.height), inputs, [r.cells, self.head])


class MapOcclusion(Occlusion):
    """Tests triangles against the rays in the lists of a light's map."""

    def __init__(self, rays: LightRays, head: wp.array):
        super().__init__(rays)
        self.head = head

    def steps(self) -> list[Step]:
        return [
            ("rasterise triangles", (), ("large triangles",), self.launch_raster),
            ("larger triangles", ("large triangles",), ("items",), self.launch_setup),
            *tile_steps(self.launch_tile_split, self.launch_tiles),
        ]

    def launch_raster(self, share: int) -> None:
        r, f, q, s = self.rays, self.rays.frame, self.rays.queues, self.rays.settings
        inputs = [q.share(share), s.inline_cells, s.inline_rays, r.light, r.cells, self.head, f.mesh, f.alpha]
        self.launch(shadow.raster_kernel, share, q.share_threads, inputs)

    def launch_setup(self, share: int) -> None:
        r, q = self.rays, self.rays.queues
        self.launch(shadow.setup_kernel, share, q.threads, [q.threads, r.light, r.cells, r.frame.mesh])

    def launch_tile_split(self, share: int) -> None:
        r, q = self.rays, self.rays.queues
        self.launch(shadow.split_kernel, share, q.threads, [*threads_of(q), r.cells])

    def launch_tiles(self, share: int) -> None:
        r, q = self.rays, self.rays.queues
        self.launch(shadow.tile_kernel, share, q.threads, [*threads_of(q), r.cells, self.head, r.frame.alpha])
