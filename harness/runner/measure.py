"""One point in its worker: prepared once, then a round of samples of every frame whenever it is asked for.

Everything that times a method or counts its memory is here or imported from here, and nothing else is: an edit of these
modules makes every record stale (:mod:`.runner.source_closure`).
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..errors import CapacityRejected, UserError
from ..frame.method import Method
from ..frame.session import Session
from ..scene.effects import Limits
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from .memory import Memory, array_bytes, give_back_memory, peak_resident_bytes, resident_bytes
from .timing import CompileClock, FrameSamples, Sampling, sample_frame

Answers = dict[str, NDArray]


class SkippedError(Exception):
    """The method says that it cannot do this scene; the text is its reason."""


class UnsteadyError(Exception):
    """The frames that were timed do not answer as the frame that is judged; the text says where."""


class MeasuredPoint:
    """A method on the moments of one scene, planned and compiled, with capacities that suffice for every frame.

    facts    what preparing it showed, for the record: seconds, counters, passes, frames left out
    changed  the inputs in which a timed frame differs from the one before it; None: whole frames are timed
    """

    def __init__(
        self,
        make: Callable[[], Method],
        prepared: Prepared,
        moments: Mapping[int, Moment],
        size: tuple[int, int],
        spec: Mapping[str, Any],
        changed: frozenset[str] | None,
        answered: Callable[[Method, int, Answers], None],
    ):
        """Plan, compile and run every frame until its capacities suffice; each frame's answers go to ``answered``.

        Memory is counted meanwhile: it is what the method held at most, up to and with each frame. Where the samples of
        all frames would be beyond the point's budget (``spec["budget_s"]``), some frames are left out. Raises
        :class:`~.errors.CapacityRejected` where the method holds more than ``spec["memory_limit"]`` bytes.
        """
        method = make()
        reason = method.applies(prepared.scene, spec["device"])
        if reason:
            raise SkippedError(reason)
        self.moments, self.device, self.changed = moments, spec["device"], changed
        self.hashes: dict[int, dict[str, str]] = {}
        held: dict[int, int] = {}
        counted, first, baseline = [], None, resident_bytes()
        tracker = Memory()
        tracker.start()
        start = time.perf_counter()
        with CompileClock() as compiling:
            limits = Limits(**({"memory": spec["memory_limit"]} if spec.get("memory_limit") else {}))
            self.session = session = Session(method, prepared, *size, self.device, limits=limits)
            given = session.frame
            own = array_bytes(given, given.answers, given.answers.bounces, given.alpha)
            frames = list(moments)
            while len(held) < len(frames):
                frame = frames[len(held)]
                answers = session.answers(moments[frame])
                first = first or time.perf_counter() - start
                held[frame] = max(0, tracker.peak() - own)
                _within(limits.memory, held[frame], tracker.growth() - ALLOWED_GROWTH)
                self.hashes[frame] = hashes(answers)
                answered(method, frame, answers)
                counted.append({"frame": frame, "counters": method.counters()})
                if len(held) == 1:
                    seconds = time.perf_counter() - start - compiling.seconds
                    frames = affordable_frames(frames, session, seconds, spec["runs"], spec["budget_s"])
        tracker.pause()
        # Structures outside Warp's allocators (a library's own) show only in how far the process grew.
        growth = tracker.growth()
        outside = self.device == "cpu" and max(held.values()) < growth / 2 and not method.capturable
        if outside:
            # The growth holds what was compiled and loaded meanwhile, too: it is counted again, now that that is there.
            del self.session, session, method, given, answers
            give_back_memory()
            tracker.start()
            self.session = session = Session(make(), prepared, *size, self.device, limits=limits)
            for frame in frames:
                session.answers(moments[frame])
            tracker.pause()
            growth = tracker.growth()
            outside = max(held.values()) < growth / 2
            _within(limits.memory, growth)
        self.memory = dict.fromkeys(held, growth) if outside else held
        self.memory_source = "process growth" if outside else "warp allocations"
        passes = [
            {"name": p.name, "part": p.part, "reads": p.reads, "writes": p.writes, "effect": p.effect}
            for p in session.passes
        ]
        self.facts: dict[str, Any] = {
            "compile_s": compiling.seconds,
            "first_frame_s": first,
            "baseline_rss_bytes": baseline,
            "frames": counted,
            "frames_left_out": [frame for frame in moments if frame not in frames],
            "method": {"built": session.method.built(), "replayed": session.replays, "passes": passes},
        }

    def round(self, sampling: Sampling) -> dict[str, Any]:
        """One round of samples of every frame. Raises :class:`UnsteadyError` where a timed frame answers otherwise."""
        started, frames = time.time(), []
        for frame, memory in self.memory.items():
            measured, regrown = self._fitting_samples(self.moments[frame], sampling)
            frames.append(
                {
                    "frame": frame,
                    "started": measured.started,
                    "total_ms": measured.total_ms,
                    "wall_ms": measured.wall_ms,
                    "passes": measured.passes,
                    "stopped_by": measured.stopped_by,
                    "regrown": regrown,
                    "memory_bytes": memory,
                    "memory_source": self.memory_source,
                }
            )
            wrong = differing(self.session, self.hashes[frame])
            if wrong:
                where = f"frame {frame}: {', '.join(wrong)}"
                raise UnsteadyError(
                    f"the frames that were timed do not answer as the frame that was judged ({where})"
                )
        return {
            "started": started,
            "spent_s": time.time() - started,
            "method": {"built": self.session.method.built()},
            "frames": frames,
            "peak_rss_bytes": peak_resident_bytes(),
        }

    def _fitting_samples(self, moment: Moment, sampling: Sampling) -> tuple[FrameSamples, int]:
        """Samples of frames that fitted: after a regrowth what was measured is thrown away and taken again."""
        session = self.session
        for _ in range(3):
            session.load(moment)
            if self.changed is not None:
                session.run()  # the last frame, of which all that did not change stays
                session.select(self.changed)
            measured = sample_frame(session, sampling)
            # What the last launch needed is still there to be read.
            if not session.overflowed():
                return measured, session.regrown
            session.run_complete()
        raise RuntimeError(f"{session.method.name}: needs of one frame change from run to run")


ALLOWED_GROWTH = 256 << 20
"""Bytes that a process may grow by beside what its method holds: compilers and what they make."""


def _within(limit: int, *held: int) -> None:
    if max(held) > limit:
        raise CapacityRejected(f"holds {max(held):,} bytes, allowed are {limit:,}")


def hashes(answers: Answers) -> dict[str, str]:
    """A hash of the bits of each array."""
    return {
        name: hashlib.blake2b(np.ascontiguousarray(values).tobytes(), digest_size=16).hexdigest()
        for name, values in answers.items()
    }


def differing(session: Session, known: Mapping[str, str]) -> list[str]:
    """The answers whose bits are not those of ``known`` where a frame is run once more as it is timed.

    They are poisoned before, so that a method which leaves standing what an earlier run wrote is seen, too.
    """
    session.poison()
    session.replay()
    wp.synchronize_device(session.device)
    found = hashes(session.frame.answers.to_host())
    return [name for name, value in known.items() if found[name] != value]


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


def spread_frames(frame_count: int, wanted: int) -> list[int]:
    """``wanted`` frames spread evenly from the first to the last; all of them where there are fewer; one: the middle.

    An animation's first frame is often its simplest, such as a cloth before it falls.
    """
    if wanted < 1:
        raise UserError(f"frames {wanted}: at least 1")
    count = min(wanted, frame_count)
    if count == 1:
        return [round((frame_count - 1) / 2)]
    return sorted({round(float(x)) for x in np.linspace(0, frame_count - 1, count)})
