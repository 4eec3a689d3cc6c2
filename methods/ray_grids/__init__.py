"""Rays in grid cells, with the triangles streamed over them: the dual of the paper's method.

The paper lists triangles in the cells of a grid made for the rays, and each ray traverses the list of its cell. Here the
cells contain the rays, and every triangle tests the rays in the cells that it covers (:mod:`..streams`).
"""

from __future__ import annotations

import functools
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.frame.schedule.threads import cpu_threads
from ...harness.scene.effects import Effects, Limits
from ..streams.camera.passes import CameraStream
from ..streams.cube.aims import LightAims
from ..streams.cube.cells import cell_arrays
from ..streams.light import LightStream
from ..streams.occlusion.last_occluder import RememberingLight, occluder_arrays
from ..streams.queues import CHUNKS, COUNTERS, ITEMS, SMALL, UNDECIDED, Capacity, Queues, more_room
from ..streams.rays.placing import KnownRegionLight, SpotLight
from ..streams.settings import BESIDE, Build, Streams

MOST_TRIANGLES = 2**24
"""A hit is packed into 64 bits, 24 of them for the triangle index."""

MOST_PIXELS_ALONG = 32767
"""A queued item packs two pixel coordinates into 32 bits."""


class RayGrids(BaseMethod):
    """Rays in grids. Needs: queued items, parts and undecided pairs of the camera, then of each light."""

    name: ClassVar[str] = "ray_grids"
    title: ClassVar[str] = "Ray grids (streamed)"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha"})
    cannot: ClassVar[dict[str, str]] = {
        "mirror": "its grids hold rays that share an origin: mirrored rays share none"
    }
    Build: ClassVar[type] = Build
    Camera: ClassVar[type[CameraStream]] = CameraStream
    Light: ClassVar[type[LightStream]] = LightStream

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._capacity: Capacity | None = None
        self._needs: wp.array | None = None
        self._queues: Queues | None = None
        self._memory = 0
        self._queued = False
        self._threads = 1
        self._remembering: list[RememberingLight] = []

    def uses_queues(self, cuda: bool) -> bool:
        """Whether larger triangles go through queues on a GPU (``cuda``), or on the CPU."""
        return self.build.queue == "always" or (self.build.queue == "auto" and cuda)

    def light_arrays(self, frame: Frame, build: Streams) -> dict[str, Any]:
        """The arrays that the lights of one branch use in turn; ``build``: with what is chosen for the frame."""
        return cell_arrays(frame, build)

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        points = "exact" if sum(effects.shadows) >= BESIDE else "none"
        camera, queues = self._camera(frame, effects, limits, 1 + len(effects.shadows), points)
        wanted = [i for i, wanted in enumerate(effects.shadows) if wanted]
        branches = [(queues, self.light_arrays(frame, camera.build))] if wanted else []
        beside = camera.build.beside if self._queued else 1
        for _ in range(1, min(len(wanted), beside)):
            branches.append((queues.with_own_lists(), self.light_arrays(frame, camera.build)))
        aims = LightAims(frame, len(effects.shadows))
        make: Any = self.Light
        self._remembering = []
        remembers = getattr(self.build, "occluders", "none") == "last"
        if wanted and remembers:
            make = functools.partial(RememberingLight, **occluder_arrays(frame))
        passes: list[Pass] = []
        for number, i in enumerate(wanted):
            branch = number % len(branches)
            given = (frame, i, camera.build, camera.hit, *branches[branch], aims, effects)
            light = self._class_of(make, frame, camera.build, effects, i)(*given)
            passes += light.passes(branch)
            if isinstance(light, RememberingLight):
                self._remembering.append(light)
        # The harness marks the receivers of a light that remembers, by the answers.
        return [*camera.passes(), *passes] if remembers else camera.passes_beside(passes)

    def _class_of(self, make: Any, frame: Frame, build: Any, effects: Effects, i: int) -> Any:
        """The class of light i: ``make``, unless the region of its rays is to be known from the triangles."""
        spot = any(effects.limited[i : i + 1])
        by_hit = effects.facing and not effects.facing_by_triangle(frame.triangle_count, frame.pixels)
        if make is not LightStream or build.region != "triangles" or (spot and by_hit):
            return make
        return SpotLight if spot else KnownRegionLight

    def camera_stream(
        self, frame: Frame, effects: Effects, limits: Limits, points: str
    ) -> tuple[list[Pass], CameraStream]:
        """The passes of the primary rays alone, and what launches them. ``points``: the hit points that are kept
        (:class:`..streams.camera.passes.CameraStream`). :meth:`needs` and :meth:`grow` work as after :meth:`plan`.
        """
        camera, _ = self._camera(frame, effects, limits, 1, points)
        return camera.passes(), camera

    def _camera(
        self, frame: Frame, effects: Effects, limits: Limits, streams: int, points: str
    ) -> tuple[CameraStream, Queues]:
        """What launches the passes of the primary rays, and queues for ``streams`` streams."""
        if frame.triangle_count >= MOST_TRIANGLES:
            raise CapacityRejected(f"holds at most {MOST_TRIANGLES - 1:,} triangles")
        if max(frame.width, frame.height) > MOST_PIXELS_ALONG:
            raise CapacityRejected(f"holds at most {MOST_PIXELS_ALONG} pixels along a side")
        self._memory = limits.memory
        self._queued = self.uses_queues(wp.get_device(frame.device).is_cuda)
        threads = self._threads = cpu_threads(getattr(self.build, "threads", 1), frame.device)
        lights = sum(effects.shadows) if streams > 1 else 1
        build = self.build.chosen(frame.triangle_count, self._queued, lights, frame.pixels)
        shares = build.shares if self._queued else threads
        if self._capacity is None:  # of each share
            self._capacity = (
                self.build.item_capacity or max(262144, frame.triangle_count // shares),
                self.build.part_capacity or 65536,
                self.build.doubt_capacity or max(262144, frame.pixels // (2 * shares)),
            )
        queues = Queues(frame, self._queued, self._capacity, streams, shares, threads > 1)
        self._queues, self._needs = queues, queues.counts
        camera = self.Camera(frame, build, queues, effects, points=points, threads=threads)
        return camera, queues

    def needs(self) -> wp.array | None:
        return self._needs

    def grow(self, needed: NDArray[np.int64]) -> bool:
        assert self._capacity is not None
        before = self._capacity
        self._capacity = more_room(needed, before, self._memory)
        return self._capacity != before

    def counters(self) -> dict[str, int]:
        """Queued work of the last frame, pairs that were queued for float64, and rays that a remembered occluder settled."""
        assert self._needs is not None
        result = {}
        assert self._queues is not None
        rows = self._needs.numpy().reshape(-1, self._queues.shares, COUNTERS).sum(axis=1)
        for row, needed in enumerate(rows):
            name = "camera" if row == 0 else f"light {row - 1}"
            result[f"{name} items"] = int(needed[ITEMS] + needed[SMALL])
            result[f"{name} parts"] = int(needed[CHUNKS])
            result[f"{name} doubtful pairs"] = int(needed[UNDECIDED])
        for light in self._remembering:
            result[f"light {light.index} rays settled by the last occluder"] = light.settled()
        return result

    def forget(self) -> None:
        """Between frames: forget the occluders of the last frame, if any are kept, so that the next is a first one."""
        for light in self._remembering:
            light.last.zero_()

    def built(self) -> dict[str, Any]:
        assert self._queues is not None
        threads = {} if self._queues.cuda else {"threads": self._threads}
        return {"structure": "rays in the grid, triangles streamed", "queues": self._queued, **threads}


METHOD = RayGrids
