"""Time samples of one frame: whole frames without instrumentation and, separately, single passes.

CPU: a clock around the whole frame; in other samples, a clock around each pass. CUDA: frames follow one another with one
ahead and events between them, so that the queue is not empty and launch latency is not counted. Wall time, from an idle
device to an idle device, is measured in separate samples. A frame is a graph, and the time of a pass is the difference of
two prefix graphs (passes 0..k from a reset state), so that the passes add up to the whole frame. What cannot be captured is
launched by the host, pass by pass: a frame that takes the host longer to submit than the device to run waits for the host.
"""

from __future__ import annotations

import contextlib
import gc
import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from ...frame.schedule.runner import PassRunner

MOST_PREFIXES = 150
"""Passes of a captured frame up to which each is timed: the prefixes of n passes launch n^2 / 2. With 842 passes, of a frame
with 64 lights, they took 100 seconds.
"""

SUBMITTED = 20  # frames launched one after another, at most, of which the host's time to submit one is the median


@dataclass(frozen=True)
class Sampling:
    """Number of samples of one frame in a round.

    samples        minimum number of whole-frame samples (unless the budget is exhausted)
    most           maximum number of whole-frame samples
    deviation      relative standard error of the mean below which sampling stops; None: stop at ``samples``
    stage_samples  number of samples of every pass, separate from the whole frames; none where a captured frame has more
                   than :data:`MOST_PREFIXES` passes
    budget_s       time limit of one frame in a round, seconds, three quarters of it for whole frames; at least one
                   sample of each kind is always taken
    costs_s        seconds of replays whose energy is measured, beyond the budget (:mod:`.costs`); 0: no costs
    """

    samples: int = 5
    most: int = 5
    deviation: float | None = None
    stage_samples: int = 2
    budget_s: float = 10.0
    costs_s: float = 0.0


@dataclass
class FrameSamples:
    """The samples of one frame in one round, milliseconds, rounded to nanoseconds, which is finer than any clock used.

    ``total_ms`` is device time (on a CPU the wall clock), ``wall_ms`` the host's clock; one pair per sample.
    ``stopped_by`` is ``samples``, ``deviation``, ``most`` or ``budget``. ``submitted_ms``: the host's time to submit a frame
    that is no graph on a GPU; None of others. ``spent_s``: seconds of all samples.
    """

    total_ms: list[float] = field(default_factory=list)
    wall_ms: list[float] = field(default_factory=list)
    passes: list[dict[str, Any]] = field(default_factory=list)
    stopped_by: str = ""
    started: float = field(default_factory=time.time)
    spent_s: float = 0.0
    submitted_ms: float | None = None

    def add(self, pairs: list[tuple[float, float]]) -> None:
        self.total_ms += [round(total, 6) for total, _ in pairs]
        self.wall_ms += [round(wall, 6) for _, wall in pairs]

    def known(self) -> dict[str, Any]:
        """The fields as a record has them: without those that the frame has none of."""
        return {name: value for name, value in vars(self).items() if value is not None}


def sample_frame(session: PassRunner, sampling: Sampling) -> FrameSamples:
    """Measure passes (of a session whose frame fits its buffers). Garbage collection is disabled meanwhile."""
    result, began = FrameSamples(), time.perf_counter()
    with _quiet(session):
        take = _whole_frames(session)
        deadline = time.perf_counter() + 0.75 * sampling.budget_s
        # Warm-up: caches, clocks, lazily made graphs and scratch memory.
        cold = take(1)
        if time.perf_counter() > deadline:
            # One frame takes longer than the whole budget; warm-up costs are small compared with it.
            result.add(cold)
            result.stopped_by = "budget"
        while not result.stopped_by:
            batch = min(sampling.samples, sampling.most - len(result.total_ms))
            done = _take_batch(take, batch, deadline, result)
            result.stopped_by = stop_reason(result.total_ms, sampling, done)
        result.submitted_ms = _submitted_ms(session, 0.25 * sampling.budget_s, result.wall_ms[-1])
        result.passes = [{"name": p.name, "part": p.part, "ms": []} for p in session.passes]
        deadline = time.perf_counter() + 0.25 * sampling.budget_s
        prefixes = len(session.passes) if session.replays else 0
        for _ in range(sampling.stage_samples if prefixes <= MOST_PREFIXES else 0):
            for step, ms in zip(result.passes, _stages(session), strict=True):
                step["ms"].append(round(ms, 6))
            if time.perf_counter() > deadline:
                break
    result.spent_s = time.perf_counter() - began
    return result


def stop_reason(total_ms: list[float], sampling: Sampling, in_time: bool) -> str:
    """Why sampling stops now; an empty text if it continues."""
    if not in_time:
        return "budget"
    if len(total_ms) >= sampling.samples:
        if sampling.deviation is None:
            return "samples"
        error = np.std(total_ms) / np.sqrt(len(total_ms)) / np.mean(total_ms) if len(total_ms) > 1 else np.inf
        if error < sampling.deviation:
            return "deviation"
    return "most" if len(total_ms) >= sampling.most else ""


