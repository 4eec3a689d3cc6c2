"""Run an experiment: scene by scene, one worker process per method; a run can be stopped and resumed.

The points of a scene, of all methods and lightings, are first prepared and their answers scored, lighting by lighting.
Then their rounds are taken in turn. Only one worker runs at a time: the parent sends a command and waits for its reply.
Reading a prepared scene and scoring answers are not timed; several workers may do this at once. Other runs on the machine
wait while this one takes samples, and this one waits for them: see :mod:`.runner.machine.lock`.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from ..errors import one_line
from ..results.disputes import charged_records
from ..results.folder import ResultsFolder
from ..results.record import SCORING_FAILED, Record, as_read, make_record
from ..scene.facts import contents
from ..scene.overrides import Lighting
from .machine.environment import environment, keep
from .machine.lock import MACHINE
from .machine.sample_turns import Turns
from .measuring.memory import NOT_STOPPED, stops_allocations
from .planning.experiment import Entry
from .planning.planned_point import describe_method, make_point, orders, seed_of
from .planning.run_options import Job, Options
from .planning.survey import announcement, survey
from .planning.time_estimate import Estimate, Unit, expected_work, points_of, steps_of
from .progress import Silent
from .redraw import repaint
from .scene_cache import known_scene, learn_scene
from .unmade_scenes import forget_unmade, unmade_scene
from .workers import scratch
from .workers.handle import WorkerError, WorkerLostError
from .workers.pool import GRADER, Workers, grader_name
from .workers.protocol import grade_command, load_command

GRADERS = max(1, min(8, (os.cpu_count() or 1) // 2))
"""Number of workers that score at the same time, before the timing of a scene. Each has the scene in memory."""

GRADERS_LOST = 3
"""How many scoring processes may be killed with the answers of one point before it stays without a score. The first may have
died unseen, before it was asked."""

Described = list[tuple[Entry, dict[str, Any]]]


@dataclass(eq=False)
class Run:
    """Measures the points of an experiment; :meth:`go` returns their records in the declared order."""

    options: Options
    report: Silent
    environment: str = ""
    once: float = 0.0
    """Seconds of the current scene spent on one-time work: starting processes, compiling kernels."""
    estimate: Estimate = field(default_factory=lambda: Estimate(()))
    unit: Unit = field(default_factory=lambda: Unit(0.0, 0))
    """The points of the current scene."""
    began: float = 0.0
    """When they began; the time of waiting for other runs is subtracted."""
    name: str = field(default_factory=lambda: os.urandom(6).hex())
    """Tables compare only points of one run, because the points of a scene are interleaved."""
    turns: Turns = field(default_factory=Turns)
    card: str = ""
    """On a cluster: which card takes the samples, as its records name it."""
    graders: int = GRADERS

    def __post_init__(self) -> None:
        self.folder = ResultsFolder(self.options.out)
        self.workers = Workers(self.folder, self.options)

    def go(self) -> list[Record]:
        """Measure every point without a record. Raises :class:`~.errors.UserError` if the folder cannot be written."""
        options = self.options
        scratch.remove_abandoned()
        MACHINE.say = self.report.note
        with self.folder.locked(), MACHINE.shared():
            self.report.note(announcement(options, survey(options)))
            if options.preset.memory is not None and not stops_allocations():
                self.report.note(NOT_STOPPED)
            with self.folder.writing():
                self.environment = keep(options.out, environment())
            parts = options.preset.parts()
            self.report.steps(sum(points_of(part) * steps_of(part) for part in parts))
            self.estimate = Estimate.of(parts)
            records: list[Record] = []
            try:
                for part in parts:
                    self.options = self.workers.options = dataclasses.replace(options, preset=part)
                    methods = [(entry, describe_method(entry, options.device)) for entry in part.methods]
                    # Small scenes first, so that the first results come soon.
                    found = {
                        scene: self._scene(scene, methods)
                        for scene in sorted(part.scenes, key=lambda name: expected_work(name, part))
                    }
                    records += [record for scene in part.scenes for record in found[scene]]
            finally:
                self.workers.stop()
            self.report.doing("updating scores at pixels where several methods differ")
            return charged_records(self.folder, records)

    # --- one scene ---

    def _scene(self, name: str, methods: Described) -> list[Record]:
        """The records of a scene with every lighting; also updates the estimate of the remaining time."""
        lightings = self.options.preset.lightings
        self.unit = Unit.of(name, self.options.preset)
        self.began, self.once = time.monotonic() - MACHINE.waited, 0.0
        jobs: list[Job] = []
        waiting: list[Job] = []
        for done, lighting in enumerate(lightings, 1):
            own = self._lit(name, lighting, methods)
            jobs += own
            waiting += [job for job in own if job.record is None]
            self._ready([job for job in own if job.record is None])
            if waiting:
                # Rounds are expected to take as long as all that comes before them.
                spent, of = self._spent_on_scene(), len(lightings) / done
                self._left(round(len(waiting) * of), spent * (2 * of - 1))
        self._measure(waiting)
        for lighting in lightings:
            repaint(self.options, self.folder, [job for job in jobs if job.lighting is lighting])
        self.workers.clear()
        self.estimate.finished(self.unit, len(waiting), self._spent_on_scene())
        left = self.estimate.left()
        if left is not None:
            self.report.left(left)
        return [job.record for job in jobs if job.record is not None]

    def _left(self, measured: int, rest: float) -> None:
        """Report the remaining time of the run: ``rest`` seconds for the ``measured`` points of this scene, and others."""
        self.report.left(self.estimate.left_within(self.unit, measured, self._spent_on_scene(), rest))

    def _spent_on_scene(self) -> float:
        """Seconds that the current scene has taken, without one-time work."""
        seconds = time.monotonic() - MACHINE.waited - self.began
        return max(seconds - self.once, 0.1 * seconds)

    def _lit(self, name: str, lighting: Lighting, methods: Described) -> list[Job]:
        """The points of a scene with one lighting, loaded where there is something to measure."""
        command = load_command(self.options, self.folder, lighting, name)
        facts = known_scene(self.folder, command)
        jobs = self._jobs(name, lighting, facts, methods) if facts else []
        if facts is None or any(job.record is None for job in jobs):
            wanted = {job.method for job in jobs if job.record is None}
            fresh, lost = self._load(name, lighting, wanted or {entry.method for entry, _ in methods})
            if fresh is None:
                # The scene could not be made: every point gets a record with the reason.
                facts = facts or unmade_scene(self.options, name, lighting)
            elif facts is None or contents(fresh) != contents(facts):
                facts, jobs = fresh, []
                learn_scene(self.folder, command, facts)
            jobs = jobs or self._jobs(name, lighting, facts, methods)
            if fresh is not None:
                forget_unmade(self.folder, [(job.point.key, job.point.method["label"]) for job in jobs])
            for job in jobs:
                if job.method in lost and job.record is None:
                    self._close(job, lost[job.method].status, lost[job.method].reason)
        return jobs

    def _load(
        self, name: str, lighting: Lighting, methods: set[str]
    ) -> tuple[dict[str, Any] | None, dict[str, WorkerError]]:
        """Have one worker make the scene and the others read it. Its facts (None on failure); the workers that failed."""
        self.report.doing(f"{name}: making the scene", lighting.label)
        began = time.monotonic()
        starting = not all(self.workers.get(one).running for one in (GRADER, *methods))
        try:
            facts, lost = self.workers.make(name, lighting, methods)
        except WorkerError as error:
            return None, dict.fromkeys(methods, error)
        if starting:
            self.once += max(0.0, time.monotonic() - began - facts["load_s"])
        return facts, lost

    def _jobs(self, scene: str, lighting: Lighting, facts: dict[str, Any], methods: Described) -> list[Job]:
        options, jobs = self.options, []
        for entry, method in methods:
            point = make_point(options.experiment.name, options.preset, entry, facts, method, options.seed)
            job = Job(point, scene, self.folder.journal(point.key), steps_of(options.preset), lighting)
            kept = self.folder.record(point.key)
            if kept and not (options.retry and kept.says_nothing):
                job.record = kept
                self.report.done(job.steps)
            jobs.append(job)
        return jobs

    def _ready(self, jobs: list[Job]) -> None:
        """Prepare jobs and have their answers scored. The first job computes the exact reference alone.

        Scoring takes long, so each scoring process holds the machine lock itself and releases it between frames.
        """
        for job in jobs:
            MACHINE.give_way()
            if not job.journal.first("finished"):
                self._attempt(job, "compiling and warming up", self._prepare)
        waiting = [job for job in jobs if job.record is None and not job.journal.first("finished")]
        count = self.graders
        names = [grader_name(number) for number in range(1, count + 1)]
        batches = [waiting[:1], *(waiting[i : i + count] for i in range(1, len(waiting), count))]
        with MACHINE.released():
            for batch in batches:
                for name, job in zip(names, batch, strict=False):
                    self._attempt(job, "checking the answers", self._ask_grades, name)
                for name, job in zip(names, batch, strict=False):
                    if job.record is None:
                        self._take_grades(job, name)

    def _measure(self, jobs: list[Job]) -> None:
        """Take the rounds of all points of a scene in turn, whatever their method and lighting, and close them."""
        preset, count = self.options.preset, len(jobs)
        jobs = [job for job in jobs if job.record is None]
        if not jobs:
            return
        seed = seed_of(f"{self.options.experiment.name}/{jobs[0].scene}/{self.options.seed}")
        turns = [
            (number, place, jobs[index])
            for number, order in enumerate(orders(len(jobs), preset.rounds, seed))
            for place, index in enumerate(order)
        ]
        before = self._spent_on_scene()
        with self.turns.measuring():
            for done, (number, place, job) in enumerate(turns, 1):
                if job.record is None and number not in job.journal.rounds() and not self._spent(job):
                    where = {"round": number, "place": place, "of": len(jobs)}
                    with self.turns.round(job):
                        self._attempt(job, f"measuring, round {number + 1}", self._round, where)
                if job.record is None and number + 1 == preset.rounds:
                    self._close(job)
                self._left(count, (self._spent_on_scene() - before) / done * (len(turns) - done))

    def _spent(self, job: Job) -> bool:
        """Whether one more round, as long as the previous ones, would exceed the point's budget."""
        taken = [event["spent_s"] for event in job.journal.rounds().values()]
        return bool(taken) and sum(taken) * (len(taken) + 1) / len(taken) > self.options.preset.budget_s

    # --- steps of a point ---

    def _attempt(self, job: Job, what: str, step: Callable[..., None], *arguments: Any) -> None:
        """Do a step. Close the job if it fails."""
        who = ", ".join(filter(None, (job.point.method["label"], job.lighting.label)))
        self.report.doing(f"{job.point.scene['name']}: {what}", who)
        try:
            if job.point.method.get("broken"):
                raise WorkerError("failed", job.point.method["broken"])
            step(job, *arguments)
            job.steps -= 1
            self.report.done()
        except WorkerError as error:
            self._close(job, error.status, error.reason)
            self.workers.free(job)

    def _prepare(self, job: Job) -> None:
        reply = self.workers.prepare(job, answers=not job.journal.first("finished"))
        if reply is not None:
            self.once += reply["compile_s"]
            self._note(job, {"event": "prepared", **reply})

    def _round(self, job: Job, where: dict[str, int]) -> None:
        self._prepare(job)
        preset = self.options.preset
        frames = (job.journal.first("prepared") or {}).get("frames", ())
        sampling = {
            "samples": preset.samples,
            "most": max(preset.most, preset.samples),
            "deviation": preset.deviation,
            "stage_samples": preset.stage_samples,
            "budget_s": preset.budget_s / preset.rounds / max(1, len(frames)),
        }
        worker = self.workers.get(job.method)
        reply = self.workers.command(worker, do="round", key=job.point.key, sampling=sampling)
        self._note(job, {"event": "round", **where, **reply})

    def _ask_grades(self, job: Job, grader: str) -> None:
        """Send the command to score the answers that the method's worker handed over when the job was prepared."""
        try:
            self.workers.ensure_loaded(grader, job)
        except WorkerError as error:
            self._ask_another(job, grader, error)
            return
        command = grade_command(self.options, self.folder, job)
        self.workers.send(self.workers.get(grader), **command, wrong_maps=self.options.preset.wrong_maps)

    def _ask_another(self, job: Job, grader: str, error: WorkerError) -> None:
        """Where the scoring process was killed, have another one score the answers, which are still there."""
        killed = isinstance(error, WorkerLostError) and error.status == "failed"
        job.graders_lost += 1
        if killed and job.graders_lost < GRADERS_LOST:
            self._ask_grades(job, grader)
        else:
            self._ungraded(job, error)

    def _take_grades(self, job: Job, grader: str) -> None:
        """Note the scores."""
        while not job.journal.first("finished"):
            try:
                reply = self.workers.reply(self.workers.get(grader), self.options.preset.timeout_s)
            except WorkerError as error:
                self._ask_another(job, grader, error)
            else:
                self.once += reply["compile_s"]
                self._note(job, {"event": "finished", "frames": reply["frames"]})

    def _ungraded(self, job: Job, error: WorkerError) -> None:
        """Record that scoring failed: the times remain valid, and ``--retry`` measures the point again."""
        unscored = {"score": None, "unscored": f"{SCORING_FAILED}: {error.reason}"}
        answered = (job.journal.first("prepared") or {}).get("frames", ())
        graded = [{"frame": frame["frame"], **unscored} for frame in answered]
        self._note(job, {"event": "finished", "frames": graded})

    def _close(self, job: Job, status: str = "ok", reason: str = "") -> None:
        """Write the record of a job."""
        point = job.point
        described = {**point.configuration, "preset": self.options.preset_name}
        made_of = (point.key, described, point.scene, point.method, self.environment)
        try:
            record = as_read(make_record(*made_of, job.journal.events, status, reason))
        except ValueError as error:
            why = f"its rounds make no record: {one_line(error)}"
            record = make_record(*made_of, status="failed", reason=why)
        self.folder.keep_record(record, job.journal)
        job.record = record
        self.report.done(job.steps)
        job.steps = 0
        self.report.point(record)

    def _note(self, job: Job, event: dict[str, Any]) -> None:
        event.pop("ok", None)
        who = {"environment": self.environment, "run": self.name, **({"card": self.card} if self.card else {})}
        with self.folder.writing():
            job.journal.append({**event, **who, "noted": time.time()})
