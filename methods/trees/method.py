"""What methods of a tree have in common: a tree, and the rays that are traced through it."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ..common.misses import miss_passes
from ..common.pairs import grown
from ..gpu.reserve import counted
from . import constants
from .quality import expected
from .trace.tree_rays import TreeRays


class TreeMethod(BaseMethod):
    """``_tree`` says what it is by ``built()``. It and ``_rays`` are None before :meth:`plan`, and without triangles. Needs:
    pairs left to float64, of the eye's rays, then of each light's.
    """

    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror", "orthographic"})

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._capacity = self._memory = 0
        self._tree: Any = None
        self._rays: TreeRays | None = None

    def tree_of(self, frame: Frame) -> Any:
        """The tree, whose ``passes()`` are those before all others, the one that makes it, and those that run concurrently
        with that.
        """
        raise NotImplementedError

    def tracing(self, frame: Frame) -> tuple[str, bool]:
        """Precision and packets of :class:`.trace.tree_rays.TreeRays`."""
        return "exact", False

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        if frame.triangle_count >= constants.MOST_TRIANGLES:
            raise CapacityRejected(f"holds at most {constants.MOST_TRIANGLES - 1:,} triangles")
        self._memory = limits.memory
        self._capacity = self._capacity or constants.first_capacity(frame.pixels)
        self._tree = tree = self.tree_of(frame)
        first, grows, beside = tree.passes()
        self._rays = rays = TreeRays(
            frame, tree.tree, effects, *self.tracing(frame), self.trace.threads, constants.SHARES, self._capacity,
            together=constants.TOGETHER,
        )  # fmt: skip
        records = [*rays.eye_passes(), *beside, *rays.record_passes(), *rays.clear_passes()]
        passes = [grows.hinted(parallel=(0,)), *(work.hinted(parallel=(1,)) for work in records)]
        return [*first, *passes, *rays.passes(primary=True), *rays.bounce_passes()]

    def needs(self) -> wp.array | None:
        return None if self._rays is None else self._rays.counts

    def grow(self, needed: NDArray[np.int64]) -> bool:
        before = self._capacity
        self._capacity = grown(int(counted(needed).max()), before, self._memory, "undecided pairs", varies=True)
        return self._capacity != before

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], ...]:
        """Triangle tests of each pixel's primary ray, and of its shadow rays."""
        assert self._rays is not None
        return self._rays.tests_per_pixel()

    def counters(self) -> dict[str, int]:
        """Pairs that were left to float64 in the last frame, and how good its trees were."""
        if self._rays is None:
            return {}
        counts = {f"{rays} undecided pairs": pairs for rays, pairs in self._rays.undecided_pairs().items()}
        return counts | expected(self._rays.tree)

    def built(self) -> dict[str, Any]:
        return {} if self._tree is None or self._rays is None else {**self._tree.built(), **self._rays.built()}
