"""The present speed of a card: two fixed kernels, one bound by arithmetic and one by memory, timed before and after a
shard.
"""

from __future__ import annotations

import time
from dataclasses import astuple, dataclass
from functools import partial
from statistics import median

import warp as wp

from ...frame.schedule.passes import Pass
from ...frame.schedule.runner import PassRunner
from ..measuring.timing import Sampling, sample_frame

wp.set_module_options({"enable_backward": False})

WARM_S = 0.3  # seconds of work before the samples, so that a GPU has left its idle clocks

SAMPLES = Sampling(samples=15, most=15, stage_samples=0)

LIMIT = 0.02  # cards whose calibration differs by more than this share are not merged

GPU, CPU = (1 << 22, 4096, 1 << 26), (1 << 12, 1024, 1 << 22)
"""Sizes of the kernels: threads, dependent multiply-adds of each; words of 4 bytes that are read and written."""


@dataclass(frozen=True)
class Calibration:
    """Milliseconds of the two kernels, medians."""

    arithmetic_ms: float
    memory_ms: float

    def apart(self, other: Calibration) -> float:
        """The larger of the two relative differences, 0.02 for 2 %."""
        return max(max(a, b) / min(a, b) - 1.0 for a, b in zip(astuple(self), astuple(other), strict=True))


@wp.kernel
def multiply_add(steps: int, result: wp.array[wp.float32]):
    """A chain of multiply-adds whose length the compiler does not know."""
    i = wp.tid()
    x = wp.float32(i & 1023)
    for _ in range(steps):
        x = x * wp.float32(0.999) + wp.float32(0.5)
    result[i] = x


@wp.kernel
def copy_plus_one(values: wp.array[wp.float32], result: wp.array[wp.float32]):
    """Every word is read once and written once."""
    i = wp.tid()
    result[i] = values[i] + wp.float32(1.0)


def calibrate(device: str) -> Calibration:
    """Time the two kernels on a device, as frames of one launch. The caller holds the locks that a measurement needs."""
    threads, steps, words = GPU if device.startswith("cuda") else CPU
    few, result = (wp.empty(count, dtype=wp.float32, device=device) for count in (threads, words))
    values = wp.zeros(words, dtype=wp.float32, device=device)
    launches = (
        partial(wp.launch, multiply_add, threads, [steps], [few]),
        partial(wp.launch, copy_plus_one, words, [values], [result]),
    )
    frames = [PassRunner(device, [Pass("calibrate", "build", (), ("result",), launch)]) for launch in launches]
    until = time.perf_counter() + WARM_S
    while time.perf_counter() < until:
        for frame in frames:
            frame.run()
        wp.synchronize_device(device)
    return Calibration(*(median(sample_frame(frame, SAMPLES).total_ms) for frame in frames))
