"""Fairy with two lights, as the paper reports it in frames a second, and time against 1 to 16 lights.

Fewest lights first. Embree stands beside them on a CPU alone: with 16 lights its frames on a GPU's host, and the whole
sweep that waits for them, take longer than all the others together; table1 has it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    *document.COMMON,
    "frames_per_s",
    "ms_per_light",
    "further_ms",
    "further_over_first",
    "shadow_rays",
]
PAPER = "the paper: 7.6 frames a second, its kd-tree peer 5.26, and 60 % more time for the second light"
"""Section 5: Fairy with two lights, GTX 280, 1024x1024."""
SAME = (*compare.SCENE, *compare.SIZE, "label")


def read(folder: Path) -> pd.DataFrame:
    """The points, with what each light after the first adds over what the first costs.

    A light costs its grid and its shadow rays: those passes are compared, with one light and with more. (Differences of
    whole frames would hold the noise of the build and of the primary rays, which can be more than a light.)
    """
    frames = document.frames(folder)
    table = document.named(frames)
    table["frames_per_s"] = 1000.0 / table["total_ms"]
    table["ms_per_light"] = (table["light_build_ms"] + table["shadow_ms"]) / table["lights"]
    own, one = compare.pairs(frames, frames["lights"] == 1, SAME)
    lights_ms, first_ms = (side["light_build_ms"] + side["shadow_ms"] for side in (own, one))
    further = (lights_ms - first_ms) / (own["lights"].where(own["lights"] > 1) - 1)
    table["further_ms"] = table["key"].map(further)
    table["further_over_first"] = table["key"].map(further / first_ms)
    whole = compare.ratios(frames, frames["lights"] == 1, SAME)
    table["second_share"] = table["key"].map(whole["ratio"]) - 1
    table["share_spread"] = table["key"].map(whole["spread"])
    return table


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against the number of lights, CSV, and frames a second with two."""
    table = read(folder)
    files = [document.write_csv(table, folder / "two_lights.csv", COLUMNS)]
    done = document.measured(table)
    looks = panels.looks(done)
    for (name, title), own in done.groupby(["file", "title"], sort=False):
        path = folder / f"two_lights-{name}.svg"
        with panels.sheet(path, (style.COLUMN_WIDTH, 2.7)) as (_, grid):
            axes = grid[0, 0]
            for label, line in own.sort_values("lights").groupby("label", sort=False):
                axes.errorbar(line["lights"], line["total_ms"], yerr=line["iqr_ms"] / 2, label=label,
                              elinewidth=0.7, **looks[label])  # fmt: skip
            axes.set_xscale("log", base=2)
            style.plain_log(axes)
            axes.set_xticks(counts := sorted(own["lights"].unique()), counts)
            axes.set(xlabel="number of lights", ylabel="ms per frame, everything rebuilt")
            axes.set_title(title, loc="left")
        files.append(path)
    tables = {"Lights": lights_table(done)}
    return document.write(folder, "two_lights", EXPERIMENT.title, finding(done), tables, files, table, quiet)


def lights_table(done: pd.DataFrame) -> pd.DataFrame:
    """A row a scene and method: frames of one and two lights, and each further light over the first."""
    import pandas as pd

    lines = []
    for (title, label), own in done.groupby(["title", "label"], sort=False):
        by_count = {row.lights: row for row in own.sort_values("lights").itertuples()}
        line: dict[str, str] = {"scene": title, "method": label}
        for count in (1, 2):
            if row := by_count.get(count):
                line[f"{count} light{'s' * (count > 1)}, ms"] = document.carried(row.total_ms, row.spread)
        if two := by_count.get(2):
            line["frames/s with 2"] = rate(two)
            line["2 lights over 1"] = document.carried(two.second_share, two.share_spread, "+%")
        for count, row in by_count.items():
            if count > 1:
                line[f"each further of {count} over the first"] = style.number(row.further_over_first)
        lines.append(line)
    return pd.DataFrame(lines)


def rate(row: Any) -> str:
    """Frames a second, with the digits that the spread carries."""
    return document.carried(row.frames_per_s, row.spread * row.frames_per_s / row.total_ms)


def finding(done: pd.DataFrame) -> str:
    """Frames a second with two lights on the paper's scene, or on the first there is."""
    two = done[done["lights"] == 2]
    if two.empty:
        return "No frame with two lights was measured."
    fairy = two[two["scene"] == "fairy"]
    own = fairy if len(fairy) else two[two["scene"] == two["scene"].iloc[0]]
    rates = ", ".join(f"{rate(row)} ({row.label})" for row in own.itertuples())
    return f"Two lights on {own['title'].iloc[0]}: {rates} frames a second{f'; {PAPER}' * bool(len(fairy))}."


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
