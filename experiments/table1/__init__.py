"""Table 1 of the paper: build, trace and shadow times of every method on every scene, everything rebuilt.

The paper's columns are an HBVH, a kd-tree, a uniform grid and its own two structures on a GTX 280; ours are the
methods below on this machine. The quick preset is for a CPU: at its size it is not to be held against the paper.
"""

from __future__ import annotations

from importlib.util import find_spec

from ...harness.runner.experiment import Entry, Experiment, Preset
from .drawing import draw

SCENES = ("fairy", "sibenik", "bunny_dragon", "conference", "cloth", "buddha")
"""The paper's, in its order."""

REAL = ("bunny",) if find_spec("pxr") else ()
"""A small real scene that needs no download, where USD files can be read."""

METHODS = (Entry("perspective_spherical"), Entry("uniform_grid"), Entry("warp_bvh"), Entry("embree"))


EXPERIMENT = Experiment(
    name="table1",
    title="Table 1: build, trace and shadow times",
    presets={
        "quick": Preset(
            width=256,
            height=256,
            scenes=SCENES + REAL,
            methods=METHODS,
            frames=2,
            samples=5,
            most=5,
            stage_samples=1,
            rounds=2,
            budget_s=40.0,
            timeout_s=180.0,
        ),
        "paper": Preset(
            width=1024,
            height=1024,
            scenes=SCENES + REAL,
            methods=METHODS,
            frames=5,
            samples=10,
            most=40,
            deviation=0.005,
            stage_samples=10,
            rounds=3,
            budget_s=40.0,
            timeout_s=600.0,
        ),
    },
    draw=draw,
)
