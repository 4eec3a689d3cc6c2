"""What a sort costs by the bits of its keys, at equal numbers of pairs: the sort that the paper's grids are built by.

The paper (section 5): sorting is fast because a cell's number has fewer than 32 bits, 18 in its case. As many pairs as
pixels, as its shadow rays are; in the paper preset four times as many too, so that the cost of launching falls out.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

from ..harness.runner.experiment import Experiment, Preset
from ._sorting import measure

BITS = (8, 12, 16, 18, 20, 24, 32)
HERE = 18
"""The paper's."""

PAPER = Preset(
    1024, 1024, (), (), frames=1, samples=20, most=60, deviation=0.005, stage_samples=20, rounds=3, budget_s=3.0,
)  # fmt: skip


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against bits, CSV, and what 18 bits save against 32."""
    from ._figures import key_bits

    return key_bits.draw(folder, quiet, HERE)


EXPERIMENT = Experiment(
    name="key_bits",
    title="Key bits: what a sort costs by the bits of its keys",
    presets={
        "quick": Preset(512, 512, (), (), frames=1, samples=5, most=5, stage_samples=20, rounds=3, budget_s=6.0),
        "paper": replace(PAPER, also=(replace(PAPER, width=2048, height=2048),)),
    },
    draw=draw,
    measure=partial(measure, bits=BITS),
)  # fmt: skip
