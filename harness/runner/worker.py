"""The worker process of one method: it prepares, measures a round when told to, answers, and is scored.

``python -m shadowbench.harness.runner.worker`` reads one JSON command a line and writes one JSON reply a line. It does
nothing unasked, so that the parent, by waiting for each reply, lets only one worker run. What methods print goes to
standard error. The worker ends when its input does.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import warp as wp

from ..errors import CapacityRejected, UserError
from ..files import plain
from ..frame.registry import make_method
from ..frame.session import Session
from ..frame.warp_init import start_warp
from ..results.folder import FULL
from ..results.pixel_maps import map_path, write_map
from ..scene.catalogue import resolve
from ..scene.effects import Limits
from ..scene.facts import scene_facts
from ..scene.moment import Moment
from ..scene.overrides import Lighting
from ..scene.prepared import Prepared, prepare
from ..scene.shared import read_stored, store
from .experiment import spread_frames
from .grader import Grader, hand_over, handed_path
from .machine import clock_state
from .machine_lock import MACHINE
from .memory import Memory, array_bytes, peak_resident_bytes, reset_peak_resident, resident_bytes
from .timing import CompileClock, Sampling, sample_frame


class SkippedError(Exception):
    """The method says that it cannot do this scene; the text is its reason."""


class Worker:
    """The state between commands: one scene, its moments, and one session a point."""

    def __init__(self) -> None:
        self.prepared: Prepared | None = None
        self.size = (0, 0)
        self.load_s = 0.0
        self.moments: dict[int, Moment] = {}
        self.sessions: dict[str, Session] = {}
        self.memory: dict[str, dict[int, int]] = {}
        self.sources: dict[str, str] = {}
        self.points: dict[str, dict[str, Any]] = {}
        self.scene_argument = ""
        self.grader: Grader | None = None
        self.changed: frozenset[str] | None = None

    def do(self, command: dict[str, Any]) -> dict[str, Any]:
        """Carry out one command and return its reply. ``share``: hold the machine's lock, which the parent does not."""
        kind, share = command.pop("do"), command.pop("share", False)
        actions: dict[str, Callable[..., dict[str, Any]]] = {
            "load": self.load, "prepare": self.prepare, "round": self.round,
            "grade": self.grade, "free": self.free,
        }  # fmt: skip
        with MACHINE.shared() if share else contextlib.nullcontext():
            return actions[kind](**command)

    def load(
        self,
        scene: str,
        scene_dir: str | None,
        frames: int,
        width: int,
        height: int,
        shared: str,
        lighting: dict[str, Any],
        make: bool,
    ) -> dict[str, Any]:
        """Make the scene (or take the one that another worker stored) and its moments; reply with its facts."""
        self.free()
        start = time.perf_counter()
        lights = Lighting.read(lighting)
        self.changed = lights.changed
        described = lights.longer(resolve(scene, scene_dir))
        if make:
            self.prepared = lights.applied(prepare(described))
            store(Path(shared), self.prepared, spread_frames(self.prepared.frame_count, frames))
        else:
            self.prepared = lights.applied(read_stored(Path(shared), described))
        self.size = (width, height)
        self.scene_argument = scene
        for frame in spread_frames(self.prepared.frame_count, frames):
            self.moments[frame] = self.prepared.moment(frame, width, height)
        self.load_s = time.perf_counter() - start
        facts = {**scene_facts(self.prepared, self.moments), "lighting": lighting}
        return {"scene": facts, "load_s": self.load_s}

    def prepare(self, point: dict[str, Any], folder: str) -> dict[str, Any]:
        """Plan, compile, run every frame until its capacities suffice, and hand its answers over to be graded.

        Memory is counted meanwhile: it is what the method held at most, up to and with each frame. Where the samples
        of all frames would be beyond the point's budget, some frames are left out, and the reply says which.
        """
        assert self.prepared is not None
        self.points[point["key"]] = point
        device = point["device"]
        method = make_method(point["method"], point["settings"])
        reason = method.applies(self.prepared.scene, device)
        if reason:
            raise SkippedError(reason)
        if not self.sessions:
            reset_peak_resident()
        baseline = resident_bytes()
        tracker = Memory()
        tracker.start()
        start = time.perf_counter()
        held: dict[int, int] = {}
        counted = []
        with CompileClock() as compiling:
            limits = Limits(**({"memory": point["memory_limit"]} if point.get("memory_limit") else {}))
            session = Session(method, self.prepared, *self.size, device, limits=limits)
            given = session.frame
            own = array_bytes(given, given.answers, given.answers.bounces, given.alpha)
            first = None
            frames = list(self.moments)
            while len(held) < len(frames):
                frame = frames[len(held)]
                moment = self.moments[frame]
                answers = session.answers(moment)
                first = first or time.perf_counter() - start
                held[frame] = max(0, tracker.peak() - own)
                hand_over(handed_path(Path(folder), point["key"], frame), answers)
                counted.append({"frame": frame, "counters": plain(method.counters())})
                if point.get("maps"):
                    keep_map(method, moment, map_path(Path(folder), point["key"], frame))
                if len(held) == 1:
                    seconds = time.perf_counter() - start - compiling.seconds
                    frames = affordable_frames(frames, session, seconds, point["runs"], point["budget_s"])
        tracker.pause()
        # Structures outside Warp's allocators (a library's own) show only in how far the process grew.
        outside = device == "cpu" and max(held.values()) < tracker.growth() / 2 and not method.capturable
        if outside:
            held = {frame: tracker.growth() for frame in held}
        self.sessions[point["key"]] = session
        self.memory[point["key"]] = held
        self.sources[point["key"]] = "process growth" if outside else "warp allocations"
        return {
            "compile_s": compiling.seconds,
            "first_frame_s": first,
            "baseline_rss_bytes": baseline,
            "frames": counted,
            "frames_left_out": [frame for frame in self.moments if frame not in frames],
            "method": {
                "built": plain(method.built()),
                "replayed": session.replays,
                "passes": [
                    {"name": p.name, "part": p.part, "reads": p.reads, "writes": p.writes, "effect": p.effect}
                    for p in session.passes
                ],
            },
        }

    def round(self, key: str, sampling: dict[str, Any]) -> dict[str, Any]:
        """One round of samples of every frame of a point."""
        session, device = self.sessions[key], self.points[key]["device"]
        started, chosen = time.time(), Sampling(**sampling)
        frames = []
        for frame in self.memory[key]:
            measured, regrown = self._fitting_samples(session, self.moments[frame], chosen)
            frames.append(
                {
                    "frame": frame,
                    "started": measured.started,
                    "total_ms": measured.total_ms,
                    "wall_ms": measured.wall_ms,
                    "passes": measured.passes,
                    "stopped_by": measured.stopped_by,
                    "regrown": regrown,
                    "memory_bytes": self.memory[key][frame],
                    "memory_source": self.sources[key],
                }
            )
        # Never between samples: asking a GPU for its clocks disturbs it.
        return {
            "started": started,
            "spent_s": time.time() - started,
            "method": {"built": plain(session.method.built())},
            "clock": clock_state(device),
            "frames": frames,
            "peak_rss_bytes": peak_resident_bytes(),
        }

    def _fitting_samples(self, session: Session, moment: Moment, sampling: Sampling) -> tuple[Any, int]:
        """Samples of frames that fitted: after a regrowth what was measured is thrown away and taken again."""
        for _ in range(3):
            session.load(moment)
            if self.changed is not None:
                session.run()  # the last frame, of which all that did not change stays
                session.select(self.changed)
            measured = sample_frame(session, sampling)
            # What the last launch needed is still there to be read.
            if not session.overflowed():
                return measured, session.regrown
            session.settle()
        raise RuntimeError(f"{session.method.name}: needs of one frame change from run to run")

    def grade(
        self,
        key: str,
        folder: str,
        device: str,
        save_answers: bool,
        score: bool,
        picture: str,
        shows: str,
        wrong_maps: bool = False,
    ) -> dict[str, Any]:
        """Grade answers that a method's worker handed over (this command is for the grading process)."""
        assert self.prepared is not None
        if self.grader is None:
            self.grader = Grader(self.prepared, self.moments, self.scene_argument, Path(folder), device)
        frames = self.grader.grade(key, save_answers, score, Path(picture), shows, wrong_maps)
        return {"frames": frames}

    def free(self, key: str | None = None) -> dict[str, Any]:
        """Forget one point, or the scene and all of its points."""
        for name in [key] if key else list(self.points):
            for table in (self.sessions, self.memory, self.sources, self.points):
                table.pop(name, None)  # type: ignore[attr-defined]
        if key is None:
            self.prepared = self.grader = None
            self.moments.clear()
        gc.collect()
        give_back_memory()
        return {}


