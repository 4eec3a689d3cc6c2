"""One method on one frame: plan, load, run, grow where a capacity did not suffice, and capture as a graph.

Everything that runs a method goes through a session: timing, verification, rendering, tests.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..scene.effects import Effects, Limits
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from .frame import Frame
from .method import Method
from .mirrors import mirror_passes
from .passes import Pass, PassRunner
from .receivers import receiver_passes, skippable
from .schedule import arranged, inputs_of, live, stale, wanted_of
from .shading import shading_passes

GROWTH_LIMIT = 8
"""A frame repeated more often than this has a method whose needs do not settle."""


class Session(PassRunner):
    """A method planned on a frame of a prepared scene.

    planned     the passes of the method and of the harness
    all_passes  those of them that what is wanted needs
    passes      those that :meth:`run` and :meth:`graph` launch: fewer after :meth:`select`
    made        the moment whose whole frame the arrays are known to hold, which :meth:`advance` goes on from, or None
    regrown     how often a capacity was exceeded, the frame discarded and run again
    """

    def __init__(
        self,
        method: Method,
        prepared: Prepared,
        width: int,
        height: int,
        device: str,
        light_count: int | None = None,
        effects: Effects | None = None,
        limits: Limits | None = None,
    ):
        super().__init__(device, [])
        scene = prepared.scene
        self.method = method
        self.effects = effects or Effects.of(scene)
        self.limits = limits or Limits()
        count = len(scene.lights) if light_count is None else light_count
        self.frame = Frame(prepared, width, height, count, device, self.effects)
        self.made: Moment | None = None
        self._owed: set[Pass] = set()
        self.regrown = 0
        self.planned: list[Pass] = []
        self.all_passes: list[Pass] = []
        self._plan()

    def _plan(self) -> None:
        self.made = None
        self._owed = set()
        with wp.ScopedDevice(self.device):
            self._graphs.clear()
            planned = self.method.plan(self.frame, self.effects, self.limits)
        self.capturable = self.method.capturable
        added = [
            *mirror_passes(self.frame, self.effects),
            *receiver_passes(self.frame, self.effects),
            *shading_passes(self.frame, self.effects),
        ]
        self.planned = skippable(arranged(planned, added), self.frame, self.effects)
        self.all_passes = live(self.planned, wanted_of(self.effects))
        self.passes = self.all_passes

    def load(self, moment: Moment) -> None:
        """Copy the next moment in; all of it runs."""
        self.made = None
        self.frame.load(moment)
        self.passes = self.all_passes

    def select(self, changed: Collection[str]) -> None:
        """From now on run what must be run where only ``changed`` differs from the last frame (a whole one)."""
        self.passes = stale(self.all_passes, changed)

    def advance(self, moment: Moment) -> frozenset[str]:
        """Make the next frame from the last, running only what its changes call for; returns the changed inputs.

        The whole frame is run where the last one is not known to be complete (the first frame, one loaded but not
        settled, one that was rejected), and where a capacity no longer suffices.
        """
        changed = changes(self.made, moment)
        self.load(moment)
        self.select(changed)
        self.select(changed | self._owed_to(self.passes))
        self.run()
        self._note_skipped()
        self.passes = self.all_passes
        if self._grow():
            self.settle()
        self.made = moment
        return changed

    def _note_skipped(self) -> None:
        """Keep what the last launch skipped because nothing received its light: it is of an older frame now.

        Shadow bits are not: they are cleared where they are not traced.
        """
        wanted = set(wanted_of(self.effects))
        launched: dict[wp.array, bool] = {}  # neighbours share a condition: each is read back once
        for work in self.passes:
            if work.only_if is None or wanted.issuperset(work.writes):
                continue
            if work.only_if not in launched:
                launched[work.only_if] = bool(work.only_if.numpy()[0])
            if launched[work.only_if]:
                self._owed.discard(work)
            else:
                self._owed.add(work)

    def _owed_to(self, passes: Collection[Pass]) -> set[str]:
        """What must be made up for before ``passes`` run: what was skipped for the lights that they are of."""
        return {
            name
            for skipped in self._owed
            if any(work.only_if is skipped.only_if for work in passes)
            for name in skipped.writes
        }

    def settle(self) -> None:
        """Run the frame until every capacity suffices; after this, replays of the same moment fit.

        Raises :class:`~.errors.CapacityRejected` where a need lies beyond the limits.
        """
        for _ in range(GROWTH_LIMIT):
            self.run()
            if not self._grow():
                self._note_skipped()
                if self.passes is self.all_passes:
                    self.made = self.frame.host
                return
        raise RuntimeError(f"{self.method.name}: needs still grow after {GROWTH_LIMIT} repeats of one frame")

    def overflowed(self) -> bool:
        """Whether the last frame needed more than it had; its capacities are then raised and the frame is void."""
        return self._grow()

    def _grow(self) -> bool:
        needs = self.method.needs()
        if needs is None:
            return False
        needed: NDArray[np.int64] = np.array(needs.numpy(), dtype=np.int64)
        if not self.method.grow(needed):
            return False
        self.regrown += 1
        self._plan()
        return True

    def answers(self, moment: Moment) -> dict[str, NDArray]:
        """Load a moment, run it until it fits, and return the answers on the host (poisoned before the run)."""
        self.load(moment)
        self.poison()
        self.settle()
        wp.synchronize_device(self.device)
        return self.frame.answers.to_host()

    def poison(self) -> None:
        """Fill the answers that :attr:`passes` write with values that no method may leave behind.

        Shadow bits of lights that cast none are nobody's to write: they are 0. Where only some lights are traced again
        (:meth:`select`), the bits of the others and the hit points stay, mirrored ones among them.
        """
        answers, written = self.frame.answers, {name for work in self.passes for name in work.writes}
        whole = self.passes is self.all_passes or "hits" in written
        if whole:
            answers.poison()
        for i in range(len(answers.visibility)):  # a frame without lights has a row too
            if whole and (i >= len(self.effects.shadows) or not self.effects.shadows[i]):
                answers.visibility[i].zero_()
                for bounce in range(1, self.effects.bounces + 1):
                    self.frame.bits(bounce)[i].zero_()
            elif f"visibility/{i}" in written:
                answers.visibility[i].fill_(77)


def changes(before: Moment | None, after: Moment) -> frozenset[str]:
    """The inputs, named as passes name them, in which two moments of one scene differ; all where there is no first."""
    if before is None:
        return frozenset(inputs_of(len(after.lights)))
    changed = set()
    if not (
        np.array_equal(before.points, after.points, equal_nan=True)
        and np.array_equal(before.valid, after.valid)
    ):
        changed.add("points")
    views = ((m.eye, m.axes, m.tangents, m.column, m.row) for m in (before, after))
    if not all(np.array_equal(a, b) for a, b in zip(*views, strict=True)):
        changed.add("camera")
    if before.reach != after.reach:
        changed.add("reach")
    for i in range(len(after.lights)):
        pairs = ((before.lights, after.lights), (before.spots, after.spots))
        if not all(np.array_equal(a[i : i + 1], b[i : i + 1]) for a, b in pairs):
            changed.add(f"light/{i}")
    return frozenset(changed)
