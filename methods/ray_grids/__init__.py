"""Rays in grid cells, with the triangles streamed over them: the dual of the paper's method.

The paper lists triangles in the cells of a grid made for the rays, and each ray traverses the list of its cell. Here the
cells contain the rays, and every triangle tests the rays in the cells that it covers (:mod:`..streams`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ...harness.frame.schedule.passes import Pass
from ...harness.frame.schedule.threads import check_threads
from ...harness.scene.effects import Effects, Limits
from ..common.parameters import check_choices
from ..streams.camera.passes import tests_per_pixel
from ..streams.light import Light, Occlusion
from ..streams.method import StreamedMethod
from ..streams.occlusion.last_occluder import LastOccluder
from ..streams.rays.placing import ByRays, ByTriangles, LightRays
from ..streams.settings import Trial

OCCLUDERS = ("none", "last")


@dataclass(frozen=True)
class Build(Trial):
    """How triangles are streamed over the rays.

    occluders  "last": each shadow ray is tested first against the triangle that shadowed its pixel in the last frame;
               a ray that it shadows still is not placed in the light's grid. "none": no occluder is kept
    closed     whether triangles of closed surfaces that face away from a light are left out
               (methods/streams/occlusion/closed.py)
    threads    of a CPU: each streams a part of the triangles, places a part of the rays and resolves a band of the
               image; 0: one for each core that this process may use, at most 16
    trial      for tests and measurements: settings in place of those that are chosen for a frame, as
               "name=value+name=value" (methods/streams/settings.py lists them)
    """

    occluders: str = "none"
    closed: bool = True
    threads: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_threads(self.threads)
        check_choices(self, occluders=OCCLUDERS)


class RayGrids(StreamedMethod):
    """See the package."""

    name: ClassVar[str] = "ray_grids"
    title: ClassVar[str] = "Ray grids (streamed)"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha"})
    cannot: ClassVar[dict[str, str]] = {"mirror": "its grids hold rays that share an origin: mirrored rays share none"}
    Build: ClassVar[type] = Build

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._memories: list[LastOccluder] = []

    @property
    def finds_closed(self) -> bool:
        return bool(self.build.closed)

    def threads(self) -> int:
        return self.build.threads

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._memories, self.sought = [], None
        if self.build.occluders == "last" and any(effects.shadows):
            shape, device = (frame.light_count, frame.pixels), frame.device
            self.sought = wp.zeros(shape, dtype=wp.uint8, device=device)
            self._last = wp.zeros(shape, dtype=wp.int32, device=device)  # no occluder is known yet
        return super().plan(frame, effects, limits)

    def light(self, rays: LightRays) -> Light:
        if self.sought is not None:
            memory = LastOccluder(rays, self._last[rays.index])
            self._memories.append(memory)
            return Light(ByRays(rays, marks=False), Occlusion(rays, memory.last), memory)
        frame, effects, settings = rays.frame, rays.effects, rays.settings
        by_hit = effects.facing and not effects.facing_by_triangle(frame.triangle_count, frame.pixels)
        if settings.region == "rays" or (rays.spot and by_hit):
            return Light(ByRays(rays), Occlusion(rays))
        # Where the stream tests rays, or counts them, they must lie in their cells.
        overlaps = rays.queues.queued and settings.overlaps and settings.groups == "stream"
        return Light(ByTriangles(rays), Occlusion(rays, overlaps=overlaps))

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], ...]:
        """Triangle tests of each pixel's primary ray."""
        assert self._camera is not None
        return (tests_per_pixel(self._camera),)

    def counters(self) -> dict[str, int]:
        """Those of every such method, and rays that a remembered occluder settled."""
        result = super().counters()
        for memory in self._memories:
            result[f"{memory.rays.who} rays settled by the last occluder"] = memory.settled()
        return result

    def forget(self) -> None:
        """Between frames: forget the occluders of the last frame, if any are kept, so that the next is a first one."""
        for memory in self._memories:
            memory.last.zero_()

    def built(self) -> dict[str, Any]:
        assert self._queues is not None
        threads = {} if self._queues.cuda else {"threads": self._threads}
        return {"structure": "rays in the grid, triangles streamed", "queues": self._queues.queued, **threads}


METHOD = RayGrids
