"""A moving light, one turn about the scene: over scenes that stand still and over each animated one."""

from __future__ import annotations

from pathlib import Path

from ..harness.lighting import Lighting
from ..harness.plan import Entry, Experiment, Preset
from ._paper import METHOD, SCENES

METHODS = (Entry(METHOD, {}, "perspective + spherical"), Entry("ray_grids"), Entry("bvh"))
ANIMATED_AND_ONE = ("fairy", "bunny_dragon", "cloth", "conference")


def turn(places: int) -> tuple[Lighting, ...]:
    """One turn, at so many places over a scene that stands still, over all frames of one that does not."""
    return (Lighting("one turn", turns=1.0, frames=places),)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time of each frame along the path, and CSV."""
    from ..harness.figures import moving

    return moving.draw(folder, quiet)


EXPERIMENT = Experiment(
    name="moving",
    title="A moving light: time of each frame along its path",
    presets={
        "quick": Preset(
            128, 128, ANIMATED_AND_ONE, METHODS, frames=8, samples=3, most=3, stage_samples=1, rounds=1, budget_s=10.0,
            lightings=turn(8),
        ),
        "paper": Preset(
            1024, 1024, SCENES, METHODS, frames=12, samples=10, most=10, stage_samples=1, rounds=2, budget_s=20.0,
            timeout_s=600.0, lightings=turn(12),
        ),
    },
    draw=draw,
)  # fmt: skip
