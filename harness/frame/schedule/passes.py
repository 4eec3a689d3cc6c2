"""A frame is a list of passes. Timed stages, graph capture and the schedule follow from that list."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the parts of a frame are read where nothing is launched
    import warp as wp

PARTS = ("build", "trace", "light build", "shadow")
BUILD_PARTS = ("build", "light build")


@dataclass(frozen=True)
class Hints:
    """When a captured graph may run a pass. Without a graph all passes run in order.

    early     whether it reads no output of another pass of the frame: it runs at the same time as all passes that do not
              depend on it, at low priority
    overlap   whether it is needed late only: it is launched as soon as what it reads is written, and runs at the same time
              as the passes up to its place, or to one that depends on it
    yields    of a pass that overlaps others: whether these have priority, so that it fills what they leave idle
    parallel  numbers, one per level of nesting. Neighbouring passes with different numbers run at the same time, passes
              with the same number in order; with a condition, those of the same condition
    phase     parallel passes of the same phase run at the same time, and begin when those of the phase before have ended.
              What a frame leaves out does not change this
    """

    early: bool = False
    overlap: bool = False
    yields: bool = False
    parallel: tuple[int, ...] = ()
    phase: int = 0


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
    hints   when a captured graph may run it
    adds    whether it only adds to what it writes (atomics, bits that stay set), so that another pass may do so at the
            same time
    loops   whether the launch captures a loop of its own. In a captured graph nothing runs at the same time, because a loop
            cannot be captured while another stream is open; so it has no hints
    only_if int32 [1] on the device: the pass is launched only if it is not 0 (set by the harness inside the frame)
    apart   passes that together do the same one after the other: where the frame needs only some of them anew, these are
            launched in its place
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
    hints: Hints = Hints()
    adds: bool = False
    loops: bool = False
    only_if: wp.array | None = None
    apart: tuple[Pass, ...] = ()
    reached: wp.array | None = None

    def __post_init__(self) -> None:
        if self.part not in PARTS:
            raise ValueError(f"pass {self.name!r}: part {self.part!r} is not one of {PARTS}")
        if self.loops and (self.hints.parallel or self.hints.early or self.hints.overlap):
            raise ValueError(f"pass {self.name!r}: nothing can run at the same time as a loop")

    def run(self) -> None:
        run_passes([self])

    def hinted(self, **changed: Any) -> Pass:
        return replace(self, hints=replace(self.hints, **changed))


def joined(name: str, apart: tuple[Pass, ...], launch: Callable[[], None]) -> Pass:
    """What several passes do one after the other, in one launch."""
    reads, writes = dict[str, None](), dict[str, None]()
    for work in apart:
        reads |= dict.fromkeys(name for name in work.reads if name not in writes)
        writes |= dict.fromkeys(work.writes)
    return Pass(name, apart[0].part, tuple(reads), tuple(writes), launch, apart=apart)


def run_passes(passes: Sequence[Pass]) -> None:
    """Launch every pass in order. Neighbouring passes with the same condition form one conditional branch."""
    for only_if, group in itertools.groupby(passes, key=condition):
        launch = partial(_launch_all, list(group))
        if only_if is None:
            launch()
        else:
            import warp as wp

            wp.capture_if(only_if, launch)


def condition(work: Pass) -> wp.array | None:
    """The condition of a pass; None if it cannot be part of a conditional branch of the graph being captured."""
    device = work.only_if.device if work.only_if is not None and work.scratch else None
    return None if device is not None and device.is_cuda and device.stream.is_capturing else work.only_if


def _launch_all(passes: Sequence[Pass]) -> None:
    for work in passes:
        work.launch()
