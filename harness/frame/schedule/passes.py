"""A frame is a list of passes. Timed stages, graph capture and the schedule follow from that list."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import warp as wp

from . import graphs

PARTS = ("build", "trace", "light build", "shadow")
BUILD_PARTS = ("build", "light build")


@dataclass(frozen=True, eq=False)
class Pass:
    """One step of a frame.

    name    shown to the user: "light 0: sort pairs"
    part    the column of the time table that it belongs to, one of :data:`PARTS`
    reads   resources that it reads: "points" "triangles" "camera" "light/0" "hits", or the method's own
    writes  resources that it writes: "hits" "shadowed/0" "bvh" "light grid/0" ...
    launch  launches kernels only: no allocation, no read-back, no synchronisation with the host (unless the method is
            declared not capturable)
    effect  the effect that needs it, or None if every frame does
    scratch whether a library call in it allocates memory while it runs (scans and sorts do). A conditional branch of a
            captured graph cannot contain such a pass; there it is launched unconditionally
    ahead   whether it reads no output of another pass of the frame; in a captured graph it then runs concurrently with
            all passes that do not depend on it
    aside   whether it is needed late only: in a captured graph it is launched as soon as what it reads is written, and runs
            concurrently with the passes up to its place, or to one that depends on it
    idle    of a pass ``aside``: whether concurrent passes have priority over it in a captured graph, so that it fills what
            they leave idle. Passes ``ahead`` run at that priority, too
    branch  branch numbers, one per level of nesting. In a captured graph, neighbouring passes with different numbers run
            concurrently, passes with the same number in order; with a condition, those of the same condition. Without
            graph all passes run in order
    phase   branches of passes with the same number run concurrently, and begin when those of the phase before have ended.
            What a frame leaves out does not change this
    loops   whether the launch captures a loop of its own. In a captured graph nothing runs beside such a pass, because a
            loop cannot be captured while another stream is open; so it is in no branch
    adds    whether it only adds to what it writes (atomics, bits that stay set), so that another pass may do so
            concurrently
    only_if int32 [1] on the device: the pass is launched only if it is not 0 (set by the harness inside the frame)
    reached int32 [1] on the device, of a pass that marks the receivers of a light: not 0 if the light has any. The harness
            makes it the condition of the light's passes
    """

    name: str
    part: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    launch: Callable[[], None]
    effect: str | None = None
    scratch: bool = False
    ahead: bool = False
    aside: bool = False
    idle: bool = False
    branch: tuple[int, ...] = ()
    phase: int = 0
    loops: bool = False
    adds: bool = False
    only_if: wp.array | None = None
    reached: wp.array | None = None

    def __post_init__(self) -> None:
        if self.part not in PARTS:
            raise ValueError(f"pass {self.name!r}: part {self.part!r} is not one of {PARTS}")
        if self.loops and (self.branch or self.ahead or self.aside):
            raise ValueError(f"pass {self.name!r}: nothing can run beside a loop")

    def run(self) -> None:
        """Launch it, if its condition holds."""
        run_passes([self])


class PassRunner:
    """Launches passes on a device, in order or as a captured graph.

    passes      the passes that :meth:`run`, :meth:`graph` and :meth:`replay` launch; may be replaced
    capturable  whether they may be captured as a graph
    """

    def __init__(self, device: str, passes: list[Pass], capturable: bool = True):
        self.device = device
        self.passes = passes
        self.capturable = capturable
        self._graphs: dict[tuple[Pass, ...], Any] = {}

    @property
    def replays(self) -> bool:
        """Whether the passes are timed as one graph: on CUDA, if they can be captured."""
        return self.capturable and wp.get_device(self.device).is_cuda

    def run(self) -> None:
        """Launch every pass once, eagerly."""
        with wp.ScopedDevice(self.device):
            run_passes(self.passes)

    def graph(self, upto: int | None = None) -> Any:
        """The captured graph of the first ``upto`` passes (all by default). Captured once."""
        chosen = tuple(self.passes[:upto])
        if chosen not in self._graphs:
            self._graphs[chosen] = capture_passes(chosen, self.device)
        return self._graphs[chosen]

    def replay(self) -> None:
        """Launch the passes as they are timed: as a graph if possible, else one by one."""
        if self.replays:
            wp.capture_launch(self.graph())
        else:
            self.run()


def run_passes(passes: Sequence[Pass]) -> None:
    """Launch every pass in order. Neighbouring passes with the same condition form one conditional branch."""
    for only_if, group in itertools.groupby(passes, key=_condition):
        together = list(group)
        if only_if is None:
            _launch(together)
        else:
            wp.capture_if(only_if, lambda together=together: _launch(together))


def capture_passes(passes: Sequence[Pass], device: str) -> Any:
    """The passes as a graph (CUDA). The ``ahead`` passes of each branch run beside the others, until a pass that depends on
    one of them or the first condition: a conditional branch cannot be captured while another is open.

    Raises ValueError if an ``ahead`` pass reads the output of another pass of the frame or writes what one before it uses,
    and if concurrent passes use a resource that one of them writes.
    """
    passes = _moved_forward(passes)
    made = {name for work in passes for name in work.writes}
    early = [work for work in passes if work.ahead and work.only_if is None]
    for work in early:
        if not made.isdisjoint(work.reads):
            raise ValueError(
                f"pass {work.name!r} cannot run ahead: it reads what another pass of the frame writes"
            )
    rest = [work for work in passes if work not in early]
    refuse_shared(passes)
    refuse_shared(rest)
    _refuse_early(passes, early)
    branches: dict[tuple[int, ...], list[Pass]] = {}
    for work in early:
        branches.setdefault(work.branch, []).append(work)
    with graphs.capture(device) as captured:
        running: list[tuple[Pass, Any]] = []
        for branch in branches.values():
            with wp.ScopedStream(graphs.stream(device, idle=True)) as stream:
                for work in branch:
                    work.launch()
                    running.append((work, stream.record_event()))
        _capture(rest, device, running)
        _join(running)
    return captured.graph


def _refuse_early(passes: Sequence[Pass], early: Sequence[Pass]) -> None:
    """ValueError if an ``ahead`` pass writes what a pass before it uses, or one of another branch: it runs beside them."""
    for k, work in enumerate(passes):
        if work not in early:
            continue
        others = [other for other in early if other.branch != work.branch]
        for beside in (*(other for other in passes[:k] if other not in early), *others):
            shared = set(work.writes).intersection((*beside.reads, *beside.writes))
            if shared and not (work.adds and beside.adds):
                raise ValueError(
                    f"pass {work.name!r} cannot run ahead: {beside.name!r}, beside which it runs, uses {min(shared)}"
                )


def _moved_forward(passes: Sequence[Pass]) -> list[Pass]:
    """The passes, those ``aside`` after the last one that they depend on."""
    moved: list[Pass] = []
    for work in passes:
        place = len(moved)
        while work.aside and place > 0 and not _depends(work, moved[place - 1]):
            place -= 1
        moved.insert(place, work)
    return moved


def _forks(passes: Sequence[Pass], depth: int) -> Iterator[tuple[bool, list[list[Pass]]]]:
    """Groups of passes that run in order: whether the group forks at ``depth``, and its branches (one if it does not)."""

    def place(work: Pass) -> tuple[int, bool]:
        return work.phase, len(work.branch) > depth and work.only_if is None

    for (_, forked), group in itertools.groupby(passes, key=place):
        branches: dict[int, list[Pass]] = {}
        for work in group:
            branches.setdefault(work.branch[depth] if forked else 0, []).append(work)
        yield forked, list(branches.values())


def refuse_shared(passes: Sequence[Pass], depth: int = 0) -> None:
    """ValueError if concurrent passes use a resource that one of them writes."""
    for forked, branches in _forks(passes, depth):
        for one, other in itertools.permutations(branches, 2):
            for work, beside in itertools.product(one, other):
                shared = {*work.reads, *work.writes}.intersection(beside.writes)
                if shared and not (work.adds and beside.adds):
                    raise ValueError(
                        f"pass {work.name!r} cannot run concurrently with {beside.name!r}, which writes {min(shared)}"
                    )
        if forked:
            for branch in branches:
                refuse_shared(branch, depth + 1)
            continue
        for only_if, together in _conditional(branches[0]):
            if only_if is not None:
                refuse_shared(together, depth)


def _capture(
    passes: Sequence[Pass],
    device: str,
    running: list[tuple[Pass, Any]],
    depth: int = 0,
    awaited: Collection[Pass] = (),
) -> None:
    """Capture passes on the current stream. ``running``: passes ahead and aside, and the events of their ends; ``awaited``:
    those that the stream has waited for. To wait again would be another edge of the graph."""
    awaited = set(awaited)
    for forked, branches in _forks(passes, depth):
        if not forked:
            for only_if, together in _conditional(branches[0]):
                if only_if is None:
                    _launch_beside(together, device, running, awaited)
                    continue
                _close(running)
                wp.capture_if(only_if, lambda together=together: _capture_joined(together, device, depth))
            continue
        if len(branches) == 1:
            _capture(branches[0], device, running, depth + 1, awaited)
            continue
        ends = []
        for branch in branches:
            # The branch begins at this place of the frame.
            with wp.ScopedStream(graphs.stream(device)) as stream:
                _capture(branch, device, running, depth + 1, awaited)
                ends.append(stream.record_event())
        for end in ends:
            wp.wait_event(end)


def _capture_joined(passes: Sequence[Pass], device: str, depth: int) -> None:
    """Capture passes, and wait for those aside."""
    running: list[tuple[Pass, Any]] = []
    _capture(passes, device, running, depth)
    _join(running)


def _launch_beside(
    passes: Sequence[Pass], device: str, running: list[tuple[Pass, Any]], awaited: set[Pass]
) -> None:
    """Launch passes; each waits for those that run beside it and that it depends on, unless the stream has ``awaited`` them.
    Those aside get streams of their own."""
    for work in passes:
        if work.loops:
            _close(running)
        needed = [entry for entry in running if entry[0] not in awaited and _depends(work, entry[0])]
        if not work.aside:
            _join(needed)
            awaited.update(before for before, _ in needed)
            work.launch()
            continue
        # It begins at this place of the frame.
        with wp.ScopedStream(graphs.stream(device, work.idle)) as stream:
            _join(needed)
            work.launch()
            running.append((work, stream.record_event()))


def _depends(work: Pass, before: Pass) -> bool:
    """Whether a pass uses what an earlier one writes, or writes what that reads."""
    return not (
        {*work.reads, *work.writes}.isdisjoint(before.writes) and set(work.writes).isdisjoint(before.reads)
    )


def _join(running: Sequence[tuple[Pass, Any]]) -> None:
    """The current stream waits for passes aside."""
    for _, done in running:
        wp.wait_event(done)


def _close(running: list[tuple[Pass, Any]]) -> None:
    """The same, before a condition or a loop: neither can be captured while another stream is open, and what comes after it
    cannot wait for an event before it."""
    _join(running)
    running.clear()


def _conditional(passes: Sequence[Pass]) -> Iterator[tuple[wp.array | None, list[Pass]]]:
    """Neighbouring passes with the same condition, and the condition; the passes are given without it."""
    for only_if, group in itertools.groupby(passes, key=_condition):
        yield only_if, [replace(work, only_if=None) for work in group]


def _condition(work: Pass) -> wp.array | None:
    """The condition of a pass; None if it cannot be part of a conditional branch of the graph being captured."""
    if work.only_if is not None and work.scratch:
        device = work.only_if.device
        if device.is_cuda and device.stream.is_capturing:
            return None
    return work.only_if


def _launch(passes: Sequence[Pass]) -> None:
    for work in passes:
        work.launch()
