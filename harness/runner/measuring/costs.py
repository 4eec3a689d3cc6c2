"""What a frame costs besides its time: energy, and the time it takes while another frame is in flight.

Both come from replays apart from the timed ones. Energy is what the counter of the card says over many of them, less what
the idle card used just before. Two frames in flight are the graphs of two sessions, each with its own buffers, replayed
on two streams. Frames that are not captured have their launches issued one by one, which counts in their energy.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp

from ...errors import install
from ...frame.schedule.runner import PassRunner
from ..machine.nvml import card_of

PACKAGE = "nvidia-ml-py"  # NVIDIA's own binding of its management library
BATCH_MS = 20.0  # of replays between two readings of the counter, which moves every 20 to 100 ms
PATIENCE = 5.0  # how many times the asked seconds a measurement may take, where the counter moves seldom
IN_FLIGHT_SHARE = 0.25  # of the asked seconds, alone and together each: a clock needs less than a counter


class MissingError(Exception):
    """A cost cannot be measured here; the text says why."""


@dataclass(frozen=True)
class Used:
    """Energy and time between two steps of a counter, and how often the work was done in between."""

    joules: float
    seconds: float
    calls: int

    @property
    def watts(self) -> float:
        return self.joules / self.seconds


def used(
    counter: Callable[[], float],
    work: Callable[[], None],
    seconds: float,
    clock: Callable[[], float] = time.perf_counter,
) -> Used:
    """Repeat work for so many seconds, from a step of the counter (joules) to another; MissingError if it rests."""
    last, calls, ends = counter(), 0, clock() + PATIENCE * seconds
    begin: Used | None = None
    while clock() < ends:
        work()
        calls += 1
        now = Used(counter(), clock(), calls)
        if now.joules == last:
            continue
        last, begin = now.joules, begin or now
        if now.seconds - begin.seconds >= seconds:
            return Used(now.joules - begin.joules, now.seconds - begin.seconds, calls - begin.calls)
    raise MissingError(f"the energy counter of the card did not move twice in {PATIENCE * seconds:g} s")


def above_idle(busy: Used, idle: Used, frames: int) -> float:
    """Joules of a frame, ``frames`` of which one call of the busy work makes, above those of the idle card."""
    joules = (busy.joules - idle.watts * busy.seconds) / (busy.calls * frames)
    if joules < 0:
        raise MissingError("the card used no more energy than while it was idle")
    return joules


def energy_counter(device: Any) -> Callable[[], float]:
    """Reads the joules that a card has used since its driver was loaded."""
    if not device.is_cuda:
        raise MissingError("it runs on a CPU: energy is counted on NVIDIA GPUs only")
    try:
        import pynvml
    except ImportError:
        raise MissingError(f"no package {PACKAGE}; {install(PACKAGE)}") from None
    try:
        card = card_of(device.uuid)
        pynvml.nvmlDeviceGetTotalEnergyConsumption(card)
    except pynvml.NVMLError as error:
        raise MissingError(f"NVML does not count the energy of this card ({error})") from error
    return lambda: pynvml.nvmlDeviceGetTotalEnergyConsumption(card) / 1e3


def energy(session: PassRunner, ms: float, seconds: float) -> dict[str, float]:
    """Joules of a frame above idle and the idle power, as a record has them. ``ms``: about how long a frame takes."""
    device = wp.get_device(session.device)
    counter = energy_counter(device)
    wp.synchronize_device(device)
    idle = used(counter, lambda: time.sleep(BATCH_MS / 4e3), seconds / 2)
    frames = max(1, round(BATCH_MS / max(ms, 1e-3)))
    queued: list[Any] = []

    def batch() -> None:
        # The batch before it is awaited only now, so that the card has work while the counter is read.
        with wp.ScopedDevice(device):
            for _ in range(frames):
                session.replay()
            queued.append(wp.record_event())
        if len(queued) > 1:
            wp.synchronize_event(queued.pop(0))

    busy = used(counter, batch, seconds)
    wp.synchronize_device(device)
    return {"energy_j": above_idle(busy, idle, frames), "idle_w": idle.watts}


def require_streams(session: PassRunner) -> None:
    """Raise :class:`MissingError` where two frames cannot be in flight."""
    if not session.replays:
        captured = wp.get_device(session.device).is_cuda
        raise MissingError("it is not captured in a graph" if captured else "it runs on a CPU, which has no streams")


def in_flight(sessions: Sequence[PassRunner], ms: float, seconds: float) -> float:
    """Milliseconds a frame with one frame of each session in flight: the graph of each replayed on a stream of its own."""
    device = wp.get_device(sessions[0].device)
    count = max(4, round(1e3 * seconds * IN_FLIGHT_SHARE / (max(ms, 1e-3) * len(sessions))))
    with wp.ScopedDevice(device):
        lanes = [(session.graph(), wp.Stream(device)) for session in sessions]
        begin, end = (wp.Event(device, enable_timing=True) for _ in range(2))
        wp.record_event(begin)
        for _, stream in lanes:
            stream.wait_event(begin)
        for _ in range(count):
            for graph, stream in lanes:
                wp.capture_launch(graph, stream=stream)
        for _, stream in lanes:
            wp.wait_stream(stream)
        wp.record_event(end)
        wp.synchronize_device(device)
        return wp.get_event_elapsed_time(begin, end, synchronize=False) / (count * len(lanes))