Take = Callable[[int], list[tuple[float, float]]]


def _take_batch(take: Take, count: int, deadline: float, result: FrameSamples) -> bool:
    """Take ``count`` samples; False if the deadline passed before all were taken."""
    # Short frames together, so that the device's queue stays full; long ones one by one, to stay within the budget.
    pairs = [] if result.total_ms else take(1)
    lasts = max([wall for _, wall in pairs] + result.wall_ms, default=0.0) / 1e3
    while len(pairs) < count and time.perf_counter() + lasts < deadline:
        room = max(1, int((deadline - time.perf_counter()) / max(lasts, 1e-6)))
        pairs = pairs + take(min(count - len(pairs), room))
    result.add(pairs)
    return len(pairs) >= count


def _whole_frames(session: PassRunner) -> Take:
    """A function that takes n samples of whole frames: pairs of device time and wall time in milliseconds."""
    device = wp.get_device(session.device)
    if not device.is_cuda:
        return lambda count: [(ms, ms) for ms in (_clock(session.run) for _ in range(count))]
    launch = partial(wp.capture_launch, session.graph()) if session.replays else session.run
    return partial(_in_a_row, device, launch)


def _clock(launch: Callable[[], None]) -> float:
    start = time.perf_counter()
    launch()
    return (time.perf_counter() - start) * 1e3


def _between_events(device: Any, launches: Sequence[Callable[[], None]], ahead: Callable[[], None]) -> list[float]:
    """Milliseconds of the device for each of some launches in a row; ``ahead``: what is done before the first."""
    with wp.ScopedDevice(device):
        events = [wp.Event(device, enable_timing=True) for _ in range(len(launches) + 1)]
        ahead()
        wp.record_event(events[0])
        for launch, event in zip(launches, events[1:], strict=True):
            launch()
            wp.record_event(event)
        wp.synchronize_device(device)
        return [wp.get_event_elapsed_time(a, b, synchronize=False) for a, b in itertools.pairwise(events)]


def _in_a_row(device: Any, launch: Callable[[], None], count: int) -> list[tuple[float, float]]:
    # One frame ahead keeps the queue full, so that no idle time lies between the events.
    total = _between_events(device, [launch] * count, launch)

    def alone() -> None:
        launch()
        wp.synchronize_device(device)

    with wp.ScopedDevice(device):
        return [(ms, _clock(alone)) for ms in total]


def _submitted_ms(session: PassRunner, budget_s: float, lasts_ms: float) -> float | None:
    """The host's time to submit a frame that it launches pass by pass on a GPU; None of other frames. ``lasts_ms``: a frame,
    with what the device does after it is submitted.
    """
    device = wp.get_device(session.device)
    if not device.is_cuda or session.replays:
        return None
    count = max(1, min(SUBMITTED, int(1e3 * budget_s / max(lasts_ms, 1e-3))))
    taken = [_clock(session.run) for _ in range(count)]
    wp.synchronize_device(device)
    return round(float(np.median(taken)), 6)


def _stages(session: PassRunner) -> list[float]:
    device, launches = wp.get_device(session.device), [step.run for step in session.passes]
    if not device.is_cuda:
        with wp.ScopedDevice(device):
            return [_clock(launch) for launch in launches]
    if not session.replays:
        return _between_events(device, launches, session.run)
    graphs = [partial(wp.capture_launch, session.graph(upto=k)) for k in range(1, len(launches) + 1)]

    def upload() -> None:
        """Each graph once ahead: its first launch uploads it, which is not the time of its last pass."""
        for graph in graphs:
            graph()

    return [float(ms) for ms in np.diff(_between_events(device, graphs, upload), prepend=0.0)]


@contextlib.contextmanager
def _quiet(session: PassRunner) -> Iterator[None]:
    """Disable garbage collection during samples; wait for the device before and after."""
    enabled = gc.isenabled()
    gc.disable()
    wp.synchronize_device(session.device)
    try:
        yield
    finally:
        wp.synchronize_device(session.device)
        if enabled:
            gc.enable()


@dataclass
class Compiling:
    """Seconds that Warp has spent on compiling and loading kernel modules."""

    seconds: float = 0.0


@contextlib.contextmanager
def compile_clock() -> Iterator[Compiling]:
    """Count inside. Warp loads a module at its first launch; this wraps that one function, and puts it back."""
    kind, spent, depth = type(wp.get_module(__name__)), Compiling(), 0
    load = kind.load

    def timed(module: Any, *args: Any, **kwargs: Any) -> Any:
        nonlocal depth
        start = time.perf_counter()
        depth += 1
        try:
            return load(module, *args, **kwargs)
        finally:
            depth -= 1
            if not depth:
                spent.seconds += time.perf_counter() - start

    kind.load = timed  # type: ignore[method-assign]
    try:
        yield spent
    finally:
        kind.load = load  # type: ignore[method-assign]
