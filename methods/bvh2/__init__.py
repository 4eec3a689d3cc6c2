"""A binary tree of this project, rebuilt in each frame inside the graph. Primary rays are traced in packets or singly,
shadow rays from the light.

It does what tuned trees of GPU ray tracers do, but exactly: float32 decides what it can with a bound on its error,
float64 the rest.
"""

from typing import Any, ClassVar

from ...harness.frame.frame import Frame
from ..common.parameters import refuse_static
from ..trees import constants
from ..trees.builders import tree_of
from ..trees.method import TreeMethod
from .parameters import FLOAT32_INEXACT, Build, Trace


class BinaryTree(TreeMethod):
    """See the package."""

    name: ClassVar[str] = "bvh2"
    title: ClassVar[str] = "BVH2 (rebuilt in the graph)"
    Build: ClassVar[type] = Build
    Trace: ClassVar[type] = Trace

    def __init__(self, build: Any = None, trace: Any = None):
        super().__init__(build, trace)
        self.known_inexact = FLOAT32_INEXACT if self.trace.precision == "float32" else None

    def tree_of(self, frame: Frame) -> Any:
        refuse_static(self.name, self.build.update, frame.prepared)
        return tree_of(frame, self.build.update, self.build.builder, self.build.tree_frame)

    def tracing(self, frame: Frame) -> tuple[str, bool]:
        trace = self.trace
        if trace.primary != "auto":
            return trace.precision, trace.primary == "packet"
        loose = trace.precision == "float32" and constants.PACKETS * frame.triangle_count < frame.pixels
        return trace.precision, loose

    def counters(self) -> dict[str, int]:
        counts = super().counters()
        if self._rays is not None and self.build.update == "refit":
            host = self._rays.frame.host
            counts["frames since the tree was made"] = (
                abs(host.index - self.build.tree_frame) if host is not None else 0
            )
        return counts


METHOD = BinaryTree
