"""Figure 6 of the paper: a spotlight on the Fairy scene, so that only what its cone holds has a shadow."""

from __future__ import annotations

from pathlib import Path

from ..harness.lighting import Lighting
from ..harness.plan import Entry, Experiment, Preset
from ._paper import METHOD

FAIRY = (0.05, 1.25, 0.0)
"""Where the fairy of the stand-in hovers."""

LIGHTINGS = (Lighting(), Lighting("spot", target=FAIRY, angle=6.0))
METHODS = (Entry(METHOD),)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The scene without and with the spot, and what the spot saves."""
    from ..harness.figures import figure6

    return figure6.draw(folder, quiet)


EXPERIMENT = Experiment(
    name="figure6",
    title="Figure 6: a spotlight",
    presets={
        "quick": Preset(
            384, 384, ("fairy",), METHODS, frames=1, samples=3, most=3, rounds=2, budget_s=10.0, lightings=LIGHTINGS
        ),
        "paper": Preset(
            1024, 1024, ("fairy",), METHODS, frames=1, samples=10, most=40, deviation=0.005, stage_samples=10,
            rounds=3, budget_s=30.0, timeout_s=600.0, lightings=LIGHTINGS,
        ),
    },
    draw=draw,
)  # fmt: skip
