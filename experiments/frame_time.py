"""The whole frame, everything rebuilt, of our fastest method against every peer in its best configuration.

All are interleaved in one run. Rebuild peers make their tree anew each frame, as the paper's table does; refit peers
keep the tree of the first frame and only refit its boxes, which is less than is asked of the others.
"""

from __future__ import annotations

from pathlib import Path

from ..harness.runner.experiment import Entry, Experiment, Preset
from ._paper import METHOD, SCENES
from ._work import ray_grids

OURS = "ray grids"
REBUILD = (
    Entry("bvh", {}, "mesh rebuilt"),
    Entry("bvh", {"update": "bvh_rebuild"}, "LBVH rebuilt in a graph"),
)
REFIT = (
    Entry("bvh", {"update": "refit", "constructor": "cubql"}, "cubql refitted"),
    Entry("bvh", {"update": "refit", "constructor": "sah"}, "SAH refitted"),
    Entry("bvh", {"update": "refit", "constructor": "lbvh"}, "LBVH refitted"),
)
METHODS = (
    Entry("ray_grids", {}, OURS),
    Entry(METHOD, {}, "the paper's grids"),
    *REBUILD,
    *REFIT,
    Entry("uniform_grid", {}, "uniform grid"),
)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Ratios to the fastest peer of each kind, with the rounds' range; bars by stage; the floor; CSV."""
    from ._figures import frame_time

    return frame_time.draw(
        folder, quiet, OURS, [entry.label for entry in REBUILD], [entry.label for entry in REFIT], ray_grids
    )


EXPERIMENT = Experiment(
    name="frame_time",
    title="Frame time: our fastest method against every peer",
    presets={
        "quick": Preset(
            256, 256, ("sibenik", "cloth"), METHODS, frames=1, samples=3, most=3, stage_samples=1, rounds=2, budget_s=6.0,
        ),
        "paper": Preset(
            1024, 1024, SCENES, METHODS, frames=3, samples=10, most=30, deviation=0.005, stage_samples=5, rounds=3,
            budget_s=12.0, timeout_s=300.0,
        ),
    },
    draw=draw,
)  # fmt: skip
