"""The time of a sort by the number of bits of its keys, at equal numbers of pairs: the sort that builds the paper's
grids.

The paper (section 5): sorting is fast because a cell's number has fewer than 32 bits, 18 in its case. As many pairs as
pixels, as its shadow rays are; in the paper preset also four times as many, so that the cost of launching does not
matter.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

from ..harness.report import compare, document, panels, sentences
from ..harness.results.table import stage_ms
from ..harness.runner.planning.experiment import Experiment, Preset
from ._sorting import SORT, measure

BITS = (8, 12, 16, 18, 20, 24, 32)
HERE = 18
"""The paper's."""
PASS = ("build", SORT)

PAPER = Preset(
    1024, 1024, (), (), frames=1, samples=7, most=30, deviation=0.005, stage_samples=7, rounds=9, budget_s=9.0,
)  # fmt: skip

COLUMNS = [*document.COMMON, "pairs", "bits", "sort_ms", "copy_ms", "ns_a_pair"]


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against bits, CSV, and the gain of 18 bits over 32."""
    frames = document.frames(folder)
    table = document.with_passes(document.named(frames), folder, {"sort": PASS, "copy": ("build", "copy")})
    table["bits"], table["pairs"] = table["point.bits"].astype(int), table["point.pairs"].astype(int)
    own, base = compare.pairs(frames, frames["point.bits"].astype(int) == max(BITS))
    table["share"] = stage_ms(own, *PASS) / stage_ms(base, *PASS)
    table = table.sort_values(["pairs", "bits"])
    table["ns_a_pair"] = 1e6 * table["sort_ms"] / table["pairs"]
    table["around"] = 1e6 * table["sort_spread"] / table["pairs"]
    table["heading"] = table["bits"].map("{} bits".format)
    table["count"] = table["pairs"].map("{:,} pairs".format)
    picture = panels.lines(
        folder / "key_bits.svg", table, "bits", "ns_a_pair", hue="count", whisker="around", ticks=str, log_y=False,
        below=f"bits of the key (the paper's: {HERE})", left="sort, ns per pair",
    )  # fmt: skip
    told = [
        f"{share} times as long for {count}"
        for count, share in sentences.means(table[table["bits"] == HERE], "share", "count")
    ]
    finding = f"A sort by {HERE} bits, the paper's, takes {sentences.listed(told)} as one by {max(BITS)}."
    finding = finding if told else f"A sort by {HERE} bits was not measured."
    tables = {"Milliseconds of a sort": document.cross_table(table, {"count": "sorted"}, "heading", "sort_text")}
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet)


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
