"""Random examples by the thousand: every method against the exact referee, until time or patience ends.

    python tests/tools/fuzz.py --examples 100000 --seed 1 --seconds 1800
    python tests/tools/fuzz.py --defaults --seconds 120 --device cuda:0      every exact method, at its default settings

Prints how many examples ran and what was found. A failure is made smaller and frozen in ``tests/data/regressions``, where
test_regressions.py replays it for ever after. Exit code 1 where something was found.
"""

import argparse
import hashlib
import json
import random
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # as a program it finds the tests' helpers, too

from helpers.judged_hard_cases import exact_methods
from helpers.lattice_examples import LENGTH, METHODS, Calls, Example, decode, true_errors
from shadowbench.harness.frame.devices import start_warp
from shadowbench.harness.runner.machine.lock import MACHINE

REGRESSIONS = Path(__file__).resolve().parents[1] / "data" / "regressions"
MOST_FINDINGS = 20
SHRINK_SECONDS = 20.0


def smaller(example: Example) -> Iterator[Example]:
    """Examples with less in them: fewer lights, fewer triangles, unused vertices gone."""
    if example.calls != Calls():
        yield replace(example, calls=Calls())
        for name, value in asdict(Calls()).items():
            if getattr(example.calls, name) != value:
                yield replace(example, calls=replace(example.calls, **{name: value}))
    lights = len(example.lights)
    for i in range(lights if lights > 1 else 0):
        yield replace(example, lights=np.delete(example.lights, i, axis=0))
    if example.culls():  # the rest must stay closed
        yield example.with_settings("perspective_spherical", cull="off")
        assert example.bodies is not None
        for body in np.unique(example.bodies):
            kept = example.bodies != body
            if (example.bodies[kept] >= 0).any():
                yield replace(example, faces=example.faces[kept], bodies=example.bodies[kept])
    count = len(example.faces)
    part = 0 if example.culls() else count // 2
    while part >= 1:
        for start in range(0, count, part):
            rest = np.delete(example.faces, slice(start, start + part), axis=0)
            if len(rest):
                yield replace(example, faces=rest, bodies=None)
        part //= 2
    used = np.unique(example.faces)
    if len(used) < len(example.points):
        order = np.searchsorted(used, example.faces).astype(np.int32)
        yield replace(example, points=example.points[used], faces=order)


def shrunk(example: Example, fails: Callable[[Example], bool], seconds: float = SHRINK_SECONDS) -> Example:
    """A smaller example that still fails; no smaller step of :func:`smaller` does, or time ran out."""
    end = time.monotonic() + seconds
    again = True
    while again:
        again = False
        for candidate in smaller(example):
            if time.monotonic() > end:
                return example
            if fails(candidate):
                example, again = candidate, True
                break
    return example


def freeze(example: Example, method: str, note: str, folder: Path = REGRESSIONS) -> Path:
    """Write an example as a regression case of one method."""
    facts = {"method": method, "note": note, **example.frozen()}
    facts["settings"] = {method: example.settings[method]}
    text = json.dumps(facts, indent=1)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{method}-{hashlib.sha256(text.encode()).hexdigest()[:10]}.json"
    path.write_text(text + "\n")
    return path


def fuzz(
    examples: int, seed: int, seconds: float, folder: Path, methods: tuple[str, ...], device: str,
    settings: dict[str, dict[str, str]] | None = None,
) -> int:  # fmt: skip
    """Run; the number of findings. ``settings`` of every method: in place of those that an example draws."""
    source = random.Random(seed)
    began, findings, done = time.monotonic(), 0, 0
    for done in range(1, examples + 1):
        example = decode(source.randbytes(LENGTH), effects=True, culled=settings is None)
        if settings is not None:
            example = replace(example, settings=settings)
        MACHINE.give_way()
        for name, wrong in true_errors(example, methods, device).items():
            findings += 1
            least = shrunk(example, lambda one, name=name: bool(true_errors(one, (name,), device)))  # type: ignore[misc]
            path = freeze(least, name, f"seed {seed}, example {done}: {wrong}", folder)
            print(f"example {done}: {name}: {wrong}; frozen as {path}", flush=True)
        elapsed = time.monotonic() - began
        if done % 1000 == 0:
            print(f"{done} examples, {findings} findings, {elapsed:.0f} s", flush=True)
        if elapsed > seconds or findings >= MOST_FINDINGS:
            break
    elapsed = time.monotonic() - began
    print(f"seed {seed}: {done} examples in {elapsed:.0f} s, {findings} findings")
    return findings


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--examples", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=int(time.time()), help="default: by the clock; it is printed")
    parser.add_argument("--seconds", type=float, default=1e9, help="stop after so long")
    parser.add_argument("--folder", type=Path, default=REGRESSIONS, help="where failures are frozen")
    parser.add_argument("--method", action="append", help="repeatable; default: all that have settings to draw")
    parser.add_argument("--defaults", action="store_true", help="every exact method, at its default settings")
    parser.add_argument("--device", default="cpu")
    given = parser.parse_args()
    start_warp()
    settings = dict(exact_methods()) if given.defaults else None
    known = tuple(settings or METHODS)
    methods = tuple(given.method or known)
    if unknown := sorted(set(methods) - set(known)):
        parser.error(f"argument --method: {', '.join(unknown)}; choose from {', '.join(known)}")
    print(f"seed {given.seed}", flush=True)
    with MACHINE.shared():
        found = fuzz(given.examples, given.seed, given.seconds, given.folder, methods, given.device, settings)
    return int(found > 0)


if __name__ == "__main__":
    sys.exit(main())
