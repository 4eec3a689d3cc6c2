"""Which passes of a frame run: those that its outputs need and whose inputs changed. This follows from the resources
that each pass reads and writes (:class:`.passes.Pass`). Resources are names. The inputs of a frame are :data:`INPUTS`
and ``light/i``; its outputs follow from its effects (:func:`wanted_of`).
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
    lit = [i for i, wanted in enumerate(effects.shadows) if wanted]
    wanted = ["hits", *(f"shadowed/{i}" for i in lit)]
    for b in range(1, effects.bounces + 1):
        wanted += [f"rays/{b}", f"hits/{b}", *(f"shadowed/{i}/{b}" for i in lit)]
    return (*wanted, "color") if effects.color else tuple(wanted)


def inputs_of(light_count: int) -> tuple[str, ...]:
    """The names of all inputs that may change between frames."""
    return (*INPUTS, *(f"light/{i}" for i in range(light_count)))


def arranged(passes: Sequence[Pass], added: Sequence[Pass]) -> list[Pass]:
    """``passes`` and those of the harness, ``added``, each as early as possible after the passes whose output it reads."""
    result = list(passes)
    for extra in added:
        after = [k for k, work in enumerate(result, 1) if not set(work.writes).isdisjoint(extra.reads)]
        result.insert(max(after, default=0), extra)
    return result


def live(passes: Sequence[Pass], wanted: Collection[str]) -> list[Pass]:
    """The passes that the ``wanted`` resources depend on, directly or indirectly, in order."""
    needed, kept = set(wanted), list[Pass]()
    for work in reversed(passes):
        if not needed.isdisjoint(work.writes):
            needed.update(work.reads)
            kept.insert(0, work)
    return kept


def stale(passes: Sequence[Pass], changed: Collection[str]) -> list[Pass]:
    """The passes to run again if only the ``changed`` inputs differ from those of the last frame, in order."""
    return [launched for step in steps(passes, changed) for launched in step.launched]


def steps(passes: Sequence[Pass], changed: Collection[str]) -> list[Step]:
    """Every pass, what is launched of it and why, if only the ``changed`` inputs differ from those of the last frame. A
    pass runs if a resource that it reads has changed, or if another pass that writes the same resource runs.
    """
    dirty, why = set(changed), dict[Pass, str]()
    parts = [part for whole in passes for part in whole.apart or (whole,)]
    before = -1
    while len(why) > before:
        before = len(why)
        for work in (part for part in parts if part not in why):
            causes = [f"{name} changed" for name in work.reads if name in dirty]
            causes += [f"{name} is written again" for name in work.writes if name in dirty]
            if causes:
                why[work] = causes[0]
                dirty.update(work.writes)
    return [Step.of(work, why) for work in passes]
