"""Which passes of a frame run: those whose results somebody wants, and of these those whose inputs changed.

A pass states what it reads and writes (:class:`.frame.passes.Pass`); nothing else is known here. Resources are names.
The harness's own inputs are :data:`INPUTS` and ``light/i``; what a frame is for follows from its effects
(:func:`wanted_of`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from ..scene.effects import Effects
from .passes import BUILD_PARTS, Pass

INPUTS = ("points", "triangles", "camera", "reach", "surfaces")


@dataclass(frozen=True)
class Step:
    """A pass in a plan: whether it runs, and why."""

    work: Pass
    runs: bool
    reason: str


def wanted_of(effects: Effects) -> tuple[str, ...]:
    """The resources that a frame is for."""
    bits = tuple(f"visibility/{i}" for i, wanted in enumerate(effects.shadows) if wanted)
    bounces: tuple[str, ...] = ()
    for b in range(1, effects.bounces + 1):
        bits_b = (f"visibility/{i}/{b}" for i, wanted in enumerate(effects.shadows) if wanted)
        bounces += (f"rays/{b}", f"hits/{b}", *bits_b)
    return ("hits", *bits, *bounces, *(("color",) if effects.color else ()))


def inputs_of(light_count: int) -> tuple[str, ...]:
    """Everything that may change between frames."""
    return (*INPUTS, *(f"light/{i}" for i in range(light_count)))


def arranged(passes: Sequence[Pass], added: Sequence[Pass]) -> list[Pass]:
    """``passes`` with the harness's own ``added``: each as soon as all that it reads has been written."""
    result = list(passes)
    for extra in added:
        place = 0
        for k, work in enumerate(result):
            if set(work.writes) & set(extra.reads):
                place = k + 1
        result.insert(place, extra)
    return result


def live(passes: Sequence[Pass], wanted: Collection[str]) -> list[Pass]:
    """The passes that ``wanted`` needs, in order: whatever writes it, and whatever that reads."""
    needed = set(wanted)
    kept: list[Pass] = []
    for work in reversed(passes):
        if needed & set(work.writes):
            needed |= set(work.reads)
            kept.append(work)
    return kept[::-1]


def stale(passes: Sequence[Pass], changed: Collection[str]) -> list[Pass]:
    """The passes to run again where ``changed`` inputs differ from those of the last frame, in order."""
    return [step.work for step in steps(passes, changed) if step.runs]


def steps(passes: Sequence[Pass], changed: Collection[str]) -> list[Step]:
    """Every pass with whether it runs and why, where ``changed`` inputs differ from those of the last frame.

    A pass runs where something that it reads has changed; and where another writer of what it writes runs, since
    the two make it together.
    """
    dirty = dict.fromkeys(changed, "")
    why: dict[int, str] = {}
    settled = False
    while not settled:
        settled = True
        for k, work in enumerate(passes):
            if k in why:
                continue
            cause = next((name for name in work.reads if name in dirty), None)
            if cause is not None:
                why[k] = f"{cause} changed"
            else:
                cause = next((name for name in work.writes if name in dirty), None)
                if cause is None:
                    continue
                why[k] = f"{cause} is made anew"
            dirty.update(dict.fromkeys(work.writes, ""))
            settled = False
    return [
        Step(work, k in why, why.get(k, "nothing that it reads changed")) for k, work in enumerate(passes)
    ]


def builds(passes: Sequence[Pass]) -> list[Pass]:
    """The passes that build structures."""
    return [work for work in passes if work.part in BUILD_PARTS]
