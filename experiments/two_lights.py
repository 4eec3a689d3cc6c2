"""Fairy with two lights, as the paper reports it in frames a second, and time against 1 to 16 lights.

Fewest lights first. Embree stands beside them on a CPU alone: with 16 lights its frames on a GPU's host, and the whole
sweep that waits for them, take longer than all the others together; table1 has it.
"""

from __future__ import annotations

from pathlib import Path

from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import METHOD, faithful

GRIDS = (
    faithful("paper-faithful"),
    Entry(METHOD, {}, "perspective + spherical, best"),
    Entry("ray_grids"),
    Entry("bvh"),
)
WITH_EMBREE = (*GRIDS, Entry("embree"))


def lights(*counts: int) -> tuple[Lighting, ...]:
    """So many lights, turned evenly about the middle of the scene."""
    return tuple(Lighting(f"{n} lights" if n > 1 else "1 light", count=n) for n in counts)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against the number of lights, CSV, and frames a second with two."""
    from ._figures import two_lights

    return two_lights.draw(folder, quiet)


EXPERIMENT = Experiment(
    name="two_lights",
    title="Several lights: Fairy with two, and time against their number",
    presets={
        "quick": Preset(
            96, 96, ("fairy",), WITH_EMBREE, frames=1, samples=2, most=2, stage_samples=1, rounds=1, budget_s=4.0,
            lightings=lights(1, 2, 4, 8, 16),
        ),
        "paper": Preset(
            1024, 1024, ("fairy",), GRIDS, frames=3, samples=10, most=20, deviation=0.005, stage_samples=2, rounds=2,
            budget_s=15.0, timeout_s=600.0, lightings=lights(1, 2, 4, 8, 16),
        ),
    },
    draw=draw,
)  # fmt: skip
