"""A visibility buffer for primary rays and irregular z-buffers for shadow rays: rasterisation as published, with exact
tests.

Primary rays: Burns and Hunt 2013 (the buffer), Karis 2021 (64-bit atomics on depth and index). Shadow rays: Johnson et
al. 2005 and Wyman, Hoetzlein and Lefohn 2015 (lists of hit points in the texels of a light's map). The exact tests, the
words and the light's cube are those of ``ray_grids``; how triangles are rasterised and where hit points are stored
differs.
"""

from __future__ import annotations

from typing import Any, ClassVar

import warp as wp

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ..ray_grids import RayGrids
from ..streams.cube.cells import cell_arrays
from ..streams.settings import Streams
from .parameters import Build
from .passes import CameraRaster, LightRaster


class VisibilityBuffer(RayGrids):
    """See the package. Needs: those of :class:`..ray_grids.RayGrids`; parts are tiles."""

    name: ClassVar[str] = "visibility_buffer"
    title: ClassVar[str] = "Visibility buffer, irregular z-buffer"
    cannot: ClassVar[dict[str, str]] = {
        "mirror": "it rasterises rays that share an origin: mirrored rays share none"
    }
    Build: ClassVar[type] = Build
    Camera: ClassVar[type[CameraRaster]] = CameraRaster
    Light: ClassVar[type[LightRaster]] = LightRaster

    def uses_queues(self, cuda: bool) -> bool:
        return True

    def light_arrays(self, frame: Frame, build: Streams) -> dict[str, Any]:
        arrays = cell_arrays(frame, build, sorted_rays=False)
        texels = 64 * arrays["farthest"].size
        if 4 * texels > self._memory:
            raise CapacityRejected(
                f"needs a light's map of {texels:,} texels, {4 * texels / 1e9:.1f} GB; choose fewer cells"
            )
        return {**arrays, "head": wp.zeros(texels, dtype=wp.int32, device=frame.device)}

    def built(self) -> dict[str, Any]:
        return {"structure": "visibility buffer; lists of hit points in the texels of each light's map"}


METHOD = VisibilityBuffer
