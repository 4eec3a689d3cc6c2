"""A frame is a list of passes. Stages, graph capture, plans and launch lists all follow from that list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

PARTS = ("build", "trace", "light build", "shadow")


@dataclass(frozen=True, eq=False)
class Pass:
    """One step of a frame.

    name    what a person reads: "light 0: sort pairs"
    part    the column it is counted in, one of :data:`PARTS`
    reads   what must be there: "points" "triangles" "camera" "light/0" "hits", or a method's own resources
    writes  what it makes: "hits" "visibility/0" "bvh" "light grid/0" ...
    launch  launches only: no allocation, no read-back, no host synchronisation (unless the method says it is
            not capturable)
    effect  the effect that asks for it, or None where every frame needs it
    """

    name: str
    part: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    launch: Callable[[], None]
    effect: str | None = None

    def __post_init__(self) -> None:
        if self.part not in PARTS:
            raise ValueError(f"pass {self.name!r}: part {self.part!r} is not one of {PARTS}")


def run_passes(passes: list[Pass]) -> None:
    """Launch every pass in order."""
    for step in passes:
        step.launch()
