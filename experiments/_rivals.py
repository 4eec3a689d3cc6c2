"""The strongest structures of each kind, each in one setting for all scenes. Experiments that compare them share this list.

Settings were found on scenes other than those that are shown: the balls of :mod:`.scene.standins.balls`, and real meshes
that are not part of the project.
"""

from __future__ import annotations

from ..harness.runner.experiment import Entry
from ._paper import METHOD

OURS = Entry("ray_grids", {}, "ray grids")

REBUILT = (
    Entry("bvh2", {}, "BVH2 rebuilt"),
    Entry("bvh2", {"precision": "float32"}, "BVH2 rebuilt, float32"),
    Entry("warp_bvh", {"update": "bvh_rebuild"}, "Warp LBVH rebuilt"),
)
"""Trees built anew each frame."""

REFITTED = (
    Entry("bvh2", {"update": "refit"}, "BVH2 refitted"),
    Entry("bvh2", {"update": "refit", "precision": "float32"}, "BVH2 refitted, float32"),
    Entry("warp_bvh", {"update": "refit", "constructor": "cubql"}, "Warp cuBQL refitted"),
)
"""Trees of the first frame whose boxes are refitted: less is asked of them than of the others."""

GRIDS = (Entry(METHOD, {}, "the paper's grids"), Entry("uniform_grid", {}, "uniform grid"))

STRONGEST = (OURS, *REBUILT, *REFITTED, *GRIDS)
