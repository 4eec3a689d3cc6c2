"""A frame is a list of passes. Stages, graph capture, plans and launch lists all follow from that list."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp

PARTS = ("build", "trace", "light build", "shadow")
BUILD_PARTS = ("build", "light build")


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
    scratch whether a library in it takes memory while it runs (scans and sorts do): a branch of a captured graph cannot
            hold such a pass, so there it is launched whether or not its neighbours are
    ahead   whether no pass makes what it reads: a captured graph then runs it beside the passes that come before it
    only_if int32 [1] on the device: launched only where it is not 0 (set by the harness, decided inside the frame)
    """

    name: str
    part: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    launch: Callable[[], None]
    effect: str | None = None
    scratch: bool = False
    ahead: bool = False
    only_if: wp.array | None = None

    def __post_init__(self) -> None:
        if self.part not in PARTS:
            raise ValueError(f"pass {self.name!r}: part {self.part!r} is not one of {PARTS}")

    def run(self) -> None:
        """Launch it, if its condition says so."""
        run_passes([self])


def run_passes(passes: Sequence[Pass]) -> None:
    """Launch every pass in order. Neighbours under one condition are one branch, also of a captured graph."""
    for only_if, group in itertools.groupby(passes, key=_condition):
        together = list(group)
        if only_if is None:
            _launch(together)
        else:
            wp.capture_if(only_if, lambda together=together: _launch(together))


def capture_passes(passes: Sequence[Pass], device: str) -> Any:
    """The passes as a graph (CUDA). Those that may run ahead are a branch of their own, joined where they stand.

    Raises ValueError where one of these reads what a pass of the frame makes.
    """
    made = {name for work in passes for name in work.writes}
    early = [work for work in passes if work.ahead and work.only_if is None]
    for work in early:
        if not made.isdisjoint(work.reads):
            raise ValueError(f"pass {work.name!r} cannot run ahead: it reads what the frame makes")
    place = passes.index(early[0]) if early else len(passes)
    with wp.ScopedDevice(device), wp.ScopedCapture() as capture:
        if early:
            with wp.ScopedStream(wp.Stream(device)) as branch:
                _launch(early)
                done = branch.record_event()
        run_passes(passes[:place])
        if early:
            wp.wait_event(done)
        run_passes([work for work in passes[place:] if work not in early])
    return capture.graph


def _condition(work: Pass) -> wp.array | None:
    """The condition of a pass, None where it cannot stand in a branch of the graph that is being captured."""
    if work.only_if is not None and work.scratch:
        device = work.only_if.device
        if device.is_cuda and device.stream.is_capturing:
            return None
    return work.only_if


def _launch(passes: Sequence[Pass]) -> None:
    for work in passes:
        work.launch()
