"""What a sort costs by the bits of its keys, at equal numbers of pairs: the sort that the paper's grids are built by.

The paper (section 5): sorting is fast because a cell's number has fewer than 32 bits, 18 in its case. As many pairs as
pixels, as its shadow rays are; in the paper preset four times as many too, so that the cost of launching falls out.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

from ..harness.report import document, panels, style
from ..harness.results.table import stage_ms
from ..harness.runner.experiment import Experiment, Preset
from ._sorting import SORT, measure

BITS = (8, 12, 16, 18, 20, 24, 32)
HERE = 18
"""The paper's."""

PAPER = Preset(
    1024, 1024, (), (), frames=1, samples=20, most=60, deviation=0.005, stage_samples=20, rounds=3, budget_s=3.0,
)  # fmt: skip


COLUMNS = [*document.COMMON, "pairs", "bits", "sort_ms", "copy_ms", "ns_a_pair"]


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against bits, CSV, and what 18 bits save against 32."""
    table = document.read(folder)
    table["bits"], table["pairs"] = table["point.bits"].astype(int), table["point.pairs"].astype(int)
    table["sort_ms"], table["copy_ms"] = stage_ms(table, "build", SORT), stage_ms(table, "build", "copy")
    table["ns_a_pair"] = 1e6 * table["sort_ms"] / table["pairs"]
    table = table.sort_values(["pairs", "bits"])
    files = [document.write_csv(table, folder / "key_bits.csv", COLUMNS)]
    done = document.measured(table)
    times = done.pivot(index="pairs", columns="bits", values="sort_ms")
    finding = f"No sort with keys of {HERE} and of {max(BITS)} bits was measured."
    if {HERE, max(BITS)} <= set(times):
        shares = (times[HERE] / times[max(BITS)]).dropna()
        told = " and ".join(
            f"{share:.2f} of the time of {max(BITS)} at {n:,} pairs" for n, share in shares.items()
        )
        finding = f"Keys of {HERE} bits, the paper's, are sorted in {told}; the paper sorts fast because its keys are short."
    if len(done):
        with panels.sheet(folder / "key_bits.svg", (style.COLUMN_WIDTH, 2.2)) as (_, grid):
            axes = grid[0, 0]
            for i, (pairs, line) in enumerate(done.groupby("pairs")):
                axes.plot(line["bits"], line["ns_a_pair"], color=style.COLOURS[i % 8], marker=style.MARKERS[i % 8],
                          label=f"{pairs:,} pairs")  # fmt: skip
            axes.axvline(HERE, color="0.4", lw=0.8, ls=":", label=f"the paper's {HERE} bits")
            axes.set(
                xticks=times.columns, xlabel="bits of the key", ylabel="sort, ns per pair", ylim=(0, None)
            )
        files.append(folder / "key_bits.svg")
    shown = times.map(style.number).rename(columns="{} bits".format, index="{:,}".format).reset_index()
    return document.write(
        folder, "key_bits", EXPERIMENT.title, finding, {"Milliseconds of a sort": shown}, files, table, quiet
    )


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
