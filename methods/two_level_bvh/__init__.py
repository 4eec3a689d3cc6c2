"""Two levels for bodies that move rigidly: a tree of each one's triangles is kept, and a small tree of the bodies is rebuilt
in each frame, as engines of ray tracing do with instances.

The scene says which triangles move together. Each frame's mesh remains the truth: its triangles are tested where they are,
so that answers are those of any exact method.
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
from ..common.pairs import all_needs, grown
from ..gpu.reserve import counted
from ..trees import constants
from ..trees.builders import Rebuilt, Refitted, tree_of
from ..trees.method import TreeMethod
from ..trees.trace.bodies import RAY_UNITS
from ..trees.trace.tree_rays import TreeRays
from .levels import Kept, Levels
from .parameters import Build, Trace
from .poses import RIGID

ROOM = 3
"""Units of u Q that vertices may be off by before trees are packed anew with wider boxes."""


class TwoLevelTree(TreeMethod):
    """See the package. Needs: units of padding and of what vertices are off by, then pairs left to float64."""

    name: ClassVar[str] = "two_level_bvh"
    title: ClassVar[str] = "Two-level BVH (trees of bodies kept)"
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._unit, self._units = 0.0, int(RAY_UNITS) + ROOM
        self._deforms = ""
        self._kept: Kept | None = None

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        if frame.triangle_count == 0:
            return miss_passes(frame, effects)
        if frame.triangle_count >= constants.MOST_TRIANGLES:
            raise CapacityRejected(f"holds at most {constants.MOST_TRIANGLES - 1:,} triangles")
        self._memory = limits.memory
        self._capacity = self._capacity or constants.first_capacity(frame.pixels)
        self._tree = tree = self._tree_of(frame)
        first, grows, beside = tree.passes()
        self._rays = rays = TreeRays(
            frame,
            tree.tree,
            effects,
            "exact",
            packets=False,
            threads=self.trace.threads,
            shares=constants.SHARES,
            capacity=self._capacity,
            together=constants.TOGETHER,
        )
        records = [*rays.eye_passes(), *beside, *rays.record_passes(), *rays.clear_passes()]
        if isinstance(tree, Levels):  # records need nothing of the bodies
            first = [work.hinted(parallel=(0,)) for work in first]
        passes = [grows.hinted(parallel=(0,)), *(work.hinted(parallel=(1,)) for work in records)]
        return [*first, *passes, *rays.passes(primary=True), *rays.bounce_passes()]

    def _tree_of(self, frame: Frame) -> Levels | Rebuilt | Refitted:
        """Both levels, or the tree of all triangles of a mesh that deforms."""
        prepared, bodies = frame.prepared, frame.prepared.bodies
        if bodies is None:
            self._deforms = f"nothing says which triangles of {prepared.scene.name} move together"
        if bodies is None or self._deforms:
            if self.build.deforming == "refuse":
                raise CapacityRejected(f"{self._deforms}, and of a mesh that deforms no tree is kept")
            return tree_of(frame, "rebuild", "auto")
        if self._kept is None:
            points, _ = prepared.points(0)
            self._unit = 2.0**-24 * float(prepared.moment(0, 1, 1).max_coordinate[0])
            self._kept = Kept(points, prepared.faces, bodies)
        return Levels(frame, self._kept, self._unit, self._units)

    def needs(self) -> wp.array | None:
        if self._rays is None:
            return None
        return all_needs(*((self._tree.need,) if isinstance(self._tree, Levels) else ()), self._rays.counts)

    def grow(self, needed: NDArray[np.int64]) -> bool:
        before = self._capacity, self._units
        if isinstance(self._tree, Levels):
            (units, off), needed = needed[:2], needed[2:]
            if off > RIGID:
                self._deforms = f"a body's vertices move by {off * 2.0**-24:.1g} of the scene or more among themselves"
                return True
            if units > self._units:
                self._units = int(units + units // 3)
        self._capacity = grown(int(counted(needed).max()), self._capacity, self._memory, "undecided pairs")
        return before != (self._capacity, self._units)

    def built(self) -> dict[str, Any]:
        why = {"because": self._deforms} if self._deforms and self._rays is not None else {}
        return super().built() | why


METHOD = TwoLevelTree
