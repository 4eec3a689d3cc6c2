"""Measure one point in its worker process: prepare it once, then take rounds of samples of every frame on request. This
module and its imports contain everything that times a method or counts its memory, and nothing else, because a change
of their code makes every record outdated (:mod:`.runner.source.closure`).
"""

import hashlib
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...errors import CapacityRejected, UserError, one_line
from ...frame.method import Method
from ...frame.room import fewer_that_fit
from ...frame.session import Session
from ...scene.effects import Effects, Limits
from ...scene.moment import Moment
from ...scene.prepared import Prepared
from ...scene.scene import Scene
from .costs import MissingError, energy, in_flight, require_streams
from .memory import (
    ALLOWED_GROWTH,
    Memory,
    array_bytes,
    bounded,
    give_back_memory,
    peak_resident_bytes,
    reset_peak_resident,
    resident_bytes,
)
from .timing import Sampling, compile_clock, sample_frame

Answers = dict[str, NDArray]

UNSTEADY_NEEDS = "the buffer sizes that one frame needs change from run to run"


class SkippedError(Exception):
    """The method cannot trace this scene; the text is its reason."""


class UnsteadyError(Exception):
    """The timed frames give other answers than the frame that is judged; the text says where."""


class MeasuredPoint:
    """A method on the frames of one scene, planned and compiled, with buffers large enough for every frame.

    facts    facts for the record from the preparation: seconds, counters, passes, frames left out
    changed  the inputs in which a timed frame differs from the one before it; None: whole frames are timed
    """

    def __init__(
        self, make: Callable[[], Method], prepared: Prepared, moments: Mapping[int, Moment], size: tuple[int, int],
        spec: Mapping[str, Any], changed: frozenset[str] | None, answered: Callable[[Method, int, Answers], None],
    ):  # fmt: skip
        """Plan, compile and run every frame until no buffer overflows. ``answered`` receives the answers of each frame.

        The memory of a frame is the maximum that the method has held up to and including that frame. If the samples of
        all frames would exceed the point's budget (``spec["budget_s"]``), some frames are left out. Raises
        :class:`~.errors.CapacityRejected` if the method uses more than ``spec["memory_limit"]`` bytes (:func:`within`).
        """
        self.moments, self.device, self.changed = moments, spec["device"], changed
        self.limits = Limits(**({"memory": spec["memory_limit"]} if spec.get("memory_limit") else {}))
        self._own = own_bytes(prepared, *size)
        self._second: Session | None = None
        self.hashes: dict[int, dict[str, str]] = {}

        def planned(scene: Prepared, method: Method | None = None) -> Session:
            return Session(method or make(), scene, *size, self.device, limits=self.limits)

        def within_limit(scene: Prepared) -> None:
            with bounded(self.limits.memory, own_bytes(scene, *size)):
                planned(scene)

        self._planned = partial(planned, prepared)
        try:
            with bounded(self.limits.memory, self._own):
                self._prepare(make(), prepared.scene, spec, answered)
        except CapacityRejected as error:
            raise CapacityRejected(f"{error}{fewer_that_fit(prepared, within_limit)}") from error

    def _prepare(
        self, method: Method, scene: Scene, spec: Mapping[str, Any], answered: Callable[[Method, int, Answers], None]
    ) -> None:
        moments, limits = self.moments, self.limits
        if reason := method.applies(scene, self.device):
            raise SkippedError(reason)
        held: dict[int, int] = {}
        counted, first, baseline = [], None, resident_bytes()
        tracker = Memory()
        tracker.start()
        start = time.perf_counter()
        with compile_clock() as compiling:
            self.session = session = self._planned(method)
            frames = list(moments)
            while len(held) < len(frames):
                frame = frames[len(held)]
                answers = session.answers(moments[frame])
                first = first or time.perf_counter() - start
                held[frame] = within(limits, tracker, session)
                self.hashes[frame] = hashes(answers)
                answered(method, frame, answers)
                counters = method.counters()
                if spec.get("costs_s"):
                    counters = {**traced_again(method), **counters}
                counted.append({"frame": frame, "counters": counters})
                if len(held) == 1:
                    seconds = time.perf_counter() - start - compiling.seconds
                    frames = affordable_frames(frames, session, seconds, spec["runs"], spec["budget_s"])
        tracker.pause()
        # Memory that is not allocated through Warp, as by numpy or a library, shows only in the growth of the process.
        growth = tracker.growth()
        allowed = growth / 2 if not method.capturable else growth - ALLOWED_GROWTH
        outside = self.device == "cpu" and max(held.values()) < allowed
        if outside:
            # The growth includes compiling and loading. Now that this is done, the memory is counted again.
            del self.session, session, method, answers
            give_back_memory()
            tracker.start()
            self.session = session = self._planned()
            for frame in frames:
                session.answers(moments[frame])
            tracker.pause()
            growth = tracker.growth()
            outside = max(held.values()) < growth / 2
            _require(limits, growth)
        self.memory = dict.fromkeys(held, growth) if outside else held
        besides = " and what the method holds besides" if session.method.held_bytes() else ""
        self.memory_source = PROCESS if outside else f"warp allocations{besides}"
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

    def answers_hash(self) -> str:
        """A hash of the answers to all frames: points with the same one have the same answers."""
        return hashlib.blake2b(repr(self.hashes).encode(), digest_size=16).hexdigest()

    def round(self, sampling: Sampling) -> dict[str, Any]:
        """One round of samples of every frame. Raises :class:`UnsteadyError` if a timed frame gives other answers."""
        started = time.time()
        before, resident = peak_resident_bytes(), resident_bytes()
        reset_peak_resident()
        with bounded(self.limits.memory, self._own):
            frames = [self._sampled(frame, sampling) for frame in self.memory]
        # Kernels are compiled by now: growth is memory that the method allocates inside a frame.
        peak = peak_resident_bytes()
        extra = peak - resident if peak - resident > ALLOWED_GROWTH else 0
        _require(self.limits, extra)
        if extra and self.device == "cpu":
            for one in frames:
                one |= {"memory_bytes": one["memory_bytes"] + extra, "memory_source": PROCESS}
        return {
            "started": started, "spent_s": sum(one.pop("spent_s") for one in frames),
            "method": {"built": self.session.method.built()}, "frames": frames, "peak_rss_bytes": max(before, peak),
        }  # fmt: skip

    def _sampled(self, frame: int, sampling: Sampling) -> dict[str, Any]:
        """Samples of a frame without overflow. If a buffer had to grow, the samples are discarded and taken again."""
        session = self.session
        for _ in range(3):
            self._load(session, self.moments[frame])
            measured, before = sample_frame(session, sampling), session.regrown
            # The counters of the last launch are still on the device.
            if session.overflowed():
                session.run_complete()
                continue
            wrong = differing(session, self.hashes[frame])
            if session.regrown != before:
                continue
            if wrong:
                where = f"frame {frame}: {', '.join(wrong)}"
                raise UnsteadyError(f"the timed frames gave other answers than the frame that was judged ({where})")
            own = measured.known()
            if sampling.costs_s:
                own["costs"] = self._costs(frame, float(np.median(measured.total_ms)), sampling.costs_s)
            memory = {"memory_bytes": self.memory[frame], "memory_source": self.memory_source}
            return {"frame": frame, **own, "regrown": before, **memory}
        raise RuntimeError(f"{session.method.name}: {UNSTEADY_NEEDS}")

    def _load(self, session: Session, moment: Moment) -> None:
        """Have the next launches make a moment, or the part of it that changed."""
        session.load(moment)
        if self.changed is not None:
            session.run()  # the previous frame, whose unchanged results are reused
            session.select(self.changed)
            session.run()  # kernels that only such frames launch are loaded before one is captured

    def _costs(self, frame: int, ms: float, seconds: float) -> dict[str, Any]:
        """What a frame costs besides its time, ``ms``; where that cannot be measured, why not."""
        found: dict[str, Any] = {"missing": {}}
        for what, measured in (
            ("energy", lambda: energy(self.session, ms, seconds)),
            ("in flight", lambda: self._in_flight(frame, ms, seconds)),
        ):
            try:
                costs = measured()
                if self.session.overflowed():  # what did not fit was dropped; the next round has the room
                    raise MissingError(UNSTEADY_NEEDS)
                found |= costs
            except MissingError as error:
                found["missing"][what] = str(error)
        return found

    def _in_flight(self, frame: int, ms: float, seconds: float) -> dict[str, float]:
        """Milliseconds of a frame alone in flight, and of one of two, whose answers must be those that are judged."""
        require_streams(self.session)
        try:
            self._second = self._second or self._planned()
            self._second.answers(self.moments[frame])
        except (CapacityRejected, RuntimeError) as error:
            if not isinstance(error, CapacityRejected) and "allocate" not in str(error):
                raise
            raise MissingError(f"a second frame finds no room ({one_line(error)})") from error
        self._load(self._second, self.moments[frame])
        pair = self.session, self._second
        for session in pair:
            session.poison()
        times = {"alone_ms": in_flight(pair[:1], ms, seconds), "pair_ms": in_flight(pair, ms, seconds)}
        for session in pair:
            if session.overflowed():
                raise MissingError(UNSTEADY_NEEDS)
            if wrong := unlike(session, self.hashes[frame]):
                raise UnsteadyError(
                    f"two frames in flight gave other answers than one (frame {frame}: {', '.join(wrong)})"
                )
        return times


