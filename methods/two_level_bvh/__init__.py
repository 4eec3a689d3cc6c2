"""Two levels for bodies that move rigidly: a tree of each one's triangles is kept, and a small tree of the bodies is rebuilt
in each frame, as engines of ray tracing do with instances.

The scene says which triangles move together. Each frame's mesh remains the truth: its triangles are tested where they are,
so that answers are those of any exact method.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.schedule.threads import check_threads
from ..common.pairs import all_needs
from ..common.parameters import check_choices
from ..trees.builders import Rebuilt, Refitted, tree_of
from ..trees.method import TreeMethod
from ..trees.trace.bodies import RAY_UNITS
from .levels import Kept, Levels
from .poses import RIGID

ROOM = 3
"""Units of u Q that vertices may be off by before trees are packed anew with wider boxes."""


@dataclass(frozen=True)
class Build:
    """How trees are made. No parameter changes an answer.

    deforming  a mesh that deforms, or of which nothing says what moves together: "rebuild": it is traced with a single tree
               of all triangles, rebuilt in each frame; "refuse": it is rejected
    """

    deforming: str = "rebuild"

    def __post_init__(self) -> None:
        check_choices(self, deforming=("rebuild", "refuse"))


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    threads  of a CPU: each traces a share of the pixels; 0: one for each core that this process may use, at most 16
    """

    threads: int = 0

    def __post_init__(self) -> None:
        check_threads(self.threads)


class TwoLevelTree(TreeMethod):
    """See the package. Needs: units of padding and of what vertices are off by, then those of the rays."""

    name: ClassVar[str] = "two_level_bvh"
    title: ClassVar[str] = "Two-level BVH (trees of bodies kept)"
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self._unit, self._units = 0.0, int(RAY_UNITS) + ROOM
        self._deforms = ""
        self._kept: Kept | None = None

    def tree_of(self, frame: Frame) -> Levels | Rebuilt | Refitted:
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
        pairs = super().needs()
        return all_needs(self._tree.need, pairs) if pairs is not None and isinstance(self._tree, Levels) else pairs

    def grow(self, needed: NDArray[np.int64]) -> bool:
        before = self._units
        if isinstance(self._tree, Levels):
            (units, off), needed = needed[:2], needed[2:]
            if off > RIGID:
                self._deforms = f"a body's vertices move by {off * 2.0**-24:.1g} of the scene or more among themselves"
                return True
            if units > self._units:
                self._units = int(units + units // 3)
        return super().grow(needed) or before != self._units

    def built(self) -> dict[str, Any]:
        why = {"because": self._deforms} if self._deforms and self._rays is not None else {}
        return super().built() | why


METHOD = TwoLevelTree
