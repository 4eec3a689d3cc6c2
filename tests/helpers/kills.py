"""Runs whose processes are killed at random moments, and resumed until they are finished: what they leave is checked.

A run has a few scenes and methods, whose answers are scored and saved. Its processes are the run itself ("parent"), a worker
of a method, a grader, the guard between one of them and the run, and, on a cluster, the Dask worker.
"""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil
from helpers.left_processes import alive, gone, marked_environment
from helpers.tiny_runs import write_scene
from shadowbench.harness.errors import UserError
from shadowbench.harness.results.journal import Journal
from shadowbench.harness.results.record import Record
from shadowbench.harness.results.schema import read_records, whole_record

ROUNDS, SAMPLES = 6, 2
METHODS = ("uniform_grid", "warp_bvh")
SCENES = ("first", "second")
LOCKS = ("shadowbench-gate", "shadowbench-turn")
"""The files of the lock of the machine stay: they are a place, not something left behind."""

PHASES = ("making the scene", "compiling", "checking the answers", "measuring", "updating", "on card")
"""How the lines of a run's progress say what it does."""


@dataclass
class Kills:
    """What was done and found. ``kills``: how many, by process and by what the run did at that moment."""

    kills: Counter[tuple[str, str]] = field(default_factory=Counter)
    finished: int = 0
    resumed: int = 0
    findings: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        return self.kills.total()

    def of(self, process: str) -> int:
        """How many of the kills hit this kind of process."""
        return sum(count for (kind, _), count in self.kills.items() if kind == process)


