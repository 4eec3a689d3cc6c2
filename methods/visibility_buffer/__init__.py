"""A visibility buffer for primary rays and irregular z-buffers for shadow rays: rasterisation as published, with exact
tests.

Primary rays: Burns and Hunt 2013 (the buffer), Karis 2021 (64-bit atomics on depth and index). Shadow rays: Johnson et
al. 2005 and Wyman, Hoetzlein and Lefohn 2015 (lists of hit points in the texels of a light's map). The exact tests, the
words and the light's cube are those of ``methods/streams``; how triangles are rasterised and where hit points are stored
differs.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import warp as wp

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.schedule.passes import Pass
from ..common.pixels import thread_count
from ..gpu.warps import LANES
from ..streams.camera.passes import Camera, undecided_step
from ..streams.camera.stream import make_stream_kernel
from ..streams.cube.cells import cell_arrays
from ..streams.light import Light, Occlusion
from ..streams.method import StreamedMethod
from ..streams.queues import Queues, Step
from ..streams.rays.placing import ByRays, LightRays
from ..streams.settings import Settings, Trial, whole_cells
from . import raster, shadow

INLINE_PIXELS, INLINE_RAYS, AT_ONCE = 40, 64, 2
"""A triangle whose box on the image holds at most so many pixels is rasterised by one thread, as is one that meets at
most so many rays in the few texels of its box on a light's map; larger ones are divided into tiles of 8 x 8. Lights,
and shares of the triangles, that a GPU processes at the same time. Measured on an H200
(docs/methods/visibility_buffer.md).
"""


def tile_steps(split: Callable[[int], None], fill: Callable[[int], None]) -> list[Step]:
    """The passes of each share for larger triangles: which tiles they cover, and the pixels or texels of these."""
    return [("tiles of larger triangles", ("items",), ("tiles",), split), ("inside of tiles", ("tiles",), (), fill)]


def threads_of(queues: Queues) -> list[int]:
    """Threads that empty a queue, and how many of them take one entry."""
    return [queues.threads, int(LANES) if queues.cuda else 1]


def raster_steps(camera: Camera) -> list[Step]:
    """Primary rays: rasterise, tiles of larger triangles, undecided pairs."""
    f, q = camera.frame, camera.queues
    split = camera.step(raster.split_kernel, q.threads, *threads_of(q), f.camera)
    fill = camera.step(raster.tile_kernel, q.threads, *threads_of(q), f.camera, f.alpha, sets=(q.nearest,))
    streamed = camera.stream(make_stream_kernel(raster.queue_tiles, None), q.share_threads)
    return [("rasterise triangles", (), ("items",), streamed), *tile_steps(split, fill), undecided_step(camera)]


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


class VisibilityBuffer(StreamedMethod):
    """See the package. Chunks are tiles."""

    name: ClassVar[str] = "visibility_buffer"
    title: ClassVar[str] = "Visibility buffer, irregular z-buffer"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha"})
    cannot: ClassVar[dict[str, str]] = {"mirror": "it rasterises rays that share an origin: mirrored rays share none"}
    Build: ClassVar[type] = Trial
    queues_on_cpu: ClassVar[bool] = True

    def settings(self, frame: Frame, lights: int, cuda: bool) -> Settings:
        # A map for rays on many faces has half as many texels along a side, unless triangles are many.
        side = math.sqrt(frame.pixels)
        many = side if 2 * frame.triangle_count > frame.pixels else side / 2
        return replace(
            Settings(
                whole_cells(many, side, 1),
                inline_pixels=INLINE_PIXELS,
                inline_rays=INLINE_RAYS,
                lights_at_once=AT_ONCE,
                shares=AT_ONCE,
            ),
            **self.build.given(),
        )

    def camera_passes(self, camera: Camera) -> list[Pass]:
        return camera.passes(raster_steps)

    def light_arrays(self, frame: Frame, settings: Settings) -> dict[str, Any]:
        arrays = cell_arrays(frame, settings.cells, sorted_rays=False)
        texels = 64 * arrays["farthest"].size
        if 4 * texels > self._memory:
            raise CapacityRejected(
                f"needs a light's map of {texels:,} texels, {4 * texels / 1e9:.1f} GB; choose fewer cells"
            )
        return {**arrays, "head": wp.zeros(texels, dtype=wp.int32, device=frame.device)}

    def light(self, rays: LightRays) -> Light:
        head = rays.arrays["head"]
        return Light(ByLists(rays, head), MapOcclusion(rays, head))

    def built(self) -> dict[str, Any]:
        return {"structure": "visibility buffer; lists of hit points in the texels of each light's map"}


METHOD = VisibilityBuffer
