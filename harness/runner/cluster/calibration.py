"""The present speed of a card: two fixed kernels, one bound by arithmetic and one by memory, timed before and after a
shard."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from statistics import median

import warp as wp

from ...frame.schedule.passes import Pass
from ...frame.schedule.runner import PassRunner
from ..measuring.timing import Sampling, sample_frame

wp.set_module_options({"enable_backward": False})

WARM_S = 0.3
"""Seconds of work before the samples, so that a GPU has left its idle clocks."""

SAMPLES = Sampling(samples=15, most=15, stage_samples=0)

LIMIT = 0.02
"""Cards whose calibration differs by more than this share are not merged."""


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
    arithmetic = _frame_of(device, partial(wp.launch, multiply_add, size.threads, [size.steps], [few]))
    memory = _frame_of(device, partial(wp.launch, copy_plus_one, size.words, [values], [result]))
    until = time.perf_counter() + WARM_S
    while time.perf_counter() < until:
        arithmetic.run()
        memory.run()
        wp.synchronize_device(device)
    return Calibration(*(median(sample_frame(one, SAMPLES).total_ms) for one in (arithmetic, memory)))


def _frame_of(device: str, launch: Callable[[], None]) -> PassRunner:
    """A frame of one launch, which is timed as any frame is."""
    return PassRunner(device, [Pass("calibrate", "build", (), ("result",), launch)])
