"""Run an experiment: scene by scene, one worker process per method; a run can be stopped and resumed.

The points of a scene, of all methods and lightings, are first prepared and their answers scored, lighting by lighting.
Then their rounds are taken in turn. Only one worker runs at a time: the parent sends a command and waits for its reply.
Reading a prepared scene and scoring answers are not timed; several workers may do this at once. Other runs on the machine
wait while this one takes samples, and this one waits for them: see :mod:`.runner.machine.lock`.
"""

import contextlib
import dataclasses
import itertools
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from ..errors import one_line, warn
from ..results.disputes import charged_records
from ..results.folder import ResultsFolder
from ..results.record import SCORING_FAILED, Record, as_read
from ..scene.facts import contents
from ..scene.overrides import Lighting
from .machine.environment import environment, keep
from .machine.lock import MACHINE
from .measuring.memory import NOT_STOPPED, stops_allocations
from .planning.experiment import Entry
from .planning.planned_point import Job, Options, dealt, describe_method, orders, seed_of
from .planning.survey import announcement, forget_unmade, known_scene, learn_scene, survey, unmade_scene
from .planning.time_estimate import Estimate, expected_work, guess_of_scene, points_of, steps_of
from .progress import Silent
from .workers import scratch
from .workers.handle import WorkerError, WorkerLostError, graders, judges_processors
from .workers.pool import GRADER, Workers, grader_name
from .workers.protocol import load_command, picture_of

GRADERS_LOST = 3
"""How many scoring processes may be killed with the answers of one point before it stays without a score. The first may have
died unseen, before it was asked.
"""

OVER = 1.25  # times its budget that a point may take before its last rounds are left out: its last sample ends late

Described = list[tuple[Entry, dict[str, Any]]]


