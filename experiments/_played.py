"""A frame timed after the frame before it, in which light, camera and mesh were elsewhere.

For methods that keep something from frame to frame: timed over and over, one frame would find what it left itself. Both
moments are kept on the device and copied in outside the timed part, which is one launch of the same graph.
"""

import time
from dataclasses import replace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..harness.frame.registry import make_method
from ..harness.frame.session import GROWTH_LIMIT, Session
from ..harness.runner.planning.experiment import Entry
from ..harness.scene.light_paths import Orbit, vector
from ..harness.scene.moment import Moment
from ..harness.scene.prepared import Prepared, valid_triangles
from ..harness.scene.scene import Light

CAMERA_TURN, LIGHT_TURN = 1.0 / 360.0, 4.0 / 360.0
"""Turns of the camera about its target, and of the lights about the scene's middle, in a whole step of the animation."""

INPUTS = "points valid eye axes max_coordinate tangents column row lights proxy_positions spots".split()
"""The arrays of a frame that :meth:`.frame.frame.Frame.load` fills."""

Kept = list[tuple[wp.array, wp.array]]
"""The arrays of a frame, and a copy of each that holds a moment."""


def moment_before(prepared: Prepared, frame: int, share: float, width: int, height: int) -> Moment:
    """The moment that lies ``share`` of a step before a frame: vertices on straight lines, lights on their path and
    turned back, the camera turned back. 0: the frame itself."""
    if share == 0.0:
        return prepared.moment(frame, width, height)
    scene = prepared.scene
    before = prepared.points(max(0, frame - 1))[0]
    here = prepared.points(frame)[0]
    points = (here + np.float32(share) * (before - here)).astype(np.float32)
    lights = scene.lights
    if scene.light_path is not None:
        lights = scene.light_path.at(lights, max(0.0, frame - share) / max(1, prepared.frame_count - 1))
    middle = vector(prepared.middle + prepared.centre)
    lights = Orbit(middle, scene.camera.up, -LIGHT_TURN * share).at(lights, 1.0)
    turn = Orbit(scene.camera.target, scene.camera.up, -CAMERA_TURN * share)
    (seen,) = turn.at((Light(scene.camera.eye),), 1.0)
    camera = replace(scene.camera, eye=seen.position)
    moved = prepared.moment(frame, width, height, camera=camera, lights=lights)
    return replace(moved, points=points, valid=valid_triangles(points, prepared.faces))


class Played:
    """A method on the frames of a scene, each timed after the frame before it.

    fresh   whether the method forgets before each timed frame what it kept, if it keeps anything
    memory  bytes that it held in arrays, as the caller counted them
    """

    def __init__(self, entry: Entry, prepared: Prepared, size: tuple[int, int], device: str, fresh: bool = False):
        self.method = make_method(entry.method, dict(entry.settings))
        self.session = Session(self.method, prepared, *size, device)
        self.fresh = fresh
        self.memory = 0

    def keep(self, moment: Moment) -> Kept:
        """Copies of a moment's arrays on the device."""
        self.session.load(moment)
        arrays = [getattr(self.session.frame, name) for name in INPUTS]
        return [(array, wp.clone(array)) for array in arrays if array.size]

    def answers(self, before: Moment, this: Moment) -> dict[str, NDArray]:
        """The answers of a frame after the one before it. Afterwards the buffers are large enough for both."""
        for moment in (this, before):
            self.forget()
            self.session.answers(moment)
        self._forget_if_fresh()
        return self.session.answers(this)

    def timed_answers(self, before: Kept, this: Kept) -> dict[str, NDArray]:
        """The same, as frames are timed; the answers are filled with invalid values first. If a buffer of this frame, or of
        one since the last call, had to grow, the frame is made again."""
        for _ in range(GROWTH_LIMIT):
            with wp.ScopedDevice(self.session.device):
                self._until(before, this)
                self.session.poison()
                self.session.replay()
                wp.synchronize_device(self.session.device)
            if not self.session.overflowed():
                return self.session.frame.answers.to_host()
        raise RuntimeError(f"{self.method.name}: the buffer sizes that a frame needs change from run to run")

    def samples(self, before: Kept, this: Kept, count: int) -> list[tuple[float, float]]:
        """``count`` times the device's and the host's time of a frame after the one before it, ms."""
        device = wp.get_device(self.session.device)
        with wp.ScopedDevice(device):
            wall = []
            for _ in range(count):
                self._until(before, this)
                wp.synchronize_device(device)
                start = time.perf_counter()
                self.session.replay()
                wp.synchronize_device(device)
                wall.append((time.perf_counter() - start) * 1e3)
            if not device.is_cuda:
                return [(ms, ms) for ms in wall]
            # All is queued at once: a timed launch waits for the frame before it, not for the host.
            pairs = [[wp.Event(device, enable_timing=True) for _ in range(2)] for _ in range(count)]
            for start_event, end_event in pairs:
                self._until(before, this)
                wp.record_event(start_event)
                self.session.replay()
                wp.record_event(end_event)
            wp.synchronize_device(device)
            total = [wp.get_event_elapsed_time(*pair, synchronize=False) for pair in pairs]
        return list(zip(total, wall, strict=True))

    def forget(self) -> None:
        """Make the next frame a first one."""
        forget = getattr(self.method, "forget", None)
        if forget is not None:
            forget()

    def _forget_if_fresh(self) -> None:
        if self.fresh:
            self.forget()

    def _until(self, before: Kept, this: Kept) -> None:
        """Everything that comes before a timed frame.

        What the method kept of the last sample is forgotten first: a pixel without a ray in the frame before would keep
        the occluder that the timed frame itself has left there.
        """
        self.forget()
        for target, source in before:
            wp.copy(target, source)
        self.session.replay()
        self._forget_if_fresh()
        for target, source in this:
            wp.copy(target, source)
