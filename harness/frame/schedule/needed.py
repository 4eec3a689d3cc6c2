"""Which passes of a frame run: those that its outputs need and whose inputs changed.

This follows from the resources that each pass reads and writes (:class:`.passes.Pass`). Resources are names. The
inputs of a frame are :data:`INPUTS` and ``light/i``; its outputs follow from its effects (:func:`wanted_of`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from ...scene.effects import Effects
from .passes import Pass

INPUTS = ("points", "triangles", "camera", "max_coordinate", "surfaces")


@dataclass(frozen=True)
class Step:
    """A pass, what is launched of it (itself, some passes of ``apart``, or nothing), and why."""

    work: Pass
    launched: tuple[Pass, ...]
    reason: str

    @property
    def runs(self) -> bool:
        return bool(self.launched)

    @classmethod
    def of(cls, work: Pass, why: Mapping[Pass, str]) -> Step:
        """``why``: the reason of each pass that has to run."""
        parts = work.apart or (work,)
        again = tuple(part for part in parts if part in why)
        if not again:
            return cls(work, (), "nothing that it reads changed")
        if len(again) == len(parts):
            return cls(work, (work,), why[again[0]])
        return cls(work, again, f"{why[again[-1]]} ({', '.join(part.name for part in again)} alone)")


def wanted_of(effects: Effects) -> tuple[str, ...]:
    """The resources that are the outputs of a frame."""
    bits = tuple(f"shadowed/{i}" for i, wanted in enumerate(effects.shadows) if wanted)
    bounces: tuple[str, ...] = ()
    for b in range(1, effects.bounces + 1):
        bits_b = (f"shadowed/{i}/{b}" for i, wanted in enumerate(effects.shadows) if wanted)
        bounces += (f"rays/{b}", f"hits/{b}", *bits_b)
    return ("hits", *bits, *bounces, *(("color",) if effects.color else ()))


def inputs_of(light_count: int) -> tuple[str, ...]:
    """The names of all inputs that may change between frames."""
    return (*INPUTS, *(f"light/{i}" for i in range(light_count)))


def arranged(passes: Sequence[Pass], added: Sequence[Pass]) -> list[Pass]:
    """``passes`` and those of the harness, ``added``, each as early as possible after the passes whose output it reads."""
    result = list(passes)
    for extra in added:
        place = 0
        for k, work in enumerate(result):
            if set(work.writes) & set(extra.reads):
                place = k + 1
        result.insert(place, extra)
    return result


def live(passes: Sequence[Pass], wanted: Collection[str]) -> list[Pass]:
    """The passes that the ``wanted`` resources depend on, directly or indirectly, in order."""
    needed = set(wanted)
    kept: list[Pass] = []
    for work in reversed(passes):
        if needed & set(work.writes):
            needed |= set(work.reads)
            kept.append(work)
    return kept[::-1]


def stale(passes: Sequence[Pass], changed: Collection[str]) -> list[Pass]:
    """The passes to run again if only the ``changed`` inputs differ from those of the last frame, in order."""
    return [launched for step in steps(passes, changed) for launched in step.launched]


def steps(passes: Sequence[Pass], changed: Collection[str]) -> list[Step]:
    """Every pass, what is launched of it and why, if only the ``changed`` inputs differ from those of the last frame.

    A pass runs if a resource that it reads has changed, or if another pass that writes the same resource runs.
    """
    dirty = dict.fromkeys(changed, "")
    why: dict[Pass, str] = {}
    found = True
    while found:
        found = False
        for work in (part for whole in passes for part in whole.apart or (whole,)):
            if work in why:
                continue
            cause = next((name for name in work.reads if name in dirty), None)
            if cause is not None:
                why[work] = f"{cause} changed"
            else:
                cause = next((name for name in work.writes if name in dirty), None)
                if cause is None:
                    continue
                why[work] = f"{cause} is written again"
            dirty.update(dict.fromkeys(work.writes, ""))
            found = True
    return [Step.of(work, why) for work in passes]
