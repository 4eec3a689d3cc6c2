"""The present speed of a card: two fixed kernels, one bound by arithmetic and one by memory, timed before and after a
shard."""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass
from statistics import median
from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})

WARM_S = 0.3
"""Seconds of work before the samples, so that a GPU has left its idle clocks."""

SAMPLES = 15


@dataclass(frozen=True)
class Size:
    """Size of the kernels: ``threads`` that each do ``steps`` dependent multiply-adds; ``words`` of 4 bytes that are read
    and written."""

    threads: int
    steps: int
    words: int


GPU = Size(1 << 22, 4096, 1 << 26)
CPU = Size(1 << 12, 1024, 1 << 22)


@dataclass(frozen=True)
class Calibration:
    """Milliseconds of the two kernels, medians."""

    arithmetic_ms: float
    memory_ms: float

    def apart(self, other: Calibration) -> float:
        """The larger of the two relative differences, 0.02 for 2 %."""
        pairs = ((self.arithmetic_ms, other.arithmetic_ms), (self.memory_ms, other.memory_ms))
        return max(max(a, b) / min(a, b) - 1.0 for a, b in pairs)

    def facts(self) -> dict[str, float]:
        """The calibration as the log of a cluster stores it; :meth:`read` reads it."""
        return {"arithmetic_ms": round(self.arithmetic_ms, 5), "memory_ms": round(self.memory_ms, 5)}

    @staticmethod
    def read(facts: dict[str, Any]) -> Calibration:
        """The calibration with these :meth:`facts`."""
        return Calibration(float(facts["arithmetic_ms"]), float(facts["memory_ms"]))


@wp.kernel
def multiply_add(steps: int, result: wp.array(dtype=wp.float32)):  # type: ignore[valid-type]
    """A chain of multiply-adds whose length the compiler does not know."""
    i = wp.tid()
    x = wp.float32(i & 1023)
    for _ in range(steps):
        x = x * wp.float32(0.999) + wp.float32(0.5)
    result[i] = x


@wp.kernel
def copy_plus_one(values: wp.array(dtype=wp.float32), result: wp.array(dtype=wp.float32)):  # type: ignore[valid-type]
    """Every word is read once and written once."""
    i = wp.tid()
    result[i] = values[i] + wp.float32(1.0)


def calibrate(device: str) -> Calibration:
    """Time the two kernels on a device. The caller holds the locks that a measurement there needs."""
    size = GPU if device.startswith("cuda") else CPU
    with wp.ScopedDevice(device):
        few = wp.empty(size.threads, dtype=wp.float32)
        values, result = wp.zeros(size.words, dtype=wp.float32), wp.empty(size.words, dtype=wp.float32)
        first = wp.launch(multiply_add, dim=size.threads, inputs=[size.steps], outputs=[few], record_cmd=True)
        second = wp.launch(copy_plus_one, dim=size.words, inputs=[values], outputs=[result], record_cmd=True)
        first.launch()
        second.launch()
        wp.synchronize_device(device)
        until = time.perf_counter() + WARM_S
        while time.perf_counter() < until:
            first.launch()
            second.launch()
            wp.synchronize_device(device)
        found = Calibration(_median_ms(first, device), _median_ms(second, device))
    return found


def _median_ms(command: Any, device: str) -> float:
    """Median of :data:`SAMPLES` launches, by the device's clock; on a CPU by the host's."""
    if not device.startswith("cuda"):
        times = []
        for _ in range(SAMPLES):
            start = time.perf_counter()
            command.launch()
            times.append((time.perf_counter() - start) * 1e3)
        return median(times)
    events = [wp.Event(device, enable_timing=True) for _ in range(SAMPLES + 1)]
    command.launch()
    wp.record_event(events[0])
    for event in events[1:]:
        command.launch()
        wp.record_event(event)
    wp.synchronize_device(device)
    return median(wp.get_event_elapsed_time(a, b, synchronize=False) for a, b in itertools.pairwise(events))
