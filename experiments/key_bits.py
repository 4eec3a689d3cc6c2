"""What a sort costs by the bits of its keys, at equal numbers of pairs: the sort that the paper's grids are built by.

The paper (section 5): sorting is fast because a cell's number has fewer than 32 bits, 18 in its case. As many pairs as
pixels, as its shadow rays are; in the paper preset four times as many too, so that the cost of launching falls out.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..harness.report import compare, document, panels
from ..harness.results.table import samples, stage_ms
from ..harness.runner.experiment import Experiment, Preset
from ._sorting import SORT, measure

if TYPE_CHECKING:
    import pandas as pd

BITS = (8, 12, 16, 18, 20, 24, 32)
HERE = 18
"""The paper's."""

PAPER = Preset(
    1024, 1024, (), (), frames=1, samples=20, most=60, deviation=0.005, stage_samples=20, rounds=3, budget_s=3.0,
)  # fmt: skip


COLUMNS = [*document.COMMON, "pairs", "bits", "sort_ms", "copy_ms", "ns_a_pair"]


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against bits, CSV, and what 18 bits save against 32."""
    frames, repeats = document.frames(folder), samples(folder)
    table = document.named(frames)
    table["bits"], table["pairs"] = table["point.bits"].astype(int), table["point.pairs"].astype(int)
    table = table.sort_values(["pairs", "bits"])
    table["sort_ms"], table["copy_ms"] = stage_ms(table, "build", SORT), stage_ms(table, "build", "copy")
    table["ns_a_pair"] = 1e6 * table["sort_ms"] / table["pairs"]
    table["spread"] = 1e6 * table["key"].map(compare.pass_spread(repeats, "build", SORT)) / table["pairs"]
    table["text"] = document.pass_texts(table, repeats, "build", SORT)
    table["heading"] = table["bits"].map("{} bits".format)
    table["count"] = table["pairs"].map("{:,} pairs".format)
    picture = panels.lines(
        folder / "key_bits.svg", table, "bits", "ns_a_pair", hue="count", whisker="spread", ticks=str, log_y=False,
        upright=(HERE, f"the paper's {HERE} bits"), below="bits of the key", left="sort, ns per pair",
    )  # fmt: skip
    tables = {"Milliseconds of a sort": document.cross_table(table, {"count": "sorted"}, "heading", "text")}
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding(frames), tables, [picture], quiet)


def finding(frames: pd.DataFrame) -> str:
    """What the paper's bits save against the most, at each number of pairs."""
    bits, most = frames["point.bits"].astype(int), max(BITS)
    own, base = compare.pairs(frames, bits == most)
    share = stage_ms(own, "build", SORT) / stage_ms(base, "build", SORT)
    share = share.set_axis(own["point.pairs"])[(own["point.bits"] == HERE).to_numpy()].dropna().sort_index()
    if share.empty:
        return f"No sort with keys of {HERE} and of {most} bits was measured."
    told = " and ".join(f"{x:.2f} of the time of {most} at {n:,.0f} pairs" for n, x in share.items())
    return f"Keys of {HERE} bits, the paper's, are sorted in {told}; the paper sorts fast because its keys are short."


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
