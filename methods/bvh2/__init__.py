"""A binary tree of this project, rebuilt in each frame inside the graph. Primary rays are traced in packets or singly,
shadow rays from the light.

It does what tuned trees of GPU ray tracers do, but exactly: float32 decides what it can with a bound on its error,
float64 the rest.
"""

from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ..common.misses import miss_passes
from ..common.pairs import grown
from ..common.parameters import refuse_static
from ..gpu.reserve import counted
from ..trees import constants
from ..trees.builders import tree_of
from ..trees.method import TreeMethod
from ..trees.trace.tree_rays import TreeRays
from .parameters import FLOAT32_INEXACT, Build, Trace


class BinaryTree(TreeMethod):
    """See the package. Needs: pairs left to float64, of the eye's rays, then of each light's."""

    name: ClassVar[str] = "bvh2"
    title: ClassVar[str] = "BVH2 (rebuilt in the graph)"
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self.known_inexact = FLOAT32_INEXACT if self.trace.precision == "float32" else None

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        if frame.triangle_count >= constants.MOST_TRIANGLES:
            raise CapacityRejected(f"holds at most {constants.MOST_TRIANGLES - 1:,} triangles")
        self._memory = limits.memory
        self._capacity = self._capacity or constants.first_capacity(frame.pixels)
        refuse_static(self.name, self.build.update, frame.prepared)
        self._tree = tree = tree_of(frame, self.build.update, self.build.builder, self.build.tree_frame)
        first, grows, beside = tree.passes()
        trace = self.trace
        loose = trace.precision == "float32" and constants.PACKETS * frame.triangle_count < frame.pixels
        packets = loose if trace.primary == "auto" else trace.primary == "packet"
        self._rays = rays = TreeRays(
            frame,
            tree.tree,
            effects,
            trace.precision,
            packets,
            trace.threads,
            constants.SHARES,
            self._capacity,
            together=constants.TOGETHER,
        )
        records = [*rays.eye_passes(), *beside, *rays.record_passes(), *rays.clear_passes()]
        passes = [grows.hinted(parallel=(0,)), *(work.hinted(parallel=(1,)) for work in records)]
        return [*first, *passes, *rays.passes(primary=True), *rays.bounce_passes()]

    def needs(self) -> wp.array | None:
        return self._rays.counts if self._rays is not None else None

    def grow(self, needed: NDArray[np.int64]) -> bool:
        before = self._capacity
        self._capacity = grown(int(counted(needed).max()), before, self._memory, "undecided pairs", varies=True)
        return self._capacity != before

    def counters(self) -> dict[str, int]:
        counts = super().counters()
        if self._rays is not None and self.build.update == "refit":
            host = self._rays.frame.host
            counts["frames since the tree was made"] = (
                abs(host.index - self.build.tree_frame) if host is not None else 0
            )
        return counts


METHOD = BinaryTree
