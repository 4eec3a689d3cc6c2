"""Fairy with two lights, as the paper reports it in frames a second, and time against 1 to 16 lights.

Fewest lights first. Embree stands beside them on a CPU alone: with 16 lights its frames on a GPU's host, and the whole
sweep that waits for them, take longer than all the others together; table1 has it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..harness.report import compare, document, panels, style
from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import METHOD, faithful

if TYPE_CHECKING:
    import pandas as pd

GRIDS = (
    faithful("paper-faithful"),
    Entry(METHOD, {}, "perspective + spherical, best"),
    Entry("ray_grids"),
    Entry("warp_bvh"),
)
WITH_EMBREE = (*GRIDS, Entry("embree"))


def lights(*counts: int) -> tuple[Lighting, ...]:
    """So many lights, turned evenly about the middle of the scene."""
    return tuple(Lighting(f"{n} lights" if n > 1 else "1 light", count=n) for n in counts)


COLUMNS = [
    *document.COMMON, "frames_per_s", "ms_per_light", "further_ms", "further_over_first", "shadow_rays",
]  # fmt: skip
PAPER = "the paper: 7.6 frames a second, its kd-tree peer 5.26, and 60 % more time for the second light"
"""Section 5: Fairy with two lights, GTX 280, 1024x1024."""
APART = (
    "Numbers of lights are measured one after another, each with its methods interleaved: what is said of one number over "
    "another also holds what the machine drifted between them."
)
SAME = (*compare.SCENE, *compare.SIZE, "label")


def read(folder: Path) -> pd.DataFrame:
    """The points, with what each light after the first adds over what the first costs.

    A light costs its grid and its shadow rays: those passes are compared, with one light and with more. (Differences of
    whole frames would hold the noise of the build and of the primary rays, which can be more than a light.)
    """
    frames = document.frames(folder)
    table = document.named(frames)
    key, one = table["key"], frames["lights"] == 1
    table["frames_per_s"] = 1000.0 / table["total_ms"]
    table["ms_per_light"] = (table["light_build_ms"] + table["shadow_ms"]) / table["lights"]
    own, first = compare.pairs(frames, one, SAME)
    lights_ms, first_ms = (side["light_build_ms"] + side["shadow_ms"] for side in (own, first))
    further = (lights_ms - first_ms) / (own["lights"].where(own["lights"] > 1) - 1)
    table["further_ms"], table["further_over_first"] = key.map(further), key.map(further / first_ms)
    whole = compare.ratios(frames, one, SAME)
    table["more"] = document.carry(key.map(whole["ratio"]) - 1, key.map(whole["spread"]), "+%")
    rate = table["frames_per_s"]
    table["rate"] = document.carry(rate, rate * table["spread"] / table["total_ms"])
    return table


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against the number of lights, CSV, and frames a second with two."""
    table = read(folder)
    rows, done = table.sort_values("lights", kind="stable"), document.measured(table)
    scenes = table["title"].nunique()
    picture = panels.lines(
        folder / "two_lights.svg", rows, "lights", "total_ms", facet="title", across=min(2, scenes), whisker="spread",
        log_x=2, ticks=str, high=1.4 if scenes > 1 else 2.0, below="number of lights", sharex=True,
        left="ms per frame, everything rebuilt",
    )  # fmt: skip
    tables = {"Lights": lights_table(done)}
    return document.write(
        folder, EXPERIMENT, table, COLUMNS, finding(done), tables, [picture], quiet, [APART]
    )


def lights_table(done: pd.DataFrame) -> pd.DataFrame:
    """A row a scene and method: frames of one and two lights, and each further light over the first."""
    import pandas as pd

    few, two, several = done[done["lights"] <= 2], done[done["lights"] == 2], done[done["lights"] > 1]
    count = few["lights"].map({1: "1 light, ms", 2: "2 lights, ms"})
    each = several["lights"].map("each further of {} over the first".format)
    cells = pd.concat([
        few.assign(heading=count, text=few["ms"]),
        two.assign(heading="frames/s with 2", text=two["rate"]),
        two.assign(heading="2 lights over 1", text=two["more"]),
        several.assign(heading=each, text=several["further_over_first"].map(style.number)),
    ])  # fmt: skip
    return document.cross_table(cells, {"title": "scene", "label": "method"}, "heading", "text")


def finding(done: pd.DataFrame) -> str:
    """Frames a second with two lights on the paper's scene, or on the first there is."""
    two = done[done["lights"] == 2]
    if two.empty:
        return "No frame with two lights was measured."
    here = two[two["scene"] == ("fairy" if "fairy" in set(two["scene"]) else two["scene"].iloc[0])]
    rates = ", ".join(here["rate"] + " (" + here["label"] + ")")
    paper = f"; {PAPER}" * (here["scene"].iloc[0] == "fairy")
    return f"Two lights on {here['title'].iloc[0]}: {rates} frames a second{paper}."


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