def traced_again(method: Method) -> dict[str, int]:
    """Triangle tests of the last frame's primary and shadow rays, as far as the method counts them when it is asked."""
    counted = getattr(method, "tests_per_pixel", None)
    kinds = ("primary tests", "shadow tests")
    return {} if counted is None else {kind: int(np.sum(own)) for kind, own in zip(kinds, counted(), strict=False)}


PROCESS = "process growth"  # the source of a number of bytes that holds more than the arrays that Warp allocated


def frame_bytes(session: Session) -> int:
    """Bytes of the arrays that the harness gives a method, which do not count as the method's memory."""
    given = session.frame
    return array_bytes(given, given.answers, given.answers.bounces, given.alpha)


def own_bytes(prepared: Prepared, width: int, height: int) -> int:
    """Most bytes that the harness takes for a frame: arrays of pixels and triangles, their copies on the host, hashes."""
    effects = Effects.of(prepared.scene)
    pixel = 128 + 4 * len(effects.shadows)
    return pixel * width * height * (1 + effects.bounces) + 128 * prepared.triangle_count


def within(limits: Limits, tracker: Memory, session: Session, peak: int = 0) -> int:
    """The bytes that a method has held in arrays of Warp, on any device, and that it says it holds besides
    (:meth:`.Method.held_bytes`). ``peak``: as in :meth:`.Memory.growth`.

    Raises :class:`~.errors.CapacityRejected` if these exceed the limit, or if the process has grown by more than the limit
    and :data:`ALLOWED_GROWTH`, as it does when a method or its library allocates memory on the host by other means.
    """
    besides = session.method.held_bytes()
    if besides < 0:
        raise ValueError(f"held_bytes() is {besides}: less than 0")
    held = max(0, tracker.peak() - frame_bytes(session)) + besides
    _require(limits, held, tracker.growth(peak) - ALLOWED_GROWTH)
    return held


