"""The strongest structures of each kind, each in one setting for all scenes. Experiments that compare them share this list.

Settings were chosen on scenes other than those in the tables: the balls of :mod:`.scene.standins.balls`, and real meshes
that are not part of the project.
"""

from ..harness.report.dataframe import DataFrame, Series
from ..harness.runner.planning.experiment import Entry
from ..harness.scene.overrides import Lighting
from ._paper import METHOD

OURS = Entry("ray_grids", {}, "ray grids")
HYBRID = Entry("hybrid", {}, "hybrid")  # the camera's stream of ray grids with a tree for the shadow rays
RASTERISED = Entry("visibility_buffer", {}, "visibility buffer")  # irregular z-buffers: no structure of the triangles

REBUILT = (  # Trees built anew each frame. "plain": shadow rays as a user of Warp writes them, in float32.
    Entry("bvh2", {}, "BVH2 rebuilt"),
    Entry("bvh2", {"precision": "float32"}, "BVH2 rebuilt, float32"),
    Entry("warp_bvh", {"origin": "plain"}, "mesh rebuilt, plain"),
    Entry("warp_bvh", {"update": "bvh_rebuild"}, "LBVH rebuilt in a graph"),
    Entry("kdtree", {}, "kd-tree"),
)

REFITTED = (  # trees of the first frame whose boxes are refitted: they do less work than the others
    Entry("bvh2", {"update": "refit"}, "BVH2 refitted"),
    Entry("bvh2", {"update": "refit", "precision": "float32"}, "BVH2 refitted, float32"),
    Entry("warp_bvh", {"update": "refit", "constructor": "cubql", "origin": "plain"}, "cubql refitted, plain"),
    Entry("warp_bvh", {"update": "refit", "constructor": "sah", "origin": "plain"}, "SAH refitted, plain"),
)

BODIES = (Entry("two_level_bvh", {"deforming": "refuse"}, "two-level BVH"),)
"""Trees of bodies that move rigidly, kept; for scenes that do not say which triangles move together a row says so."""

GRIDS = (
    Entry(METHOD, {}, "the paper's grids"),
    Entry("uniform_grid", {}, "uniform grid"),
    Entry("two_level_grid", {}, "two-level grid"),
)

DRIVER = (
    Entry("driver", {"origin": "plain"}, "driver built"),
    Entry("driver", {"origin": "plain", "build": "update"}, "driver updated"),
)
"""The driver's ray tracing, with shadow rays as engines write them, in float32: built for a fast build, or updated."""

FEW = (OURS, HYBRID, RASTERISED, *REBUILT[:2], REFITTED[1], GRIDS[0])
"""The fastest of each kind, which can win: measured where minutes count."""

STRONGEST = (OURS, HYBRID, RASTERISED, *REBUILT, *REFITTED, *GRIDS)

REBUILDS = {  # what a method does in each frame before it traces, by label; the last three are in earlier records only
    OURS.label: "sorts its rays",
    HYBRID.label: "sorts its rays",
    RASTERISED.label: "rasterises",
    "paper-faithful": "rebuilds its grids",
    "Embree": "rebuilds its tree",
    "mesh rebuilt": "rebuilds its tree",
    **dict.fromkeys([entry.label for entry in REBUILT], "rebuilds its tree"),
    **dict.fromkeys([entry.label for entry in REFITTED], "refits its tree"),
    BODIES[0].label: "rebuilds the tree of its bodies",
    **dict.fromkeys([entry.label for entry in GRIDS], "rebuilds its grids"),
    "driver built": "rebuilds its tree",
    "driver updated": "refits its tree",
    **dict.fromkeys(["cubql refitted", "SAH refitted", "LBVH refitted"], "refits its tree"),
}


def in_each_frame(table: DataFrame) -> Series:
    """What each point of a tidy table does: :data:`REBUILDS`, and of the hybrid whether it has built its tree there."""
    tree = (table["label"] == HYBRID.label) & table["built"].str.contains("(?:^|, )tree ", na=False)
    return table["label"].map(REBUILDS).mask(tree, f"{REBUILDS[HYBRID.label]}, {REBUILDS[REBUILT[0].label]}")


def lights(*counts: int) -> tuple[Lighting, ...]:
    """The given numbers of lights, turned evenly about the middle of the scene."""
    return tuple(Lighting(f"{n} lights" if n > 1 else "1 light", count=n) for n in counts)
