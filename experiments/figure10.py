"""Figure 10 of the paper: time of each stage of a frame, on its six scenes.

The paper's stages: grid build, data rearrangement (mapping, sorting, scanning and chunking of the shadow rays), and
traversal; here primary and shadow rays stand apart. Rearrangement is said not to depend on the model but on the
resolution: so every scene is measured at half the width and height too, in the same run.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..harness.runner.experiment import Experiment, Preset
from ._figures.figure10 import Stage
from ._paper import SCENES, faithful

STAGES = (
    Stage("grid_build", "grid build", "build", "", "primary", 0.6),
    Stage("primary_traversal", "primary traversal", "trace", "", "primary", 0.0),
    Stage(
        "rearrangement",
        "ray mapping and rearrangement",
        "shadow",
        "map rays|sort rays|chunks",
        "shadow",
        0.75,
    ),
    Stage("light_grid_build", "light grid build", "light build", "", "shadow", 0.45),
    Stage("shadow_traversal", "shadow traversal", "shadow", "shadow rays", "shadow", 0.0),
)

METHODS = (faithful("paper-faithful"),)


def with_half(base: Preset) -> Preset:
    """A preset, and the same at half its width and height after it."""
    return replace(base, also=(replace(base, width=base.width // 2, height=base.height // 2),))


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Stacked bars, CSV, and whether rearrangement depends on the model and on the resolution."""
    from ._figures import figure10 as stages

    return stages.draw(folder, quiet, STAGES, "rearrangement")


EXPERIMENT = Experiment(
    name="figure10",
    title="Figure 10: time of each stage of a frame",
    presets={
        "quick": with_half(Preset(
            256, 256, SCENES, METHODS, frames=3, samples=2, most=2, stage_samples=3, rounds=1, budget_s=8.0
        )),
        "paper": with_half(Preset(
            1024, 1024, SCENES, METHODS, frames=5, samples=10, most=40, deviation=0.005, stage_samples=20, rounds=3,
            budget_s=60.0, timeout_s=600.0,
        )),
    },
    draw=draw,
)  # fmt: skip