def _require(limits: Limits, *held: int) -> None:
    if max(held) > limits.memory:
        raise CapacityRejected(f"needs {max(held):,} bytes; the limit is {limits.memory:,}")


def hashes(answers: Answers) -> dict[str, str]:
    """A hash of the bits of each array."""

    def digest(values: NDArray) -> str:
        return hashlib.sha256(np.ascontiguousarray(values).data).hexdigest()

    with ThreadPoolExecutor(len(answers)) as pool:
        return dict(zip(answers, pool.map(digest, answers.values()), strict=True))


def differing(session: Session, known: Mapping[str, str]) -> list[str]:
    """Run the frame once more, as it is timed, and return the names of the answers whose hashes differ from ``known``.
    The answers are filled with invalid values first, so that a method that relies on an earlier run is detected.
    """
    session.replay_complete()
    wp.synchronize_device(session.device)
    return unlike(session, known)


def unlike(session: Session, known: Mapping[str, str]) -> list[str]:
    """The names of the answers in a session's arrays whose hashes differ from ``known``."""
    found = hashes(session.frame.answers.to_host())
    return [name for name, value in known.items() if found[name] != value]


def affordable_frames(frames: list[int], session: Session, seconds: float, runs: int, budget_s: float) -> list[int]:
    """The frames whose samples fit into the budget: evenly spaced, including the first; at least one. ``seconds``: time
    of the first frame including one-time costs. ``runs``: number of times that each frame will run.
    """
    if len(frames) == 1 or seconds * runs * len(frames) <= budget_s:
        return frames
    start = time.perf_counter()
    session.run()
    wp.synchronize_device(session.device)
    count = int(budget_s / ((time.perf_counter() - start) * runs))
    # The first one ran already.
    return frames[:1] if count < 2 else [frames[i] for i in spread_frames(len(frames), count)]


def spread_frames(frame_count: int, wanted: int) -> list[int]:
    """``wanted`` evenly spaced frames from the first to the last; all if there are fewer; for 1 the middle frame. An
    animation's first frame is often its simplest, such as a cloth before it falls.
    """
    if wanted < 1:
        raise UserError(f"frames {wanted}: at least 1")
    count = min(wanted, frame_count)
    if count == 1:
        return [round((frame_count - 1) / 2)]
    return sorted({round(float(x)) for x in np.linspace(0, frame_count - 1, count)})
