"""The passes of a frame as a captured graph: what runs at the same time, and what waits for what."""

import itertools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import Any

import warp as wp

from . import graphs
from .passes import Pass, condition


def capture_passes(passes: Sequence[Pass], device: str) -> Any:
    """The passes as a graph (CUDA). The early passes of each branch run at the same time as the others, until a pass that
    depends on one of them or the first condition: a conditional branch cannot be captured while another is open.

    Raises ValueError if an early pass reads the output of another pass of the frame or writes what one before it uses,
    and if concurrent passes use a resource that one of them writes.
    """
    passes = _moved_forward(passes)
    early = [work for work in passes if work.hints.early and work.only_if is None]
    rest = [work for work in passes if work not in early]
    _refuse_early(passes, early)
    refuse_shared(passes)
    refuse_shared(rest)
    branches: dict[tuple[int, ...], list[Pass]] = {}
    for work in early:
        branches.setdefault(work.hints.parallel, []).append(work)
    with graphs.capture(device) as captured:
        running: list[tuple[Pass, Any]] = []
        for branch in branches.values():
            with wp.ScopedStream(graphs.stream(device, yields=True)) as stream:
                for work in branch:
                    work.launch()
                    running.append((work, stream.record_event()))
        _capture(rest, device, running)
        _join(running)
    return captured.graph


def _refuse_early(passes: Sequence[Pass], early: Sequence[Pass]) -> None:
    """ValueError if an early pass reads or writes what a pass before it, or of another branch, uses or writes."""
    made = {name for work in passes for name in work.writes}
    for work in early:
        if not made.isdisjoint(work.reads):
            raise ValueError(f"pass {work.name!r} cannot run early: it reads what another pass of the frame writes")
        before = [other for other in passes[: passes.index(work)] if other not in early]
        for other in (*before, *(other for other in early if other.hints.parallel != work.hints.parallel)):
            shared = set(work.writes).intersection((*other.reads, *other.writes))
            if shared and not (work.adds and other.adds):
                raise ValueError(
                    f"pass {work.name!r} cannot run early: {other.name!r}, which runs at the same time, uses {min(shared)}"
                )


def _moved_forward(passes: Sequence[Pass]) -> list[Pass]:
    """The passes, those that overlap others after the last one that they depend on."""
    moved: list[Pass] = []
    for work in passes:
        place = len(moved)
        while work.hints.overlap and place > 0 and not _depends(work, moved[place - 1]):
            place -= 1
        moved.insert(place, work)
    return moved


def _forks(passes: Sequence[Pass], depth: int) -> Iterator[tuple[bool, list[list[Pass]]]]:
    """Groups of passes that run in order: whether the group forks at ``depth``, and its branches (one if it does not)."""

    def place(work: Pass) -> tuple[int, bool]:
        return work.hints.phase, len(work.hints.parallel) > depth and work.only_if is None

    for (_, forked), group in itertools.groupby(passes, key=place):
        branches: dict[int, list[Pass]] = {}
        for work in group:
            branches.setdefault(work.hints.parallel[depth] if forked else 0, []).append(work)
        yield forked, list(branches.values())


def refuse_shared(passes: Sequence[Pass], depth: int = 0) -> None:
    """ValueError if concurrent passes use a resource that one of them writes."""
    for forked, branches in _forks(passes, depth):
        for one, other in itertools.permutations(branches, 2):
            for work, against in itertools.product(one, other):
                shared = {*work.reads, *work.writes}.intersection(against.writes)
                if shared and not (work.adds and against.adds):
                    raise ValueError(
                        f"pass {work.name!r} cannot run concurrently with {against.name!r}, which writes {min(shared)}"
                    )
        if forked:
            for branch in branches:
                refuse_shared(branch, depth + 1)
            continue
        for only_if, together in _conditional(branches[0]):
            if only_if is not None:
                refuse_shared(together, depth)


def _capture(
    passes: Sequence[Pass], device: str, running: list[tuple[Pass, Any]], depth: int = 0, awaited: Collection[Pass] = ()
) -> None:
    """Capture passes on the current stream. ``running``: passes that run early or overlap others, and the events of
    their ends; ``awaited``: those that the stream has waited for. To wait again would be another edge of the graph.
    """
    awaited = set(awaited)
    for forked, branches in _forks(passes, depth):
        if not forked:
            for only_if, together in _conditional(branches[0]):
                if only_if is None:
                    _launch_overlapping(together, device, running, awaited)
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
    """Capture passes, and wait for those that overlap others."""
    running: list[tuple[Pass, Any]] = []
    _capture(passes, device, running, depth)
    _join(running)


def _launch_overlapping(
    passes: Sequence[Pass], device: str, running: list[tuple[Pass, Any]], awaited: set[Pass]
) -> None:
    """Launch passes; each waits for those that run at the same time and that it depends on, unless the stream has
    ``awaited`` them. Those that overlap others get streams of their own.
    """
    for work in passes:
        if work.loops:
            _close(running)
        needed = [entry for entry in running if entry[0] not in awaited and _depends(work, entry[0])]
        if not work.hints.overlap:
            _join(needed)
            awaited.update(before for before, _ in needed)
            work.launch()
            continue
        # It begins at this place of the frame.
        with wp.ScopedStream(graphs.stream(device, work.hints.yields)) as stream:
            _join(needed)
            work.launch()
            running.append((work, stream.record_event()))


def _depends(work: Pass, before: Pass) -> bool:
    """Whether a pass uses what an earlier one writes, or writes what that reads."""
    return not ({*work.reads, *work.writes}.isdisjoint(before.writes) and set(work.writes).isdisjoint(before.reads))


def _join(running: Sequence[tuple[Pass, Any]]) -> None:
    """The current stream waits for passes on other streams."""
    for _, done in running:
        wp.wait_event(done)


def _close(running: list[tuple[Pass, Any]]) -> None:
    """The same, before a condition or a loop: these cannot be captured while another stream is open."""
    _join(running)
    running.clear()


def _conditional(passes: Sequence[Pass]) -> Iterator[tuple[wp.array | None, list[Pass]]]:
    """Neighbouring passes with the same condition, and the condition; the passes are given without it."""
    for only_if, group in itertools.groupby(passes, key=condition):
        yield only_if, [replace(work, only_if=None) for work in group]
