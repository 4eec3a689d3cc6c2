"""Points of frames in sequence: each timed after the frame before it, in which light, camera and mesh were elsewhere.

For methods that keep something from frame to frame: timed over and over, one frame would find what it left itself. Both
moments are kept on the device and copied in outside the timed part, which is one launch of the same graph. Every entry of
a preset is measured after every step, in interleaved rounds. Answers are compared bit by bit with those of the preset's
first entry, on a frame that follows no other.
"""

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..harness.files import digest
from ..harness.frame.registry import make_method
from ..harness.frame.session import GROWTH_LIMIT, Session
from ..harness.results.folder import ResultsFolder
from ..harness.results.record import SCHEMA, Record
from ..harness.runner.measuring.measured_point import frame_bytes, spread_frames
from ..harness.runner.measuring.memory import Memory
from ..harness.runner.planning.experiment import Entry
from ..harness.runner.planning.planned_point import Options, describe_method, seed_of
from ..harness.runner.progress import Silent
from ..harness.runner.source.closure import hash_of
from ..harness.scene.facts import scene_facts
from ..harness.scene.light_paths import Orbit, vector
from ..harness.scene.moment import Moment
from ..harness.scene.prepared import Prepared, prepare, valid_triangles
from ..harness.scene.scene import Light
from ._rounds import Rounds, judged, results

CAMERA_TURN, LIGHT_TURN = 1.0 / 360.0, 4.0 / 360.0
"""Turns of the camera about its target, and of the lights about the scene's middle, in a whole step of the animation."""

INPUTS = "points valid eye axes max_coordinate tangents column row lights proxy_positions spots".split()
"""The arrays of a frame that :meth:`.frame.frame.Frame.load` fills."""

Kept = list[tuple[wp.array, wp.array]]  # the arrays of a frame, and a copy of each that holds a moment


def moment_before(prepared: Prepared, frame: int, share: float, width: int, height: int) -> Moment:
    """The moment that lies ``share`` of a step before a frame: vertices on straight lines, lights on their path and
    turned back, the camera turned back. 0: the frame itself.
    """
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
        self.forget(self.fresh)
        return self.session.answers(this)

    def timed_answers(self, before: Kept, this: Kept) -> dict[str, NDArray]:
        """The same, as frames are timed; the answers are filled with invalid values first. If a buffer of this frame, or of
        one since the last call, had to grow, the frame is made again.
        """
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

    def forget(self, wanted: bool = True) -> None:
        """Make the next frame a first one."""
        if wanted and hasattr(self.method, "forget"):
            self.method.forget()

    def _until(self, before: Kept, this: Kept) -> None:
        """Everything that comes before a timed frame. What the method kept of the last sample is forgotten first: a
        pixel without a ray in the frame before would keep the occluder that the timed frame itself has left there.
        """
        self.forget()
        for target, source in before:
            wp.copy(target, source)
        self.session.replay()
        self.forget(self.fresh)
        for target, source in this:
            wp.copy(target, source)


def measure(options: Options, report: Silent, steps: Mapping[str, float], first: str) -> list[Record]:
    """The record of each entry of the preset, on each of its scenes, after each of ``steps`` {label: share of a step}.
    Points with a record are not measured again. The entry with the label ``first`` forgets before each timed frame what
    it kept.
    """
    preset = options.preset
    with results(options, report) as (folder, made_in):
        report.steps(len(preset.scenes) * len(steps) * len(preset.methods) * preset.rounds)
        records = []
        for name in preset.scenes:
            report.doing(f"{name}: making the scene")
            records += SceneRun(options, name, report, folder, steps, first).go(made_in)
        return records


