"""A moving light, one turn about the scene: over each animated scene and over those that stand still.

The animated ones come first: a run that is stopped has them.
"""

from __future__ import annotations

from pathlib import Path

from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import METHOD, SCENES

METHODS = (Entry(METHOD, {}, "perspective + spherical"), Entry("ray_grids"), Entry("bvh"))
ANIMATED = ("fairy", "bunny_dragon", "cloth")
STATIC = tuple(scene for scene in SCENES if scene not in ANIMATED)


def turn(places: int) -> tuple[Lighting, ...]:
    """One turn, at so many places over a scene that stands still, over all frames of one that does not."""
    return (Lighting("one turn", turns=1.0, frames=places),)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time of each frame along the path, CSV, and what the slowest frames did more of than others."""
    from ._figures import moving

    return moving.draw(folder, quiet, (*ANIMATED, *STATIC))


EXPERIMENT = Experiment(
    name="moving",
    title="A moving light: time of each frame along its path",
    presets={
        "quick": Preset(
            128, 128, (*ANIMATED, "conference"), METHODS, frames=8, samples=3, most=3, stage_samples=1, rounds=1,
            budget_s=10.0, lightings=turn(8),
        ),
        "paper": Preset(
            1024, 1024, (*ANIMATED, *STATIC), METHODS, frames=12, samples=10, most=10, stage_samples=1, rounds=2,
            budget_s=20.0, timeout_s=600.0, lightings=turn(12),
        ),
    },
    draw=draw,
)  # fmt: skip
