"""Figure 9 of the paper: its test scenes, traced with shadows by its own method; of an animation its middle frame."""

from __future__ import annotations

from pathlib import Path

from ..harness.runner.experiment import Entry, Experiment, Preset
from ._paper import METHOD, SCENES

METHODS = (Entry(METHOD),)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The gallery, and triangle counts beside the paper's."""
    from ._figures import figure9

    return figure9.draw(folder, quiet)


EXPERIMENT = Experiment(
    name="figure9",
    title="Figure 9: the test scenes",
    presets={
        "quick": Preset(
            384, 384, SCENES, METHODS, frames=1, samples=1, most=1, stage_samples=1, rounds=1, budget_s=10.0
        ),
        "paper": Preset(
            1024, 1024, SCENES, METHODS, frames=1, samples=5, most=5, stage_samples=2, rounds=1, budget_s=20.0,
            timeout_s=600.0,
        ),
    },
    draw=draw,
)  # fmt: skip
