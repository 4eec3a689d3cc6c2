"""Figure 2 of the paper: triangles checked per pixel, direct and indirect mapping of threads to rays.

Indirect mapping traces with blocks of 16 x 16 pixels and sorts triangles to the 2 x 2 (or 4 x 4) smaller tiles inside.
Direct mapping can be read in two ways: tiles as large as those blocks, or tiles as small as the sorting tiles, which
are blocks then. The paper: 30-50 % faster on Buddha, the maximum more than halved.
"""

from __future__ import annotations

from pathlib import Path

from ..harness.runner.experiment import Experiment, Preset
from ._paper import faithful

DIRECT, INDIRECT = "direct, 16x16 tiles", "indirect, 2x2 of 8x8"
DIRECT_SMALL = "direct, 8x8 tiles"

METHODS = (
    faithful(DIRECT, tile="16", k="1"),
    faithful(INDIRECT, tile="8", k="2"),
    faithful("indirect, 4x4 of 4x4", tile="4", k="4"),
    faithful(DIRECT_SMALL, tile="8", k="1"),
)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The maps side by side, the CSV, and what they show."""
    from ._figures import figure2

    return figure2.draw(folder, quiet, (DIRECT, DIRECT_SMALL), INDIRECT)


EXPERIMENT = Experiment(
    name="figure2",
    title="Figure 2: triangles checked per pixel, direct and indirect mapping",
    presets={
        "quick": Preset(
            256, 256, ("buddha",), METHODS, frames=1, samples=3, most=3, rounds=2, budget_s=15.0, maps=True
        ),
        "paper": Preset(
            1024, 1024, ("buddha",), METHODS, frames=1, samples=10, most=40, deviation=0.005, stage_samples=10,
            rounds=3, budget_s=30.0, timeout_s=600.0, maps=True,
        ),
    },
    draw=draw,
)  # fmt: skip
