"""The time codes that a stage is read at."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..checks import Wanted, broken

MOST_FRAMES = 1 << 20
"""Largest number of frames of an animation, before some are chosen."""

_SLACK = 1e-6
"""Difference of time codes, in frames, that rounding explains."""


@dataclass(frozen=True)
class Times:
    """Time codes, one for each frame; and the frames a second, None where there is one frame."""

    codes: tuple[float, ...]
    rate: float | None


def times(path: Path, stage: Any, samples: set[float], moves: bool, wanted: Wanted, notes: list[str]) -> Times:
    """The time codes of the frames of a stage.

    It starts where the file says, else at the earliest of ``samples``, and ends likewise. There is a frame for each time
    code, or as many a second as the file or ``wanted`` says. One frame, the start, if nothing ``moves``.
    """
    start = _authored(stage, "startTimeCode", min(samples, default=0.0))
    end = _authored(stage, "endTimeCode", max(samples, default=start))
    if not moves:
        wanted.chosen(path, 1)
        return Times((start,), None)
    end = max(start, end)
    second = stage.GetTimeCodesPerSecond()
    second = second if 0.0 < second < math.inf else 24.0
    said = _authored(stage, "framesPerSecond", second)
    rate = wanted.rate or (said if said > 0.0 else second)
    step = second / rate
    count = (end - start) / step if step > 0.0 else math.inf
    if not count < MOST_FRAMES:
        problem = f"its animation from {start:g} to {end:g} at {rate:g} frames a second has too many frames"
        raise broken(path, problem, f"at most {MOST_FRAMES}: give a lower --rate")
    frames = math.floor(count + _SLACK) + 1
    chosen = wanted.chosen(path, frames)
    codes = [start + k * step for k in chosen]
    if len(codes) < frames:
        notes.append(f"{len(codes)} of {frames} frames read")
    outside = [code for code in samples if not start - _SLACK * step <= code <= end + _SLACK * step]
    if outside:
        notes.append(f"samples at {len(outside)} time codes outside {start:g} to {end:g} not read")
    place = (np.array(sorted(samples - set(outside))) - start) / step
    between = int((np.abs(place - place.round()) > _SLACK).sum())
    if between:
        notes.append(f"samples at {between} time codes between frames not read")
    return Times(tuple(codes), second / step / chosen.step if len(codes) > 1 else None)


def _authored(stage: Any, name: str, otherwise: float) -> float:
    """A number of the stage's metadata where the file gives it and it is finite."""
    value = float(stage.GetMetadata(name)) if stage.HasAuthoredMetadata(name) else otherwise
    return value if math.isfinite(value) else otherwise
