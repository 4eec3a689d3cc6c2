"""The parameters of the hybrid. None of them changes an answer."""

from dataclasses import dataclass

from ...harness.frame.schedule.threads import check_threads
from ..common.parameters import check_choices
from ..trees.builders import BUILDERS, UPDATES

SHADOWS = ("auto", "tree", "grid")


@dataclass(frozen=True)
class Build:
    """How the tree is made, as of bvh2; and what takes the shadow rays.

    update   "rebuild": built in each frame, from the triangles of that frame; "refit": a SAH tree of the animation's
             first frame, its boxes refitted each frame; "static": that tree, for geometry that does not move
    builder  of a rebuilt tree: "lbvh" (Lauterbach et al. 2009, in one pass: Apetrei 2014) or "hploc" (Benthin et al.
             2024); "auto": lbvh below 50,000 triangles
    shadows  "tree": the tree, which all lights share; "grid": a grid of each light, as in ray_grids; the tree is then built
             for mirrored rays only; "auto": the grid where the mesh has more than one triangle for every 600 pixels (if a
             ray of a light crosses more than 1.05 triangles of the first frame on average: for every 64 with one light,
             for every 48 / L with L lights) and nothing is mirrored, otherwise the tree
    """

    update: str = "rebuild"
    builder: str = "auto"
    shadows: str = "auto"

    def __post_init__(self) -> None:
        check_choices(self, update=UPDATES, builder=BUILDERS)
        check_choices(self, shadows=SHADOWS)


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    threads  of a CPU: each streams a share of the triangles, and traces the shadow rays of a share of the pixels; 0: one
             for each core that this process may use, at most 16
    """

    threads: int = 0

    def __post_init__(self) -> None:
        check_threads(self.threads)
