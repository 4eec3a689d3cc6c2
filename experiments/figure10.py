"""Figure 10 of the paper: time of each stage of a frame, on its six scenes.

The paper's stages: grid build, data rearrangement (mapping, sorting, scanning and chunking of the shadow rays), and
traversal; here primary and shadow rays are separate. The paper says that rearrangement depends on the resolution and not
on the model: so every scene is measured at half the width and height too, in the same run.
"""

from dataclasses import replace
from pathlib import Path

from ..harness.report import compare, document, numbers, panels, style
from ..harness.report.dataframe import DataFrame, pd
from ..harness.results.table import stage_ms
from ..harness.runner.planning.experiment import Experiment, Preset
from ._paper import SCENES, faithful, large, small

PRIMARY, SHADOW = "#0072B2", "#D55E00"
STAGES = {  # passes that are counted together: title; part of the frame and names, a regular expression; colour
    "grid_build": ("grid build", ("build", ""), style.lightened(PRIMARY, 0.6)),
    "primary_traversal": ("primary traversal", ("trace", ""), style.lightened(PRIMARY, 0.0)),
    "rearrangement": (
        "ray mapping and rearrangement", ("shadow", "map rays|sort rays|chunks"), style.lightened(SHADOW, 0.75)
    ),
    "light_grid_build": ("light grid build", ("light build", ""), style.lightened(SHADOW, 0.45)),
    "shadow_traversal": ("shadow traversal", ("shadow", "shadow rays"), style.lightened(SHADOW, 0.0)),
}  # fmt: skip
PASSES = {name: passes for name, (_, passes, _) in STAGES.items()}

METHODS = (faithful("paper-faithful"),)


def with_half(base: Preset) -> Preset:
    """A preset, and the same at half its width and height after it."""
    return replace(base, also=(replace(base, width=base.width // 2, height=base.height // 2),))


TIMES, PARTS = [f"{name}_ms" for name in STAGES], ["build_ms", "trace_ms", "light_build_ms", "shadow_ms"]
COLUMNS = [*document.COMMON, *TIMES, "other_ms", "shadow_rays"]


def read(frames: DataFrame, folder: Path) -> DataFrame:
    """The points of frames with the stages' times in ms, what no stage holds, and the rays mapped."""
    table = document.with_passes(document.named(frames), folder, PASSES)
    # Sums of the same numbers in another order: what differs by a rounding is nothing, and never minus zero.
    other = (table[PARTS].sum(axis=1, skipna=False) - table[TIMES].sum(axis=1)).round(9) + 0.0
    rays = table.filter(regex=r"^counter\.light .* rays$").sum(axis=1)
    return table.assign(other_ms=other, shadow_rays=rays.where(rays > 0))


def growth(frames: DataFrame) -> DataFrame:
    """Every stage's time at the largest size over that at the smallest, a row per scene, over the frames that both have."""
    smallest, largest = frames["pixels"].min(), frames["pixels"].max()
    high, low = compare.pairs(frames, frames["pixels"] == smallest, (*compare.SCENE, *compare.LIGHTS))
    high = high[(high["pixels"] == largest) & (smallest < largest)]
    low = low.loc[high.index]
    ratios = {name: stage_ms(high, *passes) / stage_ms(low, *passes) for name, passes in PASSES.items()}
    return pd.DataFrame(ratios).set_axis(high["scene"]).replace(float("inf"), float("nan"))


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Stacked bars of the largest size, CSV, and whether rearrangement depends on the model and on the resolution."""
    frames = document.frames(folder)
    table, grown = read(frames, folder), growth(frames)
    rows = document.measured(read(frames[frames["pixels"] == frames["pixels"].max()], folder))
    if rows.empty:
        return document.write(folder, EXPERIMENT, table, COLUMNS, "Nothing was measured.", {}, [], quiet)
    name = rows["title"] + (", " + rows["label"]) * (rows["label"].nunique() > 1)
    rows = rows.assign(name=name, text=rows["ms"])
    parts = {title: (f"{name}_ms", colour) for name, (title, _, colour) in STAGES.items()}
    picture = panels.bars(folder / "figure10.svg", rows, name="name", parts=parts, room=1.2, legend=2)
    variation = rows[TIMES].std(ddof=0) / rows[TIMES].mean()
    made = rows.set_index("name")[[f"{name}_text" for name in STAGES]].T
    made.insert(0, "stage", list(parts))
    made["variation"] = variation.map("{:.0%}".format).array
    finding = (
        f"Rearrangement takes {numbers.carried(rows['rearrangement_ms'].mean())} ms, the mean over {len(rows)} scenes; "
        f"its coefficient of variation is {variation['rearrangement_ms']:.0%} (the paper: the same for all models)."
    )
    if len(grown):
        means = grown.apply(compare.geometric)
        made["larger over smaller size"] = means.map("{:.1f}".format).array
        finding += f" It takes {means['rearrangement']:.1f} times as long at the larger size, same frames."
    tables = {"Stages at the largest size, ms": made}
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet)


EXPERIMENT = Experiment(
    "figure10", "Figure 10: time of each stage of a frame",
    {
        "quick": with_half(small(256, SCENES, METHODS, 8.0, samples=2, frames=3, stage_samples=3)),
        "paper": with_half(large(SCENES, METHODS, 20.0, frames=3, most=30, stage_samples=5)),
    },
    draw,
)  # fmt: skip
