"""From an experiment to records: scene by scene, one worker a method, rounds interleaved, killed and resumed at will.

Only one worker has the token at a time: the parent asks one and waits for its reply. (Making a scene is not timed;
there all of them work at once.)
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from .environment import environment, keep
from .errors import UserError
from .plan import Entry, Experiment, Point, Preset, describe_method, make_point, orders
from .record import Journal, make_record, write_atomic
from .remote import Remote, WorkerError, WorkerLost

GRADER = "grading"
"""The name of the worker that grades (no method may be called so)."""

UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO)


@dataclass(frozen=True)
class Options:
    """One call of ``shadowbench run``, checked."""

    experiment: Experiment
    preset_name: str
    preset: Preset
    device: str
    out: Path
    scene_dir: str | None = None
    seed: int = 0
    save_answers: bool = False
    score: bool = True
    retry: bool = False
    memory_limit: int | None = None


class Reporter(Protocol):
    """Told what goes on. A step is one command to one worker."""

    def steps(self, count: int) -> None: ...
    def doing(self, text: str) -> None: ...
    def done(self, count: int = 1) -> None: ...
    def point(self, record: dict[str, Any]) -> None: ...


@dataclass(eq=False)
class Job:
    """A point under way. ``generation`` is that of the worker that prepared it, 0 before."""

    point: Point
    journal: Journal
    generation: int = 0
    record: dict[str, Any] | None = None


@dataclass(eq=False)
class Run:
    """Carries out the points of an experiment; :meth:`go` returns their records in the order declared."""

    options: Options
    report: Reporter
    workers: dict[str, Remote] = field(default_factory=dict)
    loaded: dict[str, int] = field(default_factory=dict)
    environment: str = ""

    def go(self) -> list[dict[str, Any]]:
        """Run what has no record yet. Raises :class:`UserError` where the folder cannot be written."""
        options = self.options
        with locked(options.out):
            with self._writing():
                self.environment = keep(options.out, environment())
            methods = {key: describe_method(key.entry, options.device) for key in _entries(options.preset)}
            self.report.steps(len(options.preset.scenes) * len(methods) * self._steps_a_point())
            records: list[dict[str, Any]] = []
            try:
                for scene in options.preset.scenes:
                    records += self._scene(scene, methods)
            finally:
                for worker in self.workers.values():
                    worker.stop()
        return records

    def _steps_a_point(self) -> int:
        return self.options.preset.rounds + 2

    # --- one scene ---

    def _scene(self, name: str, methods: dict[_Key, dict[str, Any]]) -> list[dict[str, Any]]:
        self.loaded.clear()
        facts = self._known_facts(name)
        jobs = self._jobs(facts, methods) if facts else []
        if not facts or any(job.record is None for job in jobs):
            wanted = {job.point.entry.method for job in jobs if job.record is None}
            fresh, lost = self._load(name, wanted or {key.entry.method for key in methods})
            if fresh is None:
                # Nobody could make the scene: every point gets a record that says why.
                facts = facts or {"name": _short(name), "title": name, "source": {"kind": "file", "file": name}}
            elif facts is None or fresh["arrays_sha256"] != facts["arrays_sha256"]:
                facts = self._learn(name, fresh)
                jobs = []
            jobs = jobs or self._jobs(facts, methods)
            for job in jobs:
                error = lost.get(job.point.entry.method)
                if error is not None and job.record is None:
                    self._close(job, error.status, error.reason)
        self._measure(name, jobs)
        for worker in self.workers.values():
            if worker.running:
                self._ask(worker, do="free")
        self._shared.unlink(missing_ok=True)
        return [job.record for job in jobs if job.record is not None]

    def _measure(self, name: str, jobs: list[Job]) -> None:
        """Prepare the open jobs, take their rounds interleaved, and finish them."""
        for job in jobs:
            if job.record is None and not self._complete(job):
                self._attempt(job, name, "compiling and warming up", lambda job: None)
        open_jobs = [job for job in jobs if job.record is None]
        rounds = self.options.preset.rounds
        for number, order in enumerate(orders(len(open_jobs), rounds, self._seed(name))):
            for place, index in enumerate(order):
                job = open_jobs[index]
                if number in job.journal.rounds():
                    self.report.done()
                elif job.record is None:
                    where = {"round": number, "place": place, "of": len(order)}
                    text = f"round {number + 1} of {rounds}"
                    self._attempt(job, name, text, lambda job, where=where: self._round(job, where))  # type: ignore[misc]
        for job in open_jobs:
            if job.record is None:
                if not job.journal.first("finished"):
                    self._attempt(job, name, "checking the answers", lambda job: self._finish(job, name))
                if job.record is None:
                    self._close(job)

    def _complete(self, job: Job) -> bool:
        """Whether only the record is missing."""
        return job.journal.first("finished") is not None

    def _seed(self, name: str) -> int:
        text = f"{self.options.experiment.name}/{name}/{self.options.seed}"
        return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big")

    def _jobs(self, facts: dict[str, Any], methods: dict[_Key, dict[str, Any]]) -> list[Job]:
        options, jobs = self.options, []
        for key, method in methods.items():
            point = make_point(options.experiment.name, options.preset, key.entry, facts, method, options.seed)
            path = self._record_path(point.key)
            job = Job(point, Journal(options.out / "journal" / f"{point.key}.jsonl"))
            if path.exists():
                kept = json.loads(path.read_text(encoding="utf-8"))
                if not (options.retry and kept["status"] in ("failed", "timeout")):
                    job.record = kept
                    self.report.done(self._steps_a_point())
            jobs.append(job)
        return jobs

    # --- steps of a point ---

    def _attempt(self, job: Job, scene: str, what: str, step: Callable[[Job], None]) -> None:
        """Do a step, preparing the job first where its worker is new; close the job if it comes to nothing."""
        point = job.point
        self.report.doing(f"{point.scene['name']}, {point.method['label']}: {what}")
        try:
            self._prepare(job, scene)
            step(job)
            self.report.done()
        except WorkerError as error:
            self._close(job, error.status, error.reason)
            worker = self.workers[point.entry.method]
            if worker.running:
                self._ask(worker, do="free", key=point.key)

    def _prepare(self, job: Job, scene: str) -> None:
        point = job.point
        worker = self._worker(point.entry.method)
        if worker.running and worker.generation == job.generation:
            return
        if self.loaded.get(point.entry.method) != worker.generation or not worker.running:
            self._command(worker, **self._load_command(scene))
            self.loaded[point.entry.method] = worker.generation
        spec = {
            "key": point.key,
            "method": point.entry.method,
            "settings": dict(point.entry.settings),
            "device": point.method["device"],
            "memory_limit": self.options.memory_limit,
        }
        reply = self._command(worker, do="prepare", point=spec)
        job.generation = worker.generation
        self._note(job, {"event": "prepared", "environment": self.environment, **reply})

    def _round(self, job: Job, where: dict[str, int]) -> None:
        preset = self.options.preset
        share = preset.budget_s / preset.rounds / max(1, len(job.point.frames)) / 2
        sampling = {
            "samples": preset.samples,
            "most": max(preset.most, preset.samples),
            "deviation": preset.deviation,
            "stage_samples": preset.stage_samples,
            "budget_s": share,
        }
        reply = self._command(self._worker(job.point.entry.method), do="round", key=job.point.key, sampling=sampling)
        self._note(job, {"event": "round", "environment": self.environment, **where, **reply})

    def _finish(self, job: Job, scene: str) -> None:
        """Answers from the method's worker, their grades from the grading one."""
        options, point = self.options, job.point
        worker = self._worker(point.entry.method)
        answered = self._command(worker, do="answer", key=point.key, folder=str(options.out))
        grader = self._worker(GRADER)
        if not grader.running or self.loaded.get(GRADER) != grader.generation:
            self._command(grader, **self._load_command(scene))
            self.loaded[GRADER] = grader.generation
        image = options.out / "images" / f"{point.scene['name']}.png"
        graded = self._command(
            grader,
            do="grade",
            key=point.key,
            folder=str(options.out),
            device=options.device,
            save_answers=options.save_answers,
            score=options.score,
            picture=None if image.exists() else str(image),
        )
        frames = [{**a, **g} for a, g in zip(answered["frames"], graded["frames"], strict=True)]
        self._note(job, {"event": "finished", "method": answered["method"], "frames": frames})

    def _close(self, job: Job, status: str = "ok", reason: str = "") -> None:
        """Write the record of a job. Its journal has done its work."""
        point = job.point
        described = {**point.configuration, "preset": self.options.preset_name}
        job.record = make_record(
            point.key, described, point.scene, point.method, self.environment, job.journal.events, status, reason
        )
        with self._writing():
            write_atomic(self._record_path(point.key), job.record)
            job.journal.remove()
        self.report.point(job.record)

    def _note(self, job: Job, event: dict[str, Any]) -> None:
        event.pop("ok", None)
        with self._writing():
            job.journal.append({**event, "noted": time.time()})

    # --- workers ---

    def _worker(self, method: str) -> Remote:
        if method not in self.workers:
            self.workers[method] = Remote(method, self.options.out / "logs" / f"{method}.log")
        return self.workers[method]

    def _command(self, worker: Remote, **command: Any) -> dict[str, Any]:
        try:
            return worker.ask(self.options.preset.timeout_s, **command)
        except WorkerError as error:
            if error.status == "unwritable":
                raise self._unwritable(error.reason) from error
            raise

    def _ask(self, worker: Remote, **command: Any) -> None:
        """A command whose failure costs nobody a point: a worker that cannot do it is stopped."""
        try:
            self._command(worker, **command)
        except WorkerLost:
            pass
        except WorkerError:
            worker.stop()

    def _load_command(self, scene: str, make: bool = False) -> dict[str, Any]:
        """What has a worker load the scene: ``make`` it, or take the one that was made."""
        preset = self.options.preset
        return {
            "do": "load",
            "scene": scene,
            "scene_dir": self.options.scene_dir,
            "frames": preset.frames,
            "width": preset.width,
            "height": preset.height,
            "shared": str(self._shared),
            "make": make,
        }

    @property
    def _shared(self) -> Path:
        return self.options.out / "journal" / "scene.npz"

    def _load(self, name: str, methods: set[str]) -> tuple[dict[str, Any] | None, dict[str, WorkerError]]:
        """Have one worker make the scene and the others take it: its facts (None where it failed), and who failed."""
        self.report.doing(f"{name}: making the scene")
        try:
            reply = self._command(self._worker(GRADER), **self._load_command(name, make=True))
        except WorkerError as error:
            return None, dict.fromkeys(methods, error)
        self.loaded[GRADER] = self._worker(GRADER).generation
        lost = {}
        asked = [(method, self._worker(method)) for method in sorted(methods)]
        for _, worker in asked:
            worker.send(**self._load_command(name))
        for method, worker in asked:
            try:
                worker.receive(self.options.preset.timeout_s)
                self.loaded[method] = worker.generation
            except WorkerError as error:
                lost[method] = error
        return {**reply["scene"], "load_s": reply["load_s"]}, lost

    # --- facts of scenes, kept so that a finished run makes no scene again ---

    def _known_facts(self, name: str) -> dict[str, Any] | None:
        return _read_json(self.options.out / "scenes.json").get(self._scene_id(name))

    def _learn(self, name: str, facts: dict[str, Any]) -> dict[str, Any]:
        path = self.options.out / "scenes.json"
        with self._writing():
            write_atomic(path, {**_read_json(path), self._scene_id(name): facts})
        return facts

    def _scene_id(self, name: str) -> str:
        from .scenes.catalogue import resolve

        here = Path(__file__).parent
        code = hashlib.sha256(np.__version__.encode())
        for path in [*sorted((here / "scenes").glob("*.py")), *(here / f"{n}.py" for n in ("moment", "lights"))]:
            code.update(path.read_bytes())
        source = resolve(name, self.options.scene_dir).source
        command = self._load_command(name)
        for place in ("scene_dir", "shared"):
            command.pop(place)
        return hashlib.sha256(f"{command} {source} {code.hexdigest()}".encode()).hexdigest()[:16] + f" {_short(name)}"

    # --- the folder ---

    def _record_path(self, key: str) -> Path:
        return self.options.out / "records" / f"{key}.json"

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            if error.errno in UNWRITABLE:
                raise self._unwritable(error.strerror or str(error)) from error
            raise

    def _unwritable(self, reason: str) -> UserError:
        return UserError(
            f"{self.options.out}: cannot write ({reason}); what was measured is kept: make room or choose another "
            f"--out, then run the same command to go on"
        )


@dataclass(frozen=True, eq=False)
class _Key:
    """An entry as a key: two entries may have the same method."""

    entry: Entry


def _entries(preset: Preset) -> list[_Key]:
    return [_Key(entry) for entry in preset.methods]


def _short(name: str) -> str:
    return Path(name).stem.lower()


def _read_json(path: Path) -> dict[str, Any]:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Make the results folder and hold it for this process. Raises :class:`UserError` where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = open(folder / ".lock", "w", encoding="utf-8")  # noqa: SIM115  (held until the run ends)
    except OSError as error:
        raise UserError(f"{folder}: cannot write there ({error.strerror}); choose another --out") from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise UserError(f"{folder}: another run is writing there; wait for it or choose another --out") from error
        yield
