"""Points of frames in sequence (:mod:`._played`): every entry of a preset after every step, in interleaved rounds.

Answers are compared bit by bit with those of the preset's first entry, on a frame that follows no other.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..harness.files import digest
from ..harness.results.folder import ResultsFolder
from ..harness.results.journal import Journal
from ..harness.results.record import SCHEMA, Record, make_record
from ..harness.runner.machine.environment import clock_state, environment, keep
from ..harness.runner.machine.lock import MACHINE
from ..harness.runner.measuring.measured_point import frame_bytes, spread_frames
from ..harness.runner.measuring.memory import Memory, peak_resident_bytes
from ..harness.runner.planning.experiment import Entry
from ..harness.runner.planning.planned_point import describe_method, orders, seed_of
from ..harness.runner.planning.run_options import Options
from ..harness.runner.progress import Silent
from ..harness.runner.source.closure import hash_of
from ..harness.scene.facts import scene_facts
from ..harness.scene.prepared import prepare
from . import _played
from ._played import Kept, Played, moment_before


def measure(options: Options, report: Silent, steps: Mapping[str, float], first: str) -> list[Record]:
    """The record of each entry of the preset, on each of its scenes, after each of ``steps`` {label: share of a step}.

    Points with a record are not measured again. The entry with the label ``first`` forgets before each timed frame what
    it kept.
    """
    folder, preset = ResultsFolder(options.out), options.preset
    MACHINE.say = report.note
    with folder.locked(), MACHINE.shared():
        with folder.writing():
            made_in = keep(options.out, environment())
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
        self.options, self.preset, self.report, self.folder = options, options.preset, report, folder
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

    def go(self, made_in: str) -> list[Record]:
        """The records, those after one step together."""
        facts = [self._facts(*point) for point in self.points]
        keys = [f"{f['scene']['name']}-{self.size[0]}x{self.size[1]}-{digest(f)[:24]}" for f in facts]
        found = [self.folder.record(key) for key in keys]
        todo = [i for i, record in enumerate(found) if record is None]
        journals = {i: self.folder.journal(keys[i]) for i in todo}
        self.report.done((len(keys) - len(todo)) * self.preset.rounds)
        if todo:
            self._measure(todo, journals)
        for i in todo:
            of = facts[i]["point"], facts[i]["scene"], facts[i]["method"]
            record = make_record(keys[i], *of, made_in, journals[i].events)
            self.folder.keep_record(record, journals[i])
            self.report.point(record)
            found[i] = record
        return [record for record in found if record is not None]

    def _measure(self, todo: list[int], journals: Mapping[int, Journal]) -> None:
        """Prepare points and take their rounds."""
        title, device = self.prepared.scene.title, self.options.device
        base = Played(self.preset.methods[0], self.prepared, self.size, device)
        expected = {frame: base.session.answers(moment) for frame, moment in self.this.items()}
        del base
        played = {entry.label: self._warm(entry, todo, journals, expected) for entry in self.preset.methods}
        kept = {i: self._kept(played[entry.label], label) for i, (label, entry) in enumerate(self.points)}
        seed = seed_of(f"{self.prepared.scene.name}/{self.options.seed}")
        with MACHINE.exclusive():
            for number, order in enumerate(orders(len(todo), self.preset.rounds, seed)):
                for place, index in enumerate(order):
                    i = todo[index]
                    label, entry = self.points[i]
                    self.report.doing(f"{title}: {label}, round {number + 1}", entry.label)
                    if number not in journals[i].rounds():
                        where = {"event": "round", "round": number, "place": place, "of": len(order)}
                        found = self._round(played[entry.label], kept[i], expected)
                        self._note(journals[i], {**where, **found})
                    self.report.done()

    def _warm(
        self, entry: Entry, todo: list[int], journals: Mapping[int, Journal], expected: Mapping[int, dict[str, NDArray]]
    ) -> Played:
        """An entry's method with buffers large enough for all its points, each of which is noted as prepared."""
        tracker = Memory()
        tracker.start()
        one = Played(entry, self.prepared, self.size, self.options.device, entry.label == self.first)
        for i in todo:
            label, own = self.points[i]
            if own is entry:
                self.report.doing(f"{self.prepared.scene.title}: {label}, warming up", entry.label)
                event = self._prepared(one, label, expected)
                if not journals[i].first("prepared"):
                    self._note(journals[i], event)
        tracker.pause()
        one.memory = max(0, tracker.peak() - frame_bytes(one.session))
        return one

    def _kept(self, one: Played, label: str) -> dict[int, tuple[Kept, Kept]]:
        """The frames of a step on the device, each with the one before it."""
        return {k: (one.keep(self.before[label][k]), one.keep(self.this[k])) for k in self.this}

    def _prepared(self, one: Played, label: str, expected: Mapping[int, dict[str, NDArray]]) -> dict[str, Any]:
        """Run each frame after the one before it; compare its answers, and count the rays that were settled."""
        start, frames = time.perf_counter(), []
        for frame, this in self.this.items():
            answers = one.answers(self.before[label][frame], this)
            wrong = differing(answers, expected[frame])
            pixels = len(answers["triangle"])
            rays = {"pixels": pixels, "ok": pixels - min(wrong, pixels), "true": wrong}
            check = "failed" if wrong else "ok"
            score = {"true_errors": wrong, "excused_share": 0.0, "check": check, "primary": rays, "shadow": []}
            counters = {**one.method.counters(), "shadowed rays": int((answers["shadowed"] == 1).sum())}
            frames.append({"frame": frame, "counters": counters, "score": score, "unscored": None})
        spent = time.perf_counter() - start
        return {"event": "prepared", "compile_s": 0.0, "first_frame_s": spent, "frames": frames}

    def _round(
        self, one: Played, kept: Mapping[int, tuple[Kept, Kept]], expected: Mapping[int, dict[str, NDArray]]
    ) -> dict[str, Any]:
        """One round of samples of every frame. Raises RuntimeError if a timed frame gives other answers."""
        started, frames = time.time(), []
        budget = self.preset.budget_s / self.preset.rounds / len(kept)
        for frame, moments in kept.items():
            began, pairs = time.time(), one.samples(*moments, 1)[:0]
            while len(pairs) < self.preset.samples and (not pairs or time.time() - began < budget):
                batch = self.preset.samples if one.session.replays else 1
                pairs += one.samples(*moments, batch)
            wrong = differing(one.timed_answers(*moments), expected[frame])
            if wrong:
                raise RuntimeError(f"{one.method.name}: {wrong} timed answers of frame {frame} differ")
            ends = "samples" if len(pairs) >= self.preset.samples else "budget"
            frames.append({
                "frame": frame, "started": began, "total_ms": [round(total, 6) for total, _ in pairs],
                "wall_ms": [round(wall, 6) for _, wall in pairs], "passes": [], "stopped_by": ends,
                "regrown": one.session.regrown, "memory_bytes": one.memory, "memory_source": "warp allocations",
            })  # fmt: skip
        return {"started": started, "spent_s": time.time() - started, "clock": clock_state(self.options.device),
                "frames": frames, "peak_rss_bytes": peak_resident_bytes()}  # fmt: skip

    def _note(self, journal: Journal, event: dict[str, Any]) -> None:
        with self.folder.writing():
            journal.append({**event, "noted": time.time()})

    def _facts(self, label: str, entry: Entry) -> dict[str, Any]:
        """The facts of a point for its record."""
        preset = self.preset
        point = {
            "schema": SCHEMA, "experiment": self.options.experiment.name, "preset": self.options.preset_name,
            "step": self.steps[label], "camera_turn": _played.CAMERA_TURN,
            "light_turn": _played.LIGHT_TURN, "width": preset.width, "height": preset.height,
            "samples": preset.samples, "rounds": preset.rounds, "budget_s": preset.budget_s, "seed": self.options.seed,
        }  # fmt: skip
        scene = {**scene_facts(self.prepared, self.this), "lighting": {"label": label}}
        method = describe_method(entry, self.options.device)
        own = {"played": Path(_played.__file__), "sequence": Path(__file__)}
        method["source_sha256"] = digest([method["source_sha256"], hash_of(own)])
        return {"point": point, "scene": scene, "method": method}


def differing(answers: Mapping[str, NDArray], expected: Mapping[str, NDArray]) -> int:
    """How many answers differ in any bit."""
    pairs = ((np.ascontiguousarray(answers[name]), np.ascontiguousarray(own)) for name, own in expected.items())
    return sum(int((a.view(f"u{a.itemsize}") != b.view(f"u{b.itemsize}")).sum()) for a, b in pairs)
