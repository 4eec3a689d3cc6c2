"""A worker process. It loads scenes and, on command, prepares and measures the points of one method, or scores answers.

It reads one JSON command per line and writes one JSON reply per line. It works only on command; the parent waits for each
reply, so that only one worker runs at a time. Output of methods goes to standard error. The worker ends when its input
ends; :mod:`.runner.workers.guard` starts it.
"""

import contextlib
import gc
import json
import os
import sys
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
import psutil
import warp as wp

from ...errors import CapacityRejected, UserError, one_line
from ...files import plain
from ...frame.devices import start_warp
from ...frame.method import Method
from ...frame.registry import make_method
from ...results.folder import FULL
from ...results.pixel_maps import map_path, write_map
from ...scene.chosen_view import ChosenView
from ...scene.facts import scene_facts
from ...scene.moment import Moment
from ...scene.overrides import Lighting
from ...scene.prepared import Prepared, prepare
from ...scene.shared import read_stored, store
from ..machine.environment import clock_state
from ..machine.lock import MACHINE
from ..measuring.measured_point import MeasuredPoint, SkippedError, UnsteadyError, spread_frames
from ..measuring.memory import give_back_memory, reset_peak_resident
from ..measuring.timing import Sampling, compile_clock
from .grader import Answers, Grader, hand_over, handed_path
from .protocol import UNWRITABLE


@dataclass(frozen=True)
class Lit:
    """A scene with one lighting. ``scene_argument``: as on the command line; ``changed``: see :attr:`.Lighting.changed`."""

    prepared: Prepared
    moments: dict[int, Moment]
    size: tuple[int, int]
    scene_argument: str
    changed: frozenset[str] | None


class Worker:
    """The state between commands: one scene, by its lightings' labels, and the points prepared on it.

    home  the folder that the process began in: names of scenes are relative to it
    base  the scene before any lighting, and the seconds that it took, by what it depends on
    last  the lighting that was loaded last, whose answers :meth:`grade` scores
    referees  of the frames that were scored last, which other lightings of the scene use too
    """

    def __init__(self) -> None:
        self.home = Path.cwd()
        self.base: dict[str, tuple[Prepared, float]] = {}
        self.lit: dict[str, Lit] = {}
        self.last: Lit | None = None
        self.points: dict[str, MeasuredPoint] = {}
        self.grader: Grader | None = None
        self.referees: dict[int, Any] = {}

    def do(self, command: dict[str, Any]) -> dict[str, Any]:
        """Carry out one command and return its reply. ``share``: hold the machine lock, because the parent does not."""
        kind, share = command.pop("do"), command.pop("share", False)
        actions = {one.__name__: one for one in (self.load, self.prepare, self.round, self.grade, self.free)}
        os.chdir(self.home)  # a method may have gone elsewhere
        with MACHINE.shared() if share else contextlib.nullcontext():
            reply: dict[str, Any] = actions[kind](**command)  # type: ignore[operator]
            return reply

    def load(
        self, scene: str, scene_dir: str | None, frames: int, width: int, height: int, shared: str,
        lighting: dict[str, Any], make: bool, view: dict[str, Any] | None = None, alone: bool = True,
    ) -> dict[str, Any]:  # fmt: skip
        """Load the scene with a lighting and its moments; reply with its facts. ``make`` the scene, or read the one
        that another worker stored as ``shared``; either is done once for all lightings. ``alone``: forget other
        lightings and their points.
        """
        if alone:
            self._forget_lightings()
        give_back_memory()
        start = time.perf_counter()
        lights, chosen = Lighting.read(lighting), ChosenView.read(view)
        described = lights.longer(chosen.resolved(scene, scene_dir))
        of = json.dumps([scene, scene_dir, frames, lights.frames, view])
        if of not in self.base:
            base = prepare(described) if make else read_stored(Path(shared), described)
            if make:
                with into_results():
                    store(Path(shared), base, spread_frames(base.frame_count, frames))
            self.base[of] = base, time.perf_counter() - start
            start = time.perf_counter()
        base, base_s = self.base[of]
        prepared = lights.applied(base)
        wanted = spread_frames(prepared.frame_count, frames)
        moments = {frame: prepared.moment(frame, width, height) for frame in wanted}
        load_s = base_s + time.perf_counter() - start
        self.lit[lights.label] = self.last = Lit(prepared, moments, (width, height), scene, lights.changed)
        facts = {**scene_facts(prepared, moments), "lighting": lighting}
        if chosen.text():
            facts["view"] = chosen.text()
        elif facts["source"]["kind"] == "file" and is_within(next(iter(moments.values()))):
            facts["view"] = "automatic camera, from within"
        return {"scene": facts, "load_s": load_s}

    def prepare(self, point: dict[str, Any], folder: str, light: str = "", answers: bool = True) -> dict[str, Any]:
        """Prepare a point on the scene with the lighting of this label; ``answers``: hand them over to be graded. The
        reply has ``answers``, a hash of them all, and ``room``, see :func:`room`.
        """
        lit = self.lit[light]
        make = partial(make_method, point["method"], point["settings"])

        def answered(method: Method, frame: int, given: Answers) -> None:
            if not answers:
                return
            tests_per_pixel = getattr(method, "tests_per_pixel", None) if point.get("maps") else None
            tests = None if tests_per_pixel is None else tests_per_pixel()[0]
            with into_results():
                hand_over(handed_path(Path(folder), point["key"], frame), given)
                if tests is not None:
                    write_map(map_path(Path(folder), point["key"], frame), tests.reshape(lit.size[::-1]))

        if not self.points:
            reset_peak_resident()
        made = MeasuredPoint(make, lit.prepared, lit.moments, lit.size, point, lit.changed, answered)
        self.points[point["key"]] = made
        return {**made.facts, "answers": made.answers_hash(), "room": room(made.device)}

    def round(self, key: str, sampling: dict[str, Any]) -> dict[str, Any]:
        point = self.points[key]
        # Clocks are read after the samples, because reading them disturbs a GPU.
        return {**point.round(Sampling(**sampling)), "clock": clock_state(point.device)}

    def grade(self, folder: str, device: str, **asked: Any) -> dict[str, Any]:
        """Score answers that a method's worker handed over, as ``asked`` of :meth:`.Grader.grade`."""
        lit = self.last
        assert lit is not None
        if self.grader is None:
            self.grader = Grader(lit.prepared, lit.moments, lit.scene_argument, Path(folder), device, self.referees)
        with compile_clock() as compiling, into_results():
            frames = self.grader.grade(**asked)
        return {"frames": frames, "compile_s": compiling.seconds}

    def free(self, key: str | None = None, light: str | None = None) -> dict[str, Any]:
        """Free one point, and the lighting ``light`` with it, or the scene and all of its points."""
        device = "cpu"
        if key is None:
            self._forget_lightings()
            self.base.clear()
            self.referees.clear()
        elif key in self.points:
            device = self.points.pop(key).device
        if light is not None:
            self.lit.pop(light, None)
        give_back_memory()
        return {"room": room(device)}

    def _forget_lightings(self) -> None:
        self.points.clear()
        self.lit.clear()
        self.last = self.grader = None


