"""Figure 6 of the paper: spotlights on the Fairy scene, so that only what they hold has a shadow.

A cone, the paper's rectangle of azimuth and elevation, and a wider cone whose light falls off towards its edge.
"""

from __future__ import annotations

from pathlib import Path

from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import METHOD

FAIRY = (0.05, 1.25, 0.0)
"""Where the fairy of the stand-in hovers."""

FALLING, FALL_OFF = 10.0, 150.0
"""Half-angle, and the exponent that leaves a tenth of the light at that angle."""

LIGHTINGS = (
    Lighting(),
    Lighting("cone", target=FAIRY, angle=6.0),
    Lighting("rectangle", target=FAIRY, angle=9.0, rise=4.0),
    Lighting("cone-fall-off", target=FAIRY, angle=FALLING, falloff=FALL_OFF),
)
METHODS = (Entry(METHOD),)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The scene without and with each spot, and what the spot saves."""
    from ._figures import figure6

    return figure6.draw(folder, quiet)


EXPERIMENT = Experiment(
    name="figure6",
    title="Figure 6: spotlights",
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