def affordable_frames(
    frames: list[int], session: Session, seconds: float, runs: int, budget_s: float
) -> list[int]:
    """The frames whose samples fit into a budget, spread evenly, the first among them; at least one.

    ``seconds`` is how long the first took with all that comes only once; ``runs`` how often each one will run.
    """
    if len(frames) == 1 or seconds * runs * len(frames) <= budget_s:
        return frames
    start = time.perf_counter()
    session.run()
    wp.synchronize_device(session.device)
    seconds = time.perf_counter() - start
    count = int(budget_s / (seconds * runs))
    # The first one ran already.
    return (
        frames[:1] if count < 2 else [frames[i] for i in spread_frames(len(frames), min(count, len(frames)))]
    )


def keep_map(method: Any, moment: Moment, path: Path) -> None:
    """Keep what each pixel of the last frame cost, where the method counts it (``tests_per_pixel``)."""
    counted = getattr(method, "tests_per_pixel", None)
    if counted is not None:
        write_map(path, counted()[0].reshape(moment.height, moment.width))


def answer_line(worker: Worker, line: str) -> dict[str, Any]:
    """The reply to one command: what it returns, or the kind of error (a status of a record) with its reason."""
    try:
        return {"ok": True, **worker.do(json.loads(line))}
    except CapacityRejected as error:
        return {"error": "rejected", "reason": one_line(error)}
    except SkippedError as error:
        return {"error": "skipped", "reason": one_line(error)}
    except UserError as error:
        return {"error": "failed", "reason": one_line(error)}
    except MemoryError as error:
        return {"error": "failed", "reason": f"out of memory: {one_line(error)}"}
    except OSError as error:
        traceback.print_exc()
        full = error.errno in FULL
        return {"error": "unwritable" if full else "failed", "reason": one_line(error)}
    except Exception as error:
        traceback.print_exc()
        return {"error": "failed", "reason": f"{type(error).__name__}: {one_line(error)}"}


def one_line(error: BaseException) -> str:
    """The text of an error on one line."""
    return " ".join(str(error).split()) or type(error).__name__


def serve(commands: IO[str], replies: IO[str]) -> None:
    """Answer commands until there are no more."""

    def reply(content: dict[str, Any]) -> None:
        replies.write(json.dumps(content) + "\n")
        replies.flush()

    worker = Worker()
    MACHINE.say = lambda text: reply({"waiting": text})
    for line in commands:
        if line.strip():
            reply(answer_line(worker, line))


def give_back_memory() -> None:
    """With glibc, return freed memory to the system, so that the next point's growth can be seen."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def die_with_parent() -> None:
    """On Linux, end when the parent does, even in the midst of a launch."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)


def main() -> None:
    """Keep standard output for replies, send every print to standard error, and serve."""
    die_with_parent()
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    start_warp()
    serve(sys.stdin, replies)


if __name__ == "__main__":
    main()
