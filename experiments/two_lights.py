"""Fairy with two lights, in frames per second as in the paper, and time against 1 to 64 lights, in rooms too.

Fewest lights first. Embree is included on a CPU only: with 16 lights its frames on a GPU's host, and the sweep that waits
for them, would take longer than all the others together; table1 has it.
"""

from pathlib import Path

import numpy as np

from ..harness.report import compare, document, numbers, panels, ranking
from ..harness.report.dataframe import DataFrame, Series
from ..harness.results.table import samples
from ..harness.runner.planning.experiment import Entry, Experiment
from ._paper import METHOD, faithful, large, small
from ._rivals import HYBRID, OURS, RASTERISED, REBUILT, lights
from .crossover import NATURAL, over_lights

GRIDS = (
    faithful("paper-faithful"), Entry(METHOD, {}, "the paper's grids"), OURS, HYBRID, RASTERISED, REBUILT[0],
    Entry("warp_bvh", {}, "mesh rebuilt"),
)  # fmt: skip
QUICK = (*GRIDS[:3], *GRIDS[5:], Entry("embree", {}, "Embree"))


COLUMNS = [
    *document.COMMON, "frames_per_s", "ms_per_light", "further_ms", "further_over_first", "shadow_rays",
]  # fmt: skip
PAPER = "the paper, on Fairy: 7.6, its kd-tree peer 5.26, and 60 % more time for the second light"  # section 5


def own_passes(points: DataFrame) -> Series:
    """Time of the lights' own passes, ms; NaN where no pass traces shadow rays alone."""
    return (points["light_build_ms"] + points["shadow_ms"]).where(points["shadow_ms"] > 0)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against the number of lights, CSV, frames per second, and each further light over the first.

    A light costs its grid and its shadow rays: those passes are compared. (Differences of whole frames would hold the noise
    of the build and of the primary rays, which can be more than a light.) A method that traces the rays of a single light
    in one launch with the primary ones has no such passes there.
    """
    frames, repeats = document.frames(folder), samples(folder)
    shadow, build = (compare.pass_spread(repeats, part) for part in ("shadow", "light build"))
    frames["lights_spread"] = frames["key"].map(np.hypot(shadow, build.reindex(shadow.index).fillna(0.0)))
    own, first = compare.pairs(frames, frames["lights"] == 1, (*compare.SCENE, *compare.SIZE, "label"))
    lights_ms, first_ms = own_passes(own), own_passes(first)
    further = own["lights"].where(own["lights"] > 1).astype("float64") - 1
    spread = np.hypot(own["lights_spread"], first["lights_spread"]) / further / first_ms

    table = document.named(frames).sort_values("lights", kind="stable")
    rate = 1000.0 / table["total_ms"]
    table = table.assign(
        frames_per_s=rate, frames_per_s_spread=rate * table["spread"] / table["total_ms"],
        ms_per_light=own_passes(table) / table["lights"], further_ms=(lights_ms - first_ms) / further,
        further_over_first=(lights_ms - first_ms) / further / first_ms, further_over_first_spread=spread,
    )  # fmt: skip
    table["each"] = numbers.texts(table, "further_over_first")
    picture = panels.lines(
        folder / "two_lights.svg", table, "lights", "total_ms", facet="title", across=2, whisker="spread",
        log_x=2, ticks=str, high=1.4 if table["title"].nunique() > 1 else 2.0, below="number of lights", sharex=True,
        left="ms per frame, everything rebuilt",
    )  # fmt: skip
    done, rows = document.measured(table), {"title": "scene", "label": "method"}
    two = done[done["lights"] == 2]
    title = next(iter(two["title"]), "any scene")
    finding = numbers.ends(
        two[two["title"] == title], "frames_per_s", "label", f"With two lights on {title}, {{}} has {{}} frames a second",
        " and {} {}", "Two lights were not measured",
    ) + f" ({PAPER})."  # fmt: skip
    right = done[ranking.exact(done)].assign(seen=NATURAL, moving=NATURAL)
    finding = " ".join([finding, *over_lights("On", right.groupby("title", sort=False))])
    tables = {
        "Milliseconds, by number of lights": document.cross_table(done, rows, "lights", "ms"),
        "Each light after the first over the first, by number of lights":
            document.cross_table(done[done["lights"] > 1], rows, "lights", "each"),
    }  # fmt: skip
    notes = compare.in_sequence(frames)
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet, notes)


EXPERIMENT = Experiment(
    "two_lights", "Several lights: Fairy with two, and time against their number",
    {
        "quick": small(96, ("fairy",), QUICK, 4.0, samples=2, lightings=lights(1, 2, 4, 8, 16)),
        "paper": large(("fairy", "sibenik", "conference"), GRIDS, lightings=lights(1, 2, 4, 8, 16, 32, 64)),
    },
    draw,
)  # fmt: skip
