"""Run one method on the frames of a scene: plan its passes, load a frame, run it, and enlarge buffers that overflow.
Timing, verification, rendering and tests all run methods through a session.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..scene.closed import TOUCHED, closed_parts_of, enough
from ..scene.effects import Effects, Limits
from ..scene.moment import Moment
from ..scene.prepared import Prepared
from ..scene.width import Sizes, is_wide
from .effects.mirrors import mirror_passes
from .effects.receivers import receiver_passes, skippable
from .effects.shading import shading_passes
from .frame import Frame
from .limited_allocator import LimitedAllocator
from .method import Method
from .room import check_bits
from .schedule.needed import arranged, inputs_of, live, stale, wanted_of
from .schedule.passes import Pass
from .schedule.runner import PassRunner
from .schedule.threads import threads_given

GROWTH_LIMIT = 8  # largest number of repetitions of a frame; if a buffer still overflows then, the method is in error


class Session(PassRunner):
    """A method planned on a frame of a prepared scene.

    planned     the passes of the method and of the harness
    all_passes  those that the outputs of the frame need
    passes      those that :meth:`run` and :meth:`graph` launch: all, or fewer after :meth:`select`
    made        the moment of the complete frame in the arrays, from which :meth:`advance` continues, or None
    regrown     how often a capacity was exceeded, so that the frame was discarded and run again
    """

    def __init__(
        self, method: Method, prepared: Prepared, width: int, height: int, device: str,
        light_count: int | None = None, effects: Effects | None = None, limits: Limits | None = None,
    ):  # fmt: skip
        super().__init__(device, [])
        self.method, self.limits = method, limits or Limits()
        self.effects = effects or Effects.of(prepared.scene)
        count = len(self.effects.shadows) if light_count is None else light_count
        check_bits(self.effects, width * height, count, self.limits)
        self.frame = Frame(prepared, width, height, count, device, self.effects)
        self._memory = LimitedAllocator(device, self.limits.memory)
        self._sizes: Sizes | None = None
        self._wide: WeakKeyDictionary[Moment, bool] = WeakKeyDictionary()
        self._flags: WeakKeyDictionary[Moment, NDArray[np.uint8]] = WeakKeyDictionary()
        self._opened: NDArray[np.bool_] | None = None
        self.regrown = 0
        self._plan()

    def _plan(self) -> None:
        self.made: Moment | None = None
        self._outdated: set[Pass] = set()
        with wp.ScopedDevice(self.device), self._memory.within():
            self._graphs.clear()
            planned = self.method.plan(self.frame, self.effects, self.limits)
        self.capturable = self.method.capturable
        threads = threads_given(getattr(self.method, "build", None), getattr(self.method, "trace", None))
        added = [
            *mirror_passes(self.frame, self.effects),
            *receiver_passes(self.frame, self.effects, planned, threads),
            *shading_passes(self.frame, self.effects),
        ]
        self.planned = arranged(planned, added)
        if self.replays or not wp.get_device(self.device).is_cuda:
            # Launched one by one on a GPU, passes without a ray end sooner than the host learns of it.
            self.planned = skippable(self.planned, self.effects)
        self.passes = self.all_passes = live(self.planned, wanted_of(self.effects))

    def _adapt(self, moment: Moment) -> None:
        """Plan again where a moment needs more digits than the one before, or no more of them (:mod:`..scene.width`)."""
        if moment not in self._wide:
            if self._sizes is None or self._sizes.points is not moment.points:
                self._sizes = Sizes(moment.points, self.frame.prepared.faces, moment.valid)
            self._wide[moment] = is_wide(moment, self._sizes)
        wide = self._wide[moment]
        closed = not wide and self._finds_closed(moment)
        if (wide, closed) != (self.effects.wide, self.effects.closed):
            self.effects = replace(self.effects, wide=wide, closed=closed)
            self._plan()

    def _finds_closed(self, moment: Moment) -> bool:
        """Whether there are closed surfaces that the method may use; marks their triangles (:mod:`..scene.closed`)."""
        effects = self.effects
        if not self.method.finds_closed or not any(effects.shadows) or effects.bounces or effects.orthographic:
            return False
        if moment not in self._flags:
            parts = closed_parts_of(self.frame.prepared)
            if self._opened is None:
                self._opened = np.zeros(parts.count, dtype=bool)
            self._flags[moment] = parts.flags(moment, effects.shadows, self._opened)
        return enough(self._flags[moment])

    def load(self, moment: Moment) -> None:
        """Copy the next moment to the device. All passes will run."""
        self._adapt(moment)
        self._load(moment)

    def _load(self, moment: Moment) -> None:
        self.made = None
        self.frame.load(moment, self._flags[moment] if self.effects.closed else None)
        self.passes = self.all_passes

    def select(self, changed: Collection[str]) -> None:
        """Run only the passes that depend on ``changed``: the inputs that differ from those of the last complete frame."""
        self.passes = stale(self.all_passes, changed)

    def advance(self, moment: Moment) -> frozenset[str]:
        """Make the next frame from the last: run only the passes that depend on what changed. Returns the changed inputs.

        All passes run if the last frame may be incomplete (the first frame, one that was loaded but not run to its
        end, one that was rejected) or if a capacity is exceeded.
        """
        self._adapt(moment)
        changed = changes(self.made, moment)
        if self.effects.closed and self.made in self._flags:
            assert self.made is not None
            if not np.array_equal(self._flags[self.made], self._flags[moment]):
                changed |= {"points"}  # the passes that find what forbids to use closed surfaces run again
        self._load(moment)
        self.select(changed)
        self.select(changed | self._outdated_inputs(self.passes))
        self.run()
        self._note_skipped()
        self.passes = self.all_passes
        if self.overflowed():
            self.run_complete()
        self.made = moment
        return changed

    def _note_skipped(self) -> None:
        """Note the passes that the last launch skipped because no hit received their light. Their results are outdated.

        Shadow bits are not: they are cleared where no ray is traced.
        """
        wanted = set(wanted_of(self.effects))
        conditional = [work for work in self.passes if work.only_if is not None and not wanted.issuperset(work.writes)]
        # Passes share conditions; each condition is read back once.
        launched = {one: bool(one.numpy()[0]) for one in {work.only_if for work in conditional} if one is not None}
        self._outdated.difference_update(conditional)
        self._outdated.update(work for work in conditional if not launched[work.only_if])

    def _outdated_inputs(self, passes: Collection[Pass]) -> set[str]:
        """The outdated resources of the lights of ``passes``, which must be written again before these run."""
        conditions = {work.only_if for work in passes}
        return {name for work in self._outdated if work.only_if in conditions for name in work.writes}

    def run_complete(self) -> None:
        """Run the frame until no buffer overflows, enlarging buffers after each run. Replays of the same frame then fit.

        Raises :class:`~..errors.CapacityRejected` if a need exceeds the limits.
        """
        for _ in range(GROWTH_LIMIT):
            with self._memory.within():  # a method may allocate in its first frame
                self.run()
            if not self.overflowed():
                self._note_skipped()
                if self.passes is self.all_passes:
                    self.made = self.frame.host
                return
        raise self._unsteady_needs()

    def replay_complete(self) -> None:
        """Replay the frame into invalid answers until no buffer overflows. On a GPU the same frame may need more in one run
        than in another, and drops what does not fit. After growth all passes run. Raises as :meth:`run_complete`.
        """
        for _ in range(GROWTH_LIMIT):
            self.poison()
            self.replay()
            if not self.overflowed():
                return
            self.run_complete()
        raise self._unsteady_needs()

    def _unsteady_needs(self) -> RuntimeError:
        return RuntimeError(f"{self.method.name}: buffers still overflow after {GROWTH_LIMIT} repeats of one frame")

    def overflowed(self) -> bool:
        """Whether the last frame exceeded a capacity. If so, the capacity is raised and the frame must be run again."""
        needs = self.method.needs()
        if needs is None:
            return False
        needed = np.array(needs.numpy(), dtype=np.int64)
        with self._memory.within():
            if not self.method.grow(needed):
                return False
        self.regrown += 1
        self._reopen()
        self._plan()
        return True

    def _reopen(self) -> None:
        """From now on count the parts as open of which the method has touched a triangle."""
        touched = self.frame.flags.numpy() & TOUCHED if self.effects.closed else np.zeros(0)
        if touched.any():
            moment = self.frame.host
            assert moment is not None
            assert self._opened is not None
            self._opened[closed_parts_of(self.frame.prepared).of[touched != 0]] = True
            self._flags.clear()
            closed = self._finds_closed(moment)
            self.effects = replace(self.effects, closed=closed)
            self.frame.load(moment, self._flags[moment] if closed else None)

    def answers(self, moment: Moment) -> dict[str, NDArray]:
        """Load a moment, run its complete frame, and return the answers on the host (poisoned before the run)."""
        self.load(moment)
        self.poison()
        self.run_complete()
        wp.synchronize_device(self.device)
        return self.frame.answers.to_host()

    def poison(self) -> None:
        """Fill the answers that :attr:`passes` write with invalid values.

        The bits of lights without shadows are 0, because no pass writes them. After :meth:`select`, the answers that
        no selected pass writes stay as they are.
        """
        answers, written = self.frame.answers, {name for work in self.passes for name in work.writes}
        whole = self.passes is self.all_passes or "hits" in written
        if whole:
            answers.poison()
        for i in range(len(answers.shadowed)):  # a frame without lights has one row, too
            if whole and (i >= len(self.effects.shadows) or not self.effects.shadows[i]):
                answers.shadowed[i].zero_()
                for bounce in range(1, self.effects.bounces + 1):
                    self.frame.bits(bounce)[i].zero_()
            elif f"shadowed/{i}" in written:
                answers.shadowed[i].fill_(77)


def changes(before: Moment | None, after: Moment) -> frozenset[str]:
    """The names of the inputs that differ between two moments of one scene; all inputs if ``before`` is None."""
    if before is None:
        return frozenset(inputs_of(len(after.lights)))
    changed = set()
    if not (np.array_equal(before.points, after.points, equal_nan=True) and np.array_equal(before.valid, after.valid)):
        changed.add("points")
    views = ((m.eye, m.axes, m.tangents, m.column, m.row) for m in (before, after))
    if not all(np.array_equal(a, b) for a, b in zip(*views, strict=True)):
        changed.add("camera")
    if before.max_coordinate != after.max_coordinate:
        changed.add("max_coordinate")
    for i in range(len(after.lights)):
        pairs = ((before.lights, after.lights), (before.spots, after.spots))
        if not all(np.array_equal(a[i : i + 1], b[i : i + 1]) for a, b in pairs):
            changed.add(f"light/{i}")
    return frozenset(changed)