class Killed:
    """Runs in a folder of their own. ``cluster``: on a Dask worker of this machine. ``haste``: how many kills are meant for
    the time that an undisturbed run takes.
    """

    def __init__(
        self, place: Path, seed: int, cluster: bool, found: Kills, scenes: Sequence[str] = SCENES,
        methods: Sequence[str] = METHODS, haste: int = 1,
    ):  # fmt: skip
        self.place, self.cluster, self.found, self.methods, self.haste = place, cluster, found, methods, haste
        self.random = random.Random(seed)
        self.kinds = ("parent", "worker", "grader", "guard", *(["Dask worker"] if cluster else []))
        self.mark, environment = marked_environment()
        for name in ("tmp", "locks"):
            (place / name).mkdir(parents=True)
        self.environment = {**environment, "TMPDIR": str(place / "tmp"), "SHADOWBENCH_TURNS": str(place / "locks")}
        self.scenes = [write_scene(place / f"{name}.obj") for name in scenes]
        self.log = place / "log"
        self.taken: dict[str, list[float]] = {}
        """Milliseconds of the rounds that were in the journals when a run was killed, by key."""
        began = time.monotonic()
        process = self._start(place / "untouched")
        if process.wait() != 0:
            raise RuntimeError(f"a run that nobody disturbs failed: {self.log.read_text()[-2000:]}")
        self.seconds = time.monotonic() - began
        self.untouched = {record.key: record for record in read_records(place / "untouched")}

    def until_finished(self, name: str, most: int) -> None:
        """Kill processes of a run at random moments, at most so many, and resume it until it is finished; then check it."""
        out, left = self.place / name, most
        self.taken.clear()
        while True:
            process = self._start(out)
            before = self.found.count
            while self.found.count - before < left and self._kill_one(process):
                pass
            left -= self.found.count - before
            code = process.wait()
            for one in gone(self.mark):
                self.found.findings.append(f"{name}: left running: {' '.join(one.cmdline())[:200]}")
                one.kill()
            self._note_rounds(out)
            if code == 0:
                break
            self.found.resumed += 1
            if left == 0 and code not in (1, 2, -signal.SIGKILL):
                self.found.findings.append(f"{name}: exit code {code}: {self.log.read_text()[-500:]}")
                return
            if "Traceback" in self.log.read_text():
                self.found.findings.append(f"{name}: {self.log.read_text()[-2000:]}")
        self.found.finished += 1
        self.found.findings += [f"{name}: {one}" for one in self.faults(out)]

    def _note_rounds(self, out: Path) -> None:
        """What a resumed run has to keep: the rounds of unfinished points, but not of those that have failed since."""
        for path in (out / "journal").glob("*.jsonl"):
            frames = [one["frames"][0] for _, one in sorted(Journal(path).rounds().items())]
            self.taken[path.stem] = [ms for frame in frames for ms in frame["total_ms"]]
        for path in (out / "records").glob("*.json"):
            record = whole_record(path)
            if record is not None and record.says_nothing:
                self.taken.pop(path.stem, None)

    def _start(self, out: Path) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "shadowbench.harness.cli", "run", "table1", "--preset", "quick"]
        command += ["--size", "64x64", "--frames", "1", "--rounds", str(ROUNDS), "--samples", str(SAMPLES)]
        command += ["--scene", *self.scenes, "--method", *self.methods]
        command += ["--save-answers", "--retry", "--out", str(out)]
        command += ["--cluster", "local", "--device", "cpu"] if self.cluster else ["--device", "cpu"]
        with self.log.open("wb") as log:
            return subprocess.Popen(command, env=self.environment, stdout=log, stderr=log)

    # --- kills ---

    def _kill_one(self, process: subprocess.Popen[bytes]) -> bool:
        """Kill a process at a random moment, of the kind that was killed least; False if the run has ended."""
        kind = min(self.kinds, key=lambda one: (self.found.of(one), self.random.random()))
        if not self._wait(process, self.random.uniform(0.0, self.seconds / self.haste)):
            return False
        while kind not in (there := self._there(process)):
            if not self._wait(process, self.random.uniform(0.0, 0.5)):
                return False
        doing = self._phase()
        try:
            self.random.choice(there[kind]).kill()
        except psutil.NoSuchProcess:
            return True  # it has ended by itself
        self.found.kills[kind, doing] += 1
        return kind != "parent"

    def _wait(self, process: subprocess.Popen[bytes], seconds: float) -> bool:
        """Whether the run lasts so long."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and process.poll() is None:
            time.sleep(0.005)
        return process.poll() is None

    def _there(self, process: subprocess.Popen[bytes]) -> dict[str, list[psutil.Process]]:
        """The processes of a run, by kind."""
        found: dict[str, list[psutil.Process]] = {"parent": [psutil.Process(process.pid)]}
        for one in alive(self.mark):
            try:
                words, parent = " ".join(one.cmdline()), one.parent()
                if "multiprocessing.spawn" in words and one.ppid() == process.pid:
                    found.setdefault("Dask worker", []).append(one)
                elif "workers.guard" in words and parent is not None:
                    guarded = "workers.guard" in " ".join(parent.cmdline())
                    log = Path(os.readlink(f"/proc/{one.pid}/fd/2")).stem
                    kind = ("grader" if log.startswith("grading") else "worker") if guarded else "guard"
                    found.setdefault(kind, []).append(one)
            except (psutil.Error, OSError):
                continue
        return found

    def _phase(self) -> str:
        """What the run does, by the last line that says so."""
        lines = self.log.read_text(errors="replace").splitlines()
        said = (phase for line in reversed(lines) for phase in PHASES if phase in line)
        return next(said, "starting")

    # --- what a finished run has left ---

    def faults(self, out: Path) -> list[str]:
        """What is wrong in the folder of a finished run, and around it."""
        try:
            records = read_records(out)
        except UserError as error:
            return [str(error)]
        found = [] if sorted(one.key for one in records) == sorted(self.untouched) else [
            f"records {sorted(one.key for one in records)} instead of {sorted(self.untouched)}"
        ]  # fmt: skip
        for record in records:
            found += [f"{record.key}: {one}" for one in self._faults_of(record, out)]
        expected = {path.relative_to(self.place / "untouched") for path in files(self.place / "untouched")}
        there = {path.relative_to(out) for path in files(out)}
        # One of them has the answers of a frame that others share, and is named by its content.
        found += [f"left behind: {path}" for path in sorted(there - expected) if path.parts[0] not in ("logs",)]
        found += [f"missing: {path}" for path in sorted(expected - there) if path.parts[0] not in ("logs",)]
        for pattern, stay in (("tmp/*", ("/",)), ("locks/*", LOCKS)):
            paths = [path for path in sorted(self.place.glob(pattern)) if not path.name.startswith(stay)]
            found += [f"left behind: {path.relative_to(self.place)}" for path in paths]
        return found

    def _faults_of(self, record: Record, out: Path) -> list[str]:
        """What is wrong with a record: a round that is missing or there twice, another score, other answers."""
        whole = self.untouched.get(record.key)
        if whole is None:
            return []
        found = []
        numbers = [one["round"] for one in record.rounds or ()]
        if record.status != "ok" or numbers != list(range(ROUNDS)):
            found.append(f"{record.status} {record.reason}, rounds {numbers}")
        (frame,), (right,) = record.frames, whole.frames
        if Counter(frame.round) != Counter(dict.fromkeys(range(ROUNDS), SAMPLES)):
            found.append(f"samples of rounds {frame.round}")
        if Counter(frame.stage_round) != Counter(right.stage_round) or len(frame.started) != ROUNDS:
            found.append(f"samples of passes of rounds {frame.stage_round}, {len(frame.started)} starts")
        if not set(self.taken.get(record.key, ())) <= set(frame.total_ms):
            found.append("rounds that were taken before it was killed are lost")
        if frame.score != right.score:
            found.append(f"its score is {frame.score} ({frame.unscored})")
        name = f"{record.key}-{frame.frame}.npz"
        paths = [place / "answers" / name for place in (out, self.place / "untouched")]
        if paths[0].exists():
            with np.load(paths[0]) as a, np.load(paths[1]) as b:
                unlike = [n for n in b.files if n != "facts" and (n not in a.files or a[n].tobytes() != b[n].tobytes())]
            found += [f"answers differ: {unlike}"] if unlike else []
        environments = out / "environments" / f"{record.environment}.json"
        if not environments.is_file() or not isinstance(json.loads(environments.read_text()), dict):
            found.append("its environment is not there")
        return found


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def kill_and_resume(place: Path, kills: int, seed: int, cluster: bool, found: Kills, say=lambda text: None) -> None:
    """Kill processes of runs so many times, and check each run when it is finished."""
    runs, before = Killed(place, seed, cluster, found), found.count
    number = 0
    while found.count - before < kills:
        number += 1
        known = len(found.findings)
        runs.until_finished(f"out{number}", kills - (found.count - before))
        news = "".join(f"\n  {one}" for one in found.findings[known:])
        say(f"{found.count - before} kills, {number} runs finished, {len(found.findings)} findings{news}")
