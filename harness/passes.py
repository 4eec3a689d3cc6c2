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
    scratch whether a library in it takes memory while it runs (scans and sorts do): what a captured graph launches under
            a condition cannot hold such a pass, so there it is launched whether or not its neighbours are
    ahead   whether no pass makes what it reads: a captured graph then runs it beside the passes that come before it
    branch  neighbours that have one are run branch by branch beside each other in a captured graph, each branch in order;
            elsewhere, and where a pass has a condition, one after another. 0: none
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
    branch: int = 0
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

    Raises ValueError where one of these reads what a pass of the frame makes, and where passes of two branches that run
    beside each other share what one of them writes.
    """
    made = {name for work in passes for name in work.writes}
    early = [work for work in passes if work.ahead and work.only_if is None]
    for work in early:
        if not made.isdisjoint(work.reads):
            raise ValueError(f"pass {work.name!r} cannot run ahead: it reads what the frame makes")
    place = passes.index(early[0]) if early else len(passes)
    before, after = (
        _side_by_side(passes[:place]),
        _side_by_side([w for w in passes[place:] if w not in early]),
    )
    with wp.ScopedDevice(device), wp.ScopedCapture() as capture:
        if early:
            with wp.ScopedStream(wp.Stream(device)) as branch:
                _launch(early)
                done = branch.record_event()
        _capture(before, device)
        if early:
            wp.wait_event(done)
        _capture(after, device)
    return capture.graph


def _side_by_side(passes: Sequence[Pass]) -> list[list[list[Pass]]]:
    """The passes in the order of their launch: groups, one after another, of branches that run beside each other."""
    groups: list[list[list[Pass]]] = []
    for forked, group in itertools.groupby(passes, key=lambda work: work.branch > 0 and work.only_if is None):
        together = list(group)
        numbers = sorted({work.branch for work in together}) if forked else []
        branches = [[work for work in together if work.branch == number] for number in numbers] or [together]
        groups.append(branches)
        for one, other in itertools.permutations(branches, 2):
            written = {name for work in one for name in work.writes}
            for work in other:
                if not written.isdisjoint((*work.reads, *work.writes)):
                    raise ValueError(
                        f"pass {work.name!r} cannot run beside {one[0].name!r}: they share what is written"
                    )
    return groups


def _capture(groups: Sequence[Sequence[Sequence[Pass]]], device: str) -> None:
    for branches in groups:
        if len(branches) == 1:
            run_passes(branches[0])
            continue
        ends = []
        for branch in branches:
            with wp.ScopedStream(wp.Stream(device)) as stream:  # begins where the frame's own stream is
                _launch(branch)
                ends.append(stream.record_event())
        for end in ends:
            wp.wait_event(end)


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
