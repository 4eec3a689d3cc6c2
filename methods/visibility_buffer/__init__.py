"""A visibility buffer for primary rays and irregular z-buffers for shadow rays: rasterisation as published, with exact
tests.

Primary rays: Burns and Hunt 2013 (the buffer), Karis 2021 (64-bit atomics on depth and index). Shadow rays: Johnson et
al. 2005 and Wyman, Hoetzlein and Lefohn 2015 (lists of hit points in the texels of a light's map). The exact tests, the
words and the light's cube are those of ``methods/streams``; how triangles are rasterised and where hit points are stored
differs.
"""

import math
from dataclasses import replace
from typing import Any, ClassVar

import warp as wp

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.schedule.passes import Pass
from ..streams.camera.passes import Camera
from ..streams.cube.cells import cell_arrays
from ..streams.light import Light
from ..streams.method import StreamedMethod
from ..streams.rays.placing import LightRays
from ..streams.settings import Settings, Trial, whole_cells
from .passes import ByLists, MapOcclusion, raster_steps

INLINE_PIXELS, INLINE_RAYS, AT_ONCE = 40, 64, 2
"""A triangle whose box on the image holds at most so many pixels is rasterised by one thread, as is one that meets at
most so many rays in the few texels of its box on a light's map; larger ones are divided into tiles of 8 x 8. Lights,
and shares of the triangles, that a GPU processes at the same time. Measured on an H200
(docs/methods/visibility_buffer.md)."""


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