@dataclass(eq=False)
class Run:
    """Measures the points of an experiment; :meth:`go` returns their records in the declared order."""

    options: Options
    report: Silent
    environment: str = ""
    name: str = field(default_factory=lambda: os.urandom(6).hex())
    """Tables compare only points of one run, because the points of a scene are interleaved."""
    card: str = ""  # on a cluster: the card, as records name it; the caller holds its lock
    beside: int = 1  # runs of this machine, this one included, that share the processors for scoring
    graders: int = 0  # workers that score at the same time; 0: by these processors

    def __post_init__(self) -> None:
        apart = judges_processors()
        self.graders = self.graders or graders(apart, self.beside)
        self.folder = ResultsFolder(self.options.out)
        self.workers = Workers(self.folder, self.options, apart)

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
            # Once, as a file may change before its turn comes.
            guesses = [{scene: guess_of_scene(scene, part, options.device) for scene in part.scenes} for part in parts]
            self.estimate = Estimate(
                [of[scene] for part, of in zip(parts, guesses, strict=True) for scene in part.scenes],
                lambda: time.monotonic() - MACHINE.waited,
            )
            records: list[Record] = []
            try:
                for part, guessed in zip(parts, guesses, strict=True):
                    self.options = self.workers.options = dataclasses.replace(options, preset=part)
                    methods = [(entry, describe_method(entry, options.device)) for entry in part.methods]
                    # Small scenes first, so that the first results come soon.
                    found = {
                        scene: self._scene(scene, methods, guessed[scene])
                        for scene in sorted(part.scenes, key=lambda name: expected_work(name, part))
                    }
                    records += [record for scene in part.scenes for record in found[scene]]
            finally:
                self.workers.stop()
            self.report.doing("updating scores at pixels where several methods differ")
            if self.workers.apart:
                MACHINE.release()  # this, too, is scoring
            return charged_records(self.folder, records)

    # --- one scene ---

    def _scene(self, name: str, methods: Described, guessed: float) -> list[Record]:
        """The records of a scene with every lighting; the estimate learns from the ``guessed`` seconds."""
        lightings = self.options.preset.lightings
        self.estimate.begin(guessed, len(lightings) * len(methods))
        jobs: list[Job] = []
        waiting: list[Job] = []
        for done, lighting in enumerate(lightings, 1):
            own = self._lit(name, lighting, methods)
            jobs += own
            fresh = [job for job in own if job.record is None]
            waiting += fresh
            self._ready(fresh)
            if waiting:
                # Rounds are expected to take as long as all that comes before them.
                of = len(lightings) / done
                rest = self.estimate.spent() * (2 * of - 1)
                self.report.left(self.estimate.left_within(round(len(waiting) * of), rest))
        self._measure(waiting)
        for lighting in lightings:
            self._redraw([job for job in jobs if job.lighting is lighting])
        self.workers.clear()
        self.estimate.finish(len(waiting))
        if (left := self.estimate.left()) is not None:
            self.report.left(left)
        return [job.record for job in jobs if job.record is not None]

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
        began, starting = time.monotonic(), not all(self.workers.get(one).running for one in (GRADER, *methods))
        try:
            facts, lost = self.workers.make(name, lighting, methods)
        except WorkerError as error:
            return None, dict.fromkeys(methods, error)
        if starting:
            self.estimate.once += max(0.0, time.monotonic() - began - facts["load_s"])
        return facts, lost

    def _jobs(self, scene: str, lighting: Lighting, facts: dict[str, Any], methods: Described) -> list[Job]:
        options, jobs = self.options, []
        for entry, method in methods:
            point = options.point(entry, facts, method)
            job = Job(point, scene, self.folder.journal(point.key), steps_of(options.preset), lighting)
            kept = self.folder.record(point.key)
            if kept and not (options.retry and kept.says_nothing):
                job.record = kept
                self.report.done(job.steps)
            jobs.append(job)
        return jobs

    def _ready(self, jobs: list[Job]) -> None:
        """Prepare jobs and have their answers scored, as :func:`.dealt` says. Scoring takes long, so each scoring
        process holds the machine lock itself and releases it between frames.
        """
        unscored = [job for job in jobs if not job.journal.first("finished")]
        for job in unscored:
            MACHINE.give_way()
            self._attempt(job, "compiling and warming up", self._prepare)
        waiting = [job for job in unscored if job.record is None]
        with MACHINE.released():
            for turn in itertools.zip_longest(*dealt(waiting, self.graders)):
                asked = [(grader_name(number), job) for number, job in enumerate(turn, 1) if job is not None]
                for name, job in asked:
                    self._attempt(job, "checking the answers", self._ask_grades, name)
                for name, job in asked:
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
        before = self.estimate.spent()
        with contextlib.nullcontext() if self.card else MACHINE.exclusive():
            for done, (number, place, job) in enumerate(turns, 1):
                if job.record is None and number not in job.journal.rounds() and not self._spent(job):
                    where = {"round": number, "place": place, "of": len(jobs)}
                    with self._turn(job):
                        self._attempt(job, f"measuring, round {number + 1}", self._round, where)
                rest = (self.estimate.spent() - before) / done * (len(turns) - done)
                self.report.left(self.estimate.left_within(count, rest))
        for job in jobs:
            if job.record is None:
                MACHINE.give_way()
                self._close(job)

    def _turn(self, job: Job) -> contextlib.AbstractContextManager[None]:
        """Around one round of a point. On a cluster several cards of a machine measure at the same time. The clock of a
        GPU times a captured graph, whatever the host does meanwhile. A method on the CPU, and one whose launches the
        host must issue in time, needs the machine alone: all others pause between two of their rounds.
        """
        if not self.card:
            return contextlib.nullcontext()
        MACHINE.give_way()
        method = job.point.method
        captured = str(method["device"]).startswith("cuda") and method.get("capturable")
        return contextlib.nullcontext() if captured else MACHINE.exclusive()

    def _redraw(self, jobs: list[Job]) -> None:
        """Draw the picture of a scene with one lighting where it is missing or damaged though all its points have
        records. The first measured point is answered again, untimed. If it cannot be drawn, a message says so.
        """
        from ..report.picture import opened

        job = next((job for job in jobs if job.record is not None and job.record.status == "ok"), None)
        if job is None or opened(picture_of(self.folder, job)) is not None:
            return
        try:
            self.workers.make(job.scene, job.lighting, {job.method})
            job.generation = 0
            self.workers.prepare(job, answers=True)
            self.workers.score(GRADER, job)
            self.workers.reply(self.workers.get(GRADER))
        except WorkerError as error:
            warn(f"{picture_of(self.folder, job)}: cannot be drawn ({error.reason})")

    def _spent(self, job: Job) -> bool:
        """Whether one more round, as long as the previous ones, would exceed :data:`OVER` times the point's budget."""
        taken = [event["spent_s"] for event in job.journal.rounds().values()]
        return bool(taken) and sum(taken) * (len(taken) + 1) / len(taken) > OVER * self.options.preset.budget_s

    # --- steps of a point ---

    def _attempt(self, job: Job, what: str, step: Callable[..., None], *arguments: Any) -> None:
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
            self.estimate.once += reply["compile_s"]
            self._note(job, {"event": "prepared", **reply})

    def _round(self, job: Job, where: dict[str, int]) -> None:
        self._prepare(job)
        preset = self.options.preset
        frames = (job.journal.first("prepared") or {}).get("frames", ())
        sampling = {name: getattr(preset, name) for name in ("samples", "deviation", "stage_samples", "costs_s")}
        sampling["most"] = max(preset.most, preset.samples)
        sampling["budget_s"] = preset.budget_s / preset.rounds / max(1, len(frames))
        worker = self.workers.get(job.method)
        reply = self.workers.command(worker, do="round", key=job.point.key, sampling=sampling)
        self._note(job, {"event": "round", **where, **reply})

    def _ask_grades(self, job: Job, grader: str) -> None:
        try:
            self.workers.ensure_loaded(grader, job)
        except WorkerError as error:
            self._ask_another(job, grader, error)
        else:
            self.workers.score(grader, job)

    def _ask_another(self, job: Job, grader: str, error: WorkerError) -> None:
        """Where the scoring process was killed, have another one score the answers, which are still there; else give up."""
        killed = isinstance(error, WorkerLostError) and error.status == "failed"
        job.graders_lost += 1
        if killed and job.graders_lost < GRADERS_LOST:
            self._ask_grades(job, grader)
            return
        # Scoring failed: the times remain valid, and ``--retry`` measures the point again.
        unscored = {"score": None, "unscored": f"{SCORING_FAILED}: {error.reason}"}
        answered = (job.journal.first("prepared") or {}).get("frames", ())
        graded = [{"frame": frame["frame"], **unscored} for frame in answered]
        self._note(job, {"event": "finished", "frames": graded})

    def _take_grades(self, job: Job, grader: str) -> None:
        while not job.journal.first("finished"):
            try:
                reply = self.workers.reply(self.workers.get(grader))
            except WorkerError as error:
                self._ask_another(job, grader, error)
            else:
                self.estimate.once += reply["compile_s"]
                self._note(job, {"event": "finished", "frames": reply["frames"]})

    def _close(self, job: Job, status: str = "ok", reason: str = "") -> None:
        try:
            record = as_read(self.options.record(job.point, job.journal.events, self.environment, status, reason))
        except ValueError as error:
            why = f"its rounds make no record: {one_line(error)}"
            record = self.options.record(job.point, (), self.environment, "failed", why)
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
