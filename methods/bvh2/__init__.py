"""A binary tree of this project, rebuilt in each frame inside the graph. Primary rays are traced in packets or singly,
shadow rays from the light.

It does what tuned trees of GPU ray tracers do, but exactly: float32 decides what it can with a bound on its error,
float64 the rest.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from ...harness.frame.frame import Frame
from ...harness.frame.schedule.threads import check_threads
from ..common.parameters import check_choices, refuse_static
from ..trees import constants
from ..trees.builders import BUILDERS, UPDATES, tree_of
from ..trees.method import TreeMethod

PRECISIONS = ("exact", "float32")
PRIMARIES = ("auto", "packet", "single")

FLOAT32_INEXACT = "float32 triangle tests without a bound; shadow rays end 1e-4 of their length before the hit point"


@dataclass(frozen=True)
class Build:
    """How the tree is made and kept up to date. No parameter changes an exact answer.

    update      "rebuild": built in each frame, from the triangles of that frame; "refit": a SAH tree of one frame of the
                animation, its boxes refitted each frame; "static": that tree, for geometry that does not move
    builder     of a rebuilt tree: "lbvh" (Lauterbach et al. 2009, in one pass: Apetrei 2014) or "hploc" (Benthin et al.
                2024); "auto": lbvh below 70,000 triangles
    tree_frame  of a refitted tree: the frame that it is made of, 0 is the first
    """

    update: str = "rebuild"
    builder: str = "auto"
    tree_frame: int = 0

    def __post_init__(self) -> None:
        check_choices(self, update=UPDATES, builder=BUILDERS)
        if self.tree_frame < 0 or (self.tree_frame and self.update != "refit"):
            raise ValueError("tree_frame must be 0 or more, and 0 unless update=refit")


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    precision  "exact": float32 tests with a bound on their error, float64 for what they leave undecided; "float32": the
               same tree as it is usually traced, with its errors. Scenes with holes, rays of an orthographic
               camera and shadow rays of a directional light are traced exactly in either case
    primary    on the GPU: "packet": the rays of 8 x 4 pixels share one stack; "single": each ray has its own; "auto":
               packets where there is less than one triangle for every four pixels in float32, for every 14 exactly
    threads    of a CPU: each traces a share of the pixels; 0: one for each core that this process may use, at most 16
    """

    precision: str = "exact"
    primary: str = "auto"
    threads: int = 0

    def __post_init__(self) -> None:
        check_choices(self, precision=PRECISIONS, primary=PRIMARIES)
        check_threads(self.threads)


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
        pixels = constants.PACKETS if trace.precision == "float32" else constants.EXACT_PACKETS
        return trace.precision, pixels * frame.triangle_count < frame.pixels

    def counters(self) -> dict[str, int]:
        counts = super().counters()
        if self._rays is not None and self.build.update == "refit":
            host = self._rays.frame.host
            counts["frames since the tree was made"] = (
                abs(host.index - self.build.tree_frame) if host is not None else 0
            )
        return counts


METHOD = BinaryTree