def room(device: str) -> float:
    """The share of a device's memory that is free, or of the host's where that is less."""
    host = psutil.virtual_memory()
    share = host.available / host.total
    if device.startswith("cuda"):
        card = wp.get_device(device)
        share = min(share, card.free_memory / card.total_memory)
    return share


def is_within(moment: Moment) -> bool:
    """Whether the eye is inside the bounding box of the triangles, as the automatic camera of a closed room is."""
    corners = moment.points[np.isfinite(moment.points).all(axis=1)]
    eye = np.asarray(moment.eye)
    return len(corners) > 0 and bool((corners.min(axis=0) < eye).all() and (eye < corners.max(axis=0)).all())


class UnwritableError(Exception):
    """The results folder cannot be written: it is full, or read-only."""


@contextlib.contextmanager
def into_results() -> Iterator[None]:
    """Around what this program writes, not a method: an error of the folder ends the run, with all that is finished."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            raise UnwritableError(one_line(error)) from error
        raise


def answer_line(worker: Worker, line: str) -> str:
    """The reply to one command, as JSON: what it returns, or the kind of error (a status of a record) with its reason."""
    try:
        return json.dumps({"ok": True, **plain(worker.do(json.loads(line)))})
    except Exception as error:
        expected = next((kind for kind in EXPECTED if isinstance(error, kind)), None)
        if expected is None:
            traceback.print_exception(error)
        status, before = EXPECTED[expected] if expected else ("failed", f"{type(error).__name__}: ")
        return json.dumps({"error": status, "reason": before + one_line(error)})


EXPECTED: dict[type[Exception], tuple[str, str]] = {
    CapacityRejected: ("rejected", ""), SkippedError: ("skipped", ""), UnwritableError: (UNWRITABLE, ""),
    UserError: ("failed", ""), UnsteadyError: ("failed", ""), MemoryError: ("failed", "out of memory: "),
}  # fmt: skip
"""Errors that say what is wrong: the status of the point, and what stands before their text."""


def serve(commands: IO[str], replies: IO[str]) -> None:
    """Answer commands until there are no more."""

    def reply(content: str) -> None:
        replies.write(content + "\n")
        replies.flush()

    worker = Worker()
    MACHINE.say = lambda text: reply(json.dumps({"waiting": text}))
    for line in commands:
        if line.strip():
            reply(answer_line(worker, line))


def main() -> None:
    """Reserve standard output for replies, redirect all other output to standard error, and serve."""
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    start_warp()
    gc.freeze()  # what is imported stays to the end: no search for garbage need visit it
    serve(sys.stdin, replies)
