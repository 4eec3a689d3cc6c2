"""Damage to files of one format, and what comes of reading each: a mesh or one line, in time and without growth."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import numpy as np
import psutil
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers import apart
from shadowbench.harness.scene.readers.checks import Loaded
from shadowbench.harness.scene.scene import Scene
from shadowbench.harness.scene.shape import shape_of
from shadowbench.harness.scene.views import view

from .fuzzed_bytes import damaged
from .fuzzed_inputs import READ, refusal

WARM = 200
"""Cases after which the memory of the reading process is that of its libraries."""


@dataclass
class Found:
    """What came of the files of a format.

    outcomes  how many were read, refused, or stopped their reader
    growth    bytes that the reading process took after the first cases; 0 where it was started anew
    longest   seconds for one file
    """

    outcomes: Counter[str] = field(default_factory=Counter)
    growth: int = 0
    longest: float = 0.0


def fuzz(
    ending: str,
    seeds: list[bytes],
    folder: Path,
    cases: int,
    cuts: int,
    seed: int = 0,
    read: Callable[[Path], Loaded] = apart.load,
) -> Found:
    """Read damaged files: ``cases`` with changed bytes, words and values, and ``cuts`` ended early.

    Raises whatever is no :class:`UserError`, and AssertionError for a line or a mesh that is none.
    """
    found = Found()
    path = folder / f"case{ending}"
    began, reader = 0, -1
    for number, blob in enumerate([*seeds, *_damaged(seeds, cases, cuts, Random(f"{seed} {ending}"))]):
        path.write_bytes(blob)
        start = time.monotonic()
        found.outcomes[outcome(path, read)] += 1
        found.longest = max(found.longest, time.monotonic() - start)
        process, taken = _reader()
        if number <= WARM or process != reader:
            began, reader = taken, process
        found.growth = max(found.growth, taken - began)
    return found


def _damaged(seeds: list[bytes], cases: int, cuts: int, rng: Random) -> Iterator[bytes]:
    for _ in range(cases):
        yield damaged(rng, rng.choice(seeds), seeds)
    for blob in seeds:
        step = max(1, len(blob) * len(seeds) // cuts)
        yield from (blob[:length] for length in range(0, len(blob), step))


def outcome(path: Path, read: Callable[[Path], Loaded] = apart.load) -> str:
    """What comes of reading a file; a mesh must be valid, and a camera must find it."""
    try:
        loaded = read(path)
    except UserError as error:
        if path.name not in str(error) or "pxrInternal" in str(error):
            raise AssertionError(str(error)) from error
        return refusal(error)
    assert len(loaded.faces)
    for frame in loaded.frames:
        assert frame.shape == loaded.frames[0].shape
        assert 0 <= loaded.faces.min() <= loaded.faces.max() < len(frame)
    camera, lights = view(shape_of(loaded.geometry(), loaded.up))
    moment = prepare(Scene("fuzz", "Fuzz", loaded.geometry, camera, lights)).moment(0, 2, 2)
    assert np.isfinite(moment.eye).all()
    assert np.isfinite(moment.lights).all()
    return READ


def _reader() -> tuple[int, int]:
    """The reading process and the bytes that it holds."""
    process = apart._HELPER._process
    if process is None or process.poll() is not None:
        return -1, 0
    return process.pid, psutil.Process(process.pid).memory_info().rss