class SceneRun:
    """The points of one scene.

    this    its timed frames, by number            before  the moments before them, by step and number
    """

    def __init__(
        self, options: Options, name: str, report: Silent, folder: ResultsFolder, steps: Mapping[str, float], first: str
    ):
        self.options, self.preset, self.report = options, options.preset, report
        self.prepared = prepare(options.described(name))
        self.size = self.preset.width, self.preset.height
        # The first frame of an animation has none before it.
        least = min(1, self.prepared.frame_count - 1)
        frames = sorted({max(least, k) for k in spread_frames(self.prepared.frame_count, self.preset.frames)})
        self.this = {frame: self.prepared.moment(frame, *self.size) for frame in frames}
        self.before = {
            label: {frame: moment_before(self.prepared, frame, share, *self.size) for frame in frames}
            for label, share in steps.items()
        }
        self.steps, self.first = steps, first
        self.points = [(label, entry) for label in steps for entry in self.preset.methods]
        said = [(f"{self.prepared.scene.title}: {label}", entry.label) for label, entry in self.points]
        self.rounds = Rounds(folder, report, self.preset, [self._facts(*point) for point in self.points], said)

    def go(self, made_in: str) -> list[Record]:
        """The records, those after one step together."""
        if self.rounds.todo:
            self._measure()
        return self.rounds.records(made_in)

    def _measure(self) -> None:
        """Prepare points and take their rounds."""
        base = Played(self.preset.methods[0], self.prepared, self.size, self.options.device)
        expected = {frame: base.session.answers(moment) for frame, moment in self.this.items()}
        del base
        played = {entry.label: self._warm(entry, expected) for entry in self.preset.methods}
        kept = [self._kept(played[entry.label], label) for label, entry in self.points]

        def samples(i: int) -> list[dict[str, Any]]:
            return self._samples(played[self.points[i][1].label], kept[i], expected)

        self.rounds.measure(seed_of(f"{self.prepared.scene.name}/{self.options.seed}"), self.options.device, samples)

    def _warm(self, entry: Entry, expected: Mapping[int, dict[str, NDArray]]) -> Played:
        """An entry's method with buffers large enough for all its points, each of which is noted as prepared."""
        tracker = Memory()
        tracker.start()
        one = Played(entry, self.prepared, self.size, self.options.device, entry.label == self.first)
        for i in self.rounds.todo:
            label, own = self.points[i]
            if own is entry:
                self.report.doing(f"{self.prepared.scene.title}: {label}, warming up", entry.label)
                start = time.perf_counter()
                frames = [self._judged(one, label, frame, expected[frame]) for frame in self.this]
                self.rounds.prepared(i, time.perf_counter() - start, frames)
        tracker.pause()
        one.memory = max(0, tracker.peak() - frame_bytes(one.session))
        return one

    def _kept(self, one: Played, label: str) -> dict[int, tuple[Kept, Kept]]:
        """The frames of a step on the device, each with the one before it."""
        return {k: (one.keep(self.before[label][k]), one.keep(self.this[k])) for k in self.this}

    def _judged(self, one: Played, label: str, frame: int, expected: Mapping[str, NDArray]) -> dict[str, Any]:
        """Run a frame after the one before it; compare its answers, and count the rays that were settled."""
        answers = one.answers(self.before[label][frame], self.this[frame])
        counters = {**one.method.counters(), "shadowed rays": int((answers["shadowed"] == 1).sum())}
        return judged(frame, len(answers["triangle"]), differing(answers, expected), counters)

    def _samples(
        self, one: Played, kept: Mapping[int, tuple[Kept, Kept]], expected: Mapping[int, dict[str, NDArray]]
    ) -> list[dict[str, Any]]:
        """One round of samples of every frame. Raises RuntimeError if a timed frame gives other answers."""
        frames = []
        budget = self.preset.budget_s / self.preset.rounds / len(kept)
        for frame, moments in kept.items():
            grown = -1
            while grown != one.session.regrown:  # samples of frames that exceeded a buffer are taken again
                began, pairs, grown = time.time(), list[tuple[float, float]](), one.session.regrown
                while len(pairs) < self.preset.samples and (not pairs or time.time() - began < budget):
                    pairs += one.samples(*moments, self.preset.samples if one.session.replays else 1)
                wrong = differing(one.timed_answers(*moments), expected[frame])
            if wrong:
                raise RuntimeError(f"{one.method.name}: {wrong} timed answers of frame {frame} differ")
            ends = "samples" if len(pairs) >= self.preset.samples else "budget"
            frames.append({
                "frame": frame, "started": began, "total_ms": [round(total, 6) for total, _ in pairs],
                "wall_ms": [round(wall, 6) for _, wall in pairs], "passes": [], "stopped_by": ends,
                "regrown": one.session.regrown, "memory_bytes": one.memory, "memory_source": "warp allocations",
            })  # fmt: skip
        return frames

    def _facts(self, label: str, entry: Entry) -> dict[str, Any]:
        """The facts of a point for its record."""
        preset = self.preset
        point = {
            "schema": SCHEMA, "experiment": self.options.experiment.name, "preset": self.options.preset_name,
            "step": self.steps[label], "camera_turn": CAMERA_TURN,
            "light_turn": LIGHT_TURN, "width": preset.width, "height": preset.height,
            "samples": preset.samples, "rounds": preset.rounds, "budget_s": preset.budget_s, "seed": self.options.seed,
        }  # fmt: skip
        scene = {**scene_facts(self.prepared, self.this), "lighting": {"label": label}}
        method = describe_method(entry, self.options.device)
        method["source_sha256"] = digest([method["source_sha256"], hash_of({"played": Path(__file__)})])
        return {"point": point, "scene": scene, "method": method}


def differing(answers: Mapping[str, NDArray], expected: Mapping[str, NDArray]) -> int:
    """How many answers differ in any bit."""
    pairs = ((np.ascontiguousarray(answers[name]), np.ascontiguousarray(own)) for name, own in expected.items())
    return sum(int((a.view(f"u{a.itemsize}") != b.view(f"u{b.itemsize}")).sum()) for a, b in pairs)
