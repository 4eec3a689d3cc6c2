"""Run an experiment: scene by scene, one worker process per method, rounds interleaved; a run can be stopped and resumed.

Only one worker runs at a time: the parent sends a command and waits for its reply. Reading a prepared scene and scoring
answers are not timed; several workers may do this at once. Other runs on the machine wait while this one takes samples,
and this one waits for them: see :mod:`.runner.machine_lock`.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..results.disputes import charged_records
from ..results.folder import ResultsFolder
from ..results.record import FAILURES, Record, make_record
from ..scene.facts import contents
from ..scene.overrides import Lighting
from .experiment import Entry
from .job import Job, Options
from .machine import environment, keep
from .machine_lock import MACHINE
from .points import describe_method, make_point, orders, seed_of
from .progress import Silent
from .protocol import LOAD_S, grade_command, load_command, prepare_command
from .redraw import repaint
from .scene_cache import known_scene, learn_scene
from .survey import announcement, survey
from .turns import Turns
from .worker_process import Remote, WorkerError, WorkerLostError
from .workload import Estimate, Unit, expected_work, points_of, steps_of

GRADER = "grading"
"""The name of the worker that makes scenes and scores answers; no method may have this name."""

GRADERS = max(1, min(8, (os.cpu_count() or 1) // 2))
"""Number of workers that score at the same time, after the timing of a scene. Each has the scene in memory."""

Described = list[tuple[Entry, dict[str, Any]]]


@dataclass(eq=False)
class Run:
    """Measures the points of an experiment; :meth:`go` returns their records in the declared order."""

    options: Options
    report: Silent
    workers: dict[str, Remote] = field(default_factory=dict)
    loaded: dict[str, int] = field(default_factory=dict)
    environment: str = ""
    lighting: Lighting = field(default_factory=Lighting)
    """The lights of the current scene."""
    once: float = 0.0
    """Seconds of the current scene spent on what is done once: starting processes, compiling kernels."""
    estimate: Estimate = field(default_factory=lambda: Estimate(()))
    unit: Unit = field(default_factory=lambda: Unit(0.0, 0))
    """The points of the current scene with the current lights."""
    began: float = 0.0
    """When they began; seconds of waiting for other runs are taken away."""
    name: str = field(default_factory=lambda: os.urandom(6).hex())
    """Tables compare only points of one run, because the points of a scene are interleaved."""
    turns: Turns = field(default_factory=Turns)
    card: str = ""
    """On a cluster: which card takes the samples, as its records name it."""
    graders: int = GRADERS

    def __post_init__(self) -> None:
        self.folder = ResultsFolder(self.options.out)

    def go(self) -> list[Record]:
        """Measure every point without a record. Raises :class:`~.errors.UserError` if the folder cannot be written."""
        options = self.options
        MACHINE.say = self.report.note
        with self.folder.locked(), MACHINE.shared():
            self.report.note(announcement(options, survey(options)))
            with self.folder.writing():
                self.environment = keep(options.out, environment())
            parts = options.preset.parts()
            self.report.steps(sum(points_of(part) * steps_of(part) for part in parts))
            self.estimate = Estimate.of(parts)
            records: list[Record] = []
            try:
                for part in parts:
                    self.options = dataclasses.replace(options, preset=part)
                    methods = [(entry, describe_method(entry, options.device)) for entry in part.methods]
                    # Small scenes first, so that the first results come soon.
                    found = {
                        scene: self._lightings(scene, methods)
                        for scene in sorted(part.scenes, key=lambda name: expected_work(name, part))
                    }
                    records += [record for scene in part.scenes for record in found[scene]]
            finally:
                for worker in self.workers.values():
                    worker.stop()
                self.folder.shared_scene.unlink(missing_ok=True)
            self.report.doing("updating scores at pixels where several methods differ")
            return charged_records(self.folder, records)

    # --- one scene ---

    def _lightings(self, name: str, methods: Described) -> list[Record]:
        """The records of a scene with each lighting; also updates the estimate of the remaining time."""
        records = []
        self.unit = Unit.of(name, self.options.preset)
        for lighting in self.options.preset.lightings:
            self.lighting = lighting
            self.began, self.once = time.monotonic() - MACHINE.waited, 0.0
            of_scene, measured = self._scene(name, methods)
            self.estimate.finished(self.unit, measured, self._spent_on_scene())
            left = self.estimate.left()
            if left is not None:
                self.report.left(left)
            records += of_scene
        return records

    def _spent_on_scene(self) -> float:
        """Seconds that the current scene with its lights has taken, without what is done once."""
        seconds = time.monotonic() - MACHINE.waited - self.began
        return max(seconds - self.once, 0.1 * seconds)

    def _scene(self, name: str, methods: Described) -> tuple[list[Record], int]:
        """The records of a scene with one lighting, and the number of points measured now."""
        self.loaded.clear()
        command = self._load_command(name)
        facts = known_scene(self.folder, command)
        jobs = self._jobs(name, facts, methods) if facts else []
        if facts is None or any(job.record is None for job in jobs):
            wanted = {job.method for job in jobs if job.record is None}
            fresh, lost = self._load(name, wanted or {entry.method for entry, _ in methods})
            if fresh is None:
                # The scene could not be made: every point gets a record with the reason.
                facts = facts or {
                    "name": Path(name).stem.lower(),
                    "title": name,
                    "source": {"kind": "", "file": name},
                    "lighting": self.lighting.facts(),
                }
            elif facts is None or contents(fresh) != contents(facts):
                facts, jobs = fresh, []
                learn_scene(self.folder, command, facts)
            jobs = jobs or self._jobs(name, facts, methods)
            for job in jobs:
                if job.method in lost and job.record is None:
                    self._close(job, lost[job.method].status, lost[job.method].reason)
        waiting = [job for job in jobs if job.record is None]
        self._measure(waiting)
        repaint(self.options, self.folder, self.lighting, jobs)
        for worker in self.workers.values():
            if worker.running:
                self._tell(worker, do="free")
        return [job.record for job in jobs if job.record is not None], len(waiting)

    def _measure(self, jobs: list[Job]) -> None:
        """Prepare the jobs, take their rounds interleaved, and finish them."""
        count = len(jobs)
        for job in jobs:
            MACHINE.give_way()
            if not job.journal.first("finished"):
                self._attempt(job, "compiling and warming up")
        prepared = self._spent_on_scene()
        jobs = [job for job in jobs if job.record is None]
        scene = jobs[0].scene if jobs else ""
        seed = seed_of(f"{self.options.experiment.name}/{scene}/{self.options.seed}")
        with self.turns.measuring():
            for number, order in enumerate(orders(len(jobs), self.options.preset.rounds, seed)):
                for place, index in enumerate(order):
                    job = jobs[index]
                    if job.record is None and number not in job.journal.rounds() and not self._spent(job):
                        where = {"round": number, "place": place, "of": len(order)}
                        with self.turns.round(job):
                            self._attempt(job, f"measuring, round {number + 1}", self._round, where)
                if not count:
                    continue
                # A round takes as long as those before it, and to check the answers about as long as to prepare.
                spent, of = self._spent_on_scene(), self.options.preset.rounds
                rest = (spent - prepared) / (number + 1) * (of - number - 1) + prepared
                self.report.left(self.estimate.left_within(self.unit, count, spent, rest))
        self._finish_all([job for job in jobs if job.record is None])

    def _finish_all(self, jobs: list[Job]) -> None:
        """Have the answers of jobs scored, and close the jobs. The first job computes the exact reference alone.

        Scoring takes long, so each scoring process holds the machine lock itself and releases it between frames.
        """
        waiting = [job for job in jobs if not job.journal.first("finished")]
        count = self.graders
        names = [GRADER, *(f"{GRADER}-{i}" for i in range(2, count + 1))]
        batches = [waiting[:1], *(waiting[i : i + count] for i in range(1, len(waiting), count))]
        with MACHINE.released():
            for batch in batches:
                for name, job in zip(names, batch, strict=False):
                    self._attempt(job, "checking the answers", self._ask_grades, name)
                for name, job in zip(names, batch, strict=False):
                    if job.record is None:
                        self._take_grades(job, name)
                        self._close(job)
        for job in jobs:
            if job.record is None:
                self._close(job)

    def _spent(self, job: Job) -> bool:
        """Whether one more round, as long as the previous ones, would exceed the point's budget."""
        taken = [event["spent_s"] for event in job.journal.rounds().values()]
        return bool(taken) and sum(taken) * (len(taken) + 1) / len(taken) > self.options.preset.budget_s

    def _jobs(self, scene: str, facts: dict[str, Any], methods: Described) -> list[Job]:
        options, jobs = self.options, []
        for entry, method in methods:
            point = make_point(options.experiment.name, options.preset, entry, facts, method, options.seed)
            job = Job(point, scene, self.folder.journal(point.key), steps_of(options.preset))
            kept = self.folder.record(point.key)
            if kept and not (options.retry and kept.status in FAILURES):
                job.record = kept
                self.report.done(job.steps)
            jobs.append(job)
        return jobs

    # --- steps of a point ---

    def _attempt(self, job: Job, what: str, step: Callable[..., None] | None = None, *arguments: Any) -> None:
        """Do a step; prepare the job first if its worker is new. Close the job if the step fails."""
        self.report.doing(f"{job.point.scene['name']}: {what}", job.point.method["label"])
        try:
            if job.point.method.get("broken"):
                raise WorkerError("failed", job.point.method["broken"])
            self._prepare(job)
            if step:
                step(job, *arguments)
            job.steps -= 1
            self.report.done()
        except WorkerError as error:
            self._close(job, error.status, error.reason)
            worker = self._worker(job.method)
            if worker.running:
                self._tell(worker, do="free", key=job.point.key)

    def _prepare(self, job: Job) -> None:
        worker = self._worker(job.method)
        if worker.running and worker.generation == job.generation:
            return
        self._ensure_loaded(job.method, job.scene)
        reply = self._command(worker, **prepare_command(self.options, job))
        job.generation = worker.generation
        self.once += reply["compile_s"]
        self._note(job, {"event": "prepared", **reply})

    def _round(self, job: Job, where: dict[str, int]) -> None:
        preset = self.options.preset
        frames = (job.journal.first("prepared") or {}).get("frames", ())
        sampling = {
            "samples": preset.samples,
            "most": max(preset.most, preset.samples),
            "deviation": preset.deviation,
            "stage_samples": preset.stage_samples,
            "budget_s": preset.budget_s / preset.rounds / max(1, len(frames)),
        }
        reply = self._command(self._worker(job.method), do="round", key=job.point.key, sampling=sampling)
        self._note(job, {"event": "round", **where, **reply})

    def _ask_grades(self, job: Job, grader: str) -> None:
        """Send the command to score the answers that the method's worker handed over when the job was prepared."""
        try:
            self._ensure_loaded(grader, job.scene)
        except WorkerError as error:
            self._ungraded(job, error)
            return
        command = grade_command(self.options, self.folder, self.lighting, job)
        self._send(self._worker(grader), **command, wrong_maps=self.options.preset.wrong_maps)

    def _take_grades(self, job: Job, grader: str) -> None:
        if job.journal.first("finished"):
            return
        try:
            reply = self._reply(self._worker(grader), self.options.preset.timeout_s)
        except WorkerError as error:
            self._ungraded(job, error)
            return
        self.once += reply["compile_s"]
        self._note(job, {"event": "finished", "frames": reply["frames"]})

    def _ungraded(self, job: Job, error: WorkerError) -> None:
        """Record that scoring failed; the times remain valid."""
        unscored = {"score": None, "unscored": f"scoring failed: {error.reason}"}
        answered = (job.journal.first("prepared") or {}).get("frames", ())
        graded = [{"frame": frame["frame"], **unscored} for frame in answered]
        self._note(job, {"event": "finished", "frames": graded})

    def _close(self, job: Job, status: str = "ok", reason: str = "") -> None:
        """Write the record of a job."""
        point = job.point
        described = {**point.configuration, "preset": self.options.preset_name}
        made_of = (point.key, described, point.scene, point.method, self.environment, job.journal.events)
        record = make_record(*made_of, status, reason)
        self.folder.keep_record(record, job.journal)
        job.record = record
        self.report.done(job.steps)
        job.steps = 0
        self.report.point(record)

    def _note(self, job: Job, event: dict[str, Any]) -> None:
        event.pop("ok", None)
        who = {
            "environment": self.environment,
            "run": self.name,
            **({"card": self.card} if self.card else {}),
        }
        with self.folder.writing():
            job.journal.append({**event, **who, "noted": time.time()})

    # --- workers ---

    def _worker(self, name: str) -> Remote:
        if name not in self.workers:
            self.workers[name] = Remote(name, self.folder.log(name))
        return self.workers[name]

    def _command(self, worker: Remote, **command: Any) -> dict[str, Any]:
        timeout = self.options.preset.timeout_s
        self._send(worker, **command)
        return self._reply(worker, max(timeout, LOAD_S) if command["do"] == "load" else timeout)

    def _send(self, worker: Remote, **command: Any) -> None:
        """Send a command. It runs under the machine lock of this process, else under the worker's."""
        worker.send(**command, share=not MACHINE.held)

    def _reply(self, worker: Remote, timeout: float) -> dict[str, Any]:
        try:
            return worker.receive(timeout)
        except WorkerError as error:
            if error.status == "unwritable":
                raise self.folder.unwritable(error.reason) from error
            raise

    def _tell(self, worker: Remote, **command: Any) -> None:
        """Send a command whose failure affects no point: the worker is stopped if it fails."""
        try:
            self._command(worker, **command)
        except WorkerLostError:
            pass
        except WorkerError:
            worker.stop()

    def _ensure_loaded(self, name: str, scene: str) -> None:
        worker = self._worker(name)
        if not worker.running or self.loaded.get(name) != worker.generation:
            self._command(worker, **self._load_command(scene))
            self.loaded[name] = worker.generation

    def _load_command(self, scene: str, make: bool = False) -> dict[str, Any]:
        return load_command(self.options, self.folder, self.lighting, scene, make)

    def _load(self, name: str, methods: set[str]) -> tuple[dict[str, Any] | None, dict[str, WorkerError]]:
        """Have one worker make the scene and the others read it. Its facts (None on failure); the workers that failed."""
        self.report.doing(f"{name}: making the scene")
        began = time.monotonic()
        starting = not all(self._worker(one).running for one in (GRADER, *methods))
        with self.folder.writing():
            self.folder.shared_scene.parent.mkdir(parents=True, exist_ok=True)
        try:
            reply = self._command(self._worker(GRADER), **self._load_command(name, make=True))
        except WorkerError as error:
            return None, dict.fromkeys(methods, error)
        self.loaded[GRADER] = self._worker(GRADER).generation
        lost = {}
        asked = [(method, self._worker(method)) for method in sorted(methods)]
        for _, worker in asked:
            self._send(worker, **self._load_command(name))
        for method, worker in asked:
            try:
                self._reply(worker, max(LOAD_S, self.options.preset.timeout_s))
                self.loaded[method] = worker.generation
            except WorkerError as error:
                lost[method] = error
        if starting:
            self.once += max(0.0, time.monotonic() - began - reply["load_s"])
        return {**reply["scene"], "load_s": reply["load_s"]}, lost
