"""A method that streams triangles over the rays of the camera and over those of each light: what such methods share."""

from __future__ import annotations

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
from .camera.passes import Camera, resolved_late
from .cube.cells import cell_arrays
from .cube.lights import Lights
from .light import Light
from .queues import CHUNKS, COUNTERS, ITEMS, SMALL, UNDECIDED, Capacity, Queues, more_room
from .rays.placing import LightRays
from .settings import CONSTANTS, Settings, chosen, present_settings

MOST_TRIANGLES = 2**24
"""A hit is packed into 64 bits, 24 of them for the triangle index."""

MOST_PIXELS_ALONG = 32767
"""A queued item packs two pixel coordinates into 32 bits."""


def refuse_too_large(frame: Frame) -> None:
    """Raise CapacityRejected for a frame that the camera's stream cannot hold."""
    if frame.triangle_count >= MOST_TRIANGLES:
        raise CapacityRejected(f"holds at most {MOST_TRIANGLES - 1:,} triangles")
    if max(frame.width, frame.height) > MOST_PIXELS_ALONG:
        raise CapacityRejected(f"holds at most {MOST_PIXELS_ALONG} pixels along a side")


class StreamedMethod(BaseMethod):
    """Streams triangles over the rays of the camera, and over those of each light (:meth:`light`).

    Needs: queued items, chunks and undecided pairs of the camera, then of each light.

    queues_on_cpu  whether larger triangles go through queues on a CPU, too
    sought         uint8 [lights, pixels]: the receivers that have a ray, where not the harness's flags say it; or None
    """

    queues_on_cpu: ClassVar[bool] = False
    sought: wp.array | None = None

    @classmethod
    def present_settings(cls, settings: dict[str, str]) -> dict[str, str]:
        return present_settings(settings)

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._capacity: Capacity | None = None
        self._queues: Queues | None = None
        self._camera: Camera | None = None
        self._memory = 0
        self._threads = 1

    def threads(self) -> int:
        """Threads of a CPU that stream a share of the triangles each; 0: one for each core."""
        return 1

    def settings(self, frame: Frame, lights: int, cuda: bool) -> Settings:
        """The settings of a frame with so many lights that have shadows."""
        return chosen(frame.triangle_count, frame.pixels, lights, cuda, self.build.given())

    def camera_passes(self, camera: Camera) -> list[Pass]:
        return camera.passes()

    def light_arrays(self, frame: Frame, settings: Settings) -> dict[str, Any]:
        """The arrays that the lights of one branch use in turn."""
        return cell_arrays(frame, settings.cells)

    def light(self, rays: LightRays) -> Light:
        """How the rays of a light are placed, and triangles tested against them."""
        raise NotImplementedError

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        wanted = [i for i, wanted in enumerate(effects.shadows) if wanted]
        # From so many lights on, each of which would compute the exact hit points of its pairs, these are kept.
        points = "exact" if len(wanted) >= CONSTANTS.lights_at_once else "none"
        camera = self.camera(frame, effects, limits, points, len(wanted))
        queues, settings = camera.queues, camera.settings
        branches = []
        for number in range(min(len(wanted), settings.lights_at_once if queues.queued else 1)):
            own = queues.with_own_lists() if number else queues
            branches.append((own, self.light_arrays(frame, settings)))
        lights = Lights(frame, len(effects.shadows))
        passes: list[Pass] = []
        for number, i in enumerate(wanted):
            branch = number % len(branches)
            of_light = (frame, i, settings, camera.hit, *branches[branch], lights, effects, self.sought)
            passes += self.light(LightRays(*of_light)).passes(branch)
        made = self.camera_passes(camera)
        if self.sought is not None:
            return [*made, *passes]  # the harness marks the receivers by the answers
        return resolved_late(made, passes, first=bool(camera.hit.size))

    def camera(self, frame: Frame, effects: Effects, limits: Limits, points: str, lights: int | None = None) -> Camera:
        """The primary rays, with queues for them and for the ``lights`` that have shadows, all of the frame's; or, without,
        for the primary rays alone. :meth:`needs` and :meth:`grow` work as after :meth:`plan`.
        """
        refuse_too_large(frame)
        self._memory = limits.memory
        cuda = wp.get_device(frame.device).is_cuda
        queued = cuda or self.queues_on_cpu
        threads = self._threads = cpu_threads(self.threads(), frame.device)
        settings = self.settings(frame, 1 if lights is None else lights, cuda)
        shares = settings.shares if queued else threads
        if self._capacity is None:  # of each share
            self._capacity = settings.room(frame.triangle_count, frame.pixels, shares)
        streams = 1 if lights is None else 1 + len(effects.shadows)
        self._queues = Queues(frame, queued, self._capacity, streams, shares, threads > 1)
        self._camera = Camera(frame, settings, self._queues, effects, points=points, threads=threads)
        return self._camera

    def needs(self) -> wp.array | None:
        return None if self._queues is None else self._queues.needs()

    def grow(self, needed: NDArray[np.int64]) -> bool:
        assert self._capacity is not None
        assert self._queues is not None
        before = self._capacity
        self._capacity = more_room(needed, before, self._memory)
        return self._capacity != before or bool(self._queues.touched.numpy()[0])

    def counters(self) -> dict[str, int]:
        """Queued work of the last frame, and pairs that were queued for float64."""
        assert self._queues is not None
        result = {}
        rows = self._queues.counts.numpy().reshape(-1, self._queues.shares, COUNTERS).sum(axis=1)
        for row, needed in enumerate(rows):
            name = "camera" if row == 0 else f"light {row - 1}"
            result[f"{name} items"] = int(needed[ITEMS] + needed[SMALL])
            result[f"{name} chunks"] = int(needed[CHUNKS])
            result[f"{name} undecided pairs"] = int(needed[UNDECIDED])
        return result
