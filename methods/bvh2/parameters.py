"""The parameters of the tree. None of them changes an exact answer."""

from dataclasses import dataclass

from ...harness.frame.schedule.threads import check_threads
from ..common.parameters import check_choices
from ..trees.builders import BUILDERS, UPDATES

PRECISIONS = ("exact", "float32")
PRIMARIES = ("auto", "packet", "single")

FLOAT32_INEXACT = "float32 triangle tests without a bound; shadow rays end 1e-4 of their length before the hit point"


@dataclass(frozen=True)
class Build:
    """How the tree is made and kept up to date.

    update      "rebuild": built in each frame, from the triangles of that frame; "refit": a SAH tree of one frame of the
                animation, its boxes refitted each frame; "static": that tree, for geometry that does not move
    builder     of a rebuilt tree: "lbvh" (Lauterbach et al. 2009, in one pass: Apetrei 2014) or "hploc" (Benthin et al.
                2024); "auto": lbvh below 50,000 triangles
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
               packets in float32 where there is less than one triangle for every four pixels
    threads    of a CPU: each traces a share of the pixels; 0: one for each core that this process may use, at most 16
    """

    precision: str = "exact"
    primary: str = "auto"
    threads: int = 0

    def __post_init__(self) -> None:
        check_choices(self, precision=PRECISIONS, primary=PRIMARIES)
        check_threads(self.threads)
