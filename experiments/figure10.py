"""Figure 10 of the paper: time of each stage of a frame, on its six scenes.

The paper's stages: grid build, data rearrangement (mapping, sorting, scanning and chunking of the shadow rays), and
traversal; here primary and shadow rays stand apart. Rearrangement is said not to depend on the model but on the
resolution: so every scene is measured at half the width and height too, in the same run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..harness.report import compare, document, panels, style
from ..harness.results.table import samples, stage_ms
from ..harness.runner.experiment import Experiment, Preset
from ._paper import SCENES, faithful

if TYPE_CHECKING:
    import pandas as pd

PRIMARY, SHADOW = "#0072B2", "#D55E00"


@dataclass(frozen=True)
class Stage:
    """Passes that are counted together: those of ``part`` whose names match ``pattern``.

    ``of`` is :data:`PRIMARY` or :data:`SHADOW`; ``light`` how far that colour is mixed with white.
    """

    key: str
    title: str
    part: str
    pattern: str
    of: str
    light: float

    @property
    def colour(self) -> tuple[float, float, float]:
        return style.lightened(self.of, self.light)


STAGES = (
    Stage("grid_build", "grid build", "build", "", PRIMARY, 0.6),
    Stage("primary_traversal", "primary traversal", "trace", "", PRIMARY, 0.0),
    Stage(
        "rearrangement", "ray mapping and rearrangement", "shadow", "map rays|sort rays|chunks", SHADOW, 0.75
    ),
    Stage("light_grid_build", "light grid build", "light build", "", SHADOW, 0.45),
    Stage("shadow_traversal", "shadow traversal", "shadow", "shadow rays", SHADOW, 0.0),
)

METHODS = (faithful("paper-faithful"),)


def with_half(base: Preset) -> Preset:
    """A preset, and the same at half its width and height after it."""
    return replace(base, also=(replace(base, width=base.width // 2, height=base.height // 2),))


COLUMNS = [*document.COMMON, *(f"{stage.key}_ms" for stage in STAGES), "other_ms", "shadow_rays"]
REARRANGEMENT = "rearrangement_ms"


def with_stages(table: pd.DataFrame) -> pd.DataFrame:
    """The table, of frames or of points, with the stages' times in ms, what no stage holds, and the rays mapped."""
    times = {f"{s.key}_ms": stage_ms(table, s.part, s.pattern) for s in STAGES}
    parts = table[["build_ms", "trace_ms", "light_build_ms", "shadow_ms"]].sum(axis=1, skipna=False)
    # Sums of the same numbers in another order: what differs by a rounding is nothing, and never minus zero.
    rays = table.filter(regex=r"^counter\.light .* rays$").sum(axis=1)
    other = (parts - sum(times.values())).round(9) + 0.0
    return table.assign(**times, other_ms=other, shadow_rays=rays.where(rays > 0))


def variation(values: pd.Series) -> float:
    """Coefficient of variation: standard deviation over mean."""
    return float(values.std(ddof=0) / values.mean()) if len(values) and values.mean() > 0 else 0.0


def growth(frames: pd.DataFrame) -> pd.DataFrame:
    """Every stage's time at the largest size over that at the smallest, a row a scene, over the frames that both have."""
    smallest, largest = frames["pixels"].min(), frames["pixels"].max()
    high, low = compare.pairs(frames, frames["pixels"] == smallest, (*compare.SCENE, *compare.LIGHTS))
    high = high[(high["pixels"] == largest) & (smallest < largest)]
    keys = [f"{stage.key}_ms" for stage in STAGES]
    return (with_stages(high)[keys] / with_stages(low.loc[high.index])[keys].replace(0.0, np.nan)).set_axis(
        high["scene"]
    )


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Stacked bars of the largest size, CSV, and whether rearrangement depends on the model and on the resolution."""
    frames = document.frames(folder)
    table = with_stages(document.named(frames))
    largest = frames["pixels"] == frames["pixels"].max()
    widest = document.measured(with_stages(document.named(frames[largest])))
    grown = growth(frames)
    pictures, tables = [], {}
    if len(widest):
        # The number at a bar's end is the median of the whole frame.
        named = widest["title"] + (", " + widest["label"]) * (widest["label"].nunique() > 1)
        parts = {stage.title: (f"{stage.key}_ms", stage.colour) for stage in STAGES}
        rows = widest.assign(name=named, text=widest["ms"])
        pictures = [panels.bars(folder / "figure10.svg", rows, name="name", parts=parts, room=1.2, legend=2)]
        rays: document.Columns = {"scene": ("title", str), "shadow rays": ("shadow_rays", "{:,.0f}")}
        tables = {
            "Stages at the largest size, ms": by_stage(widest, grown, samples(folder)),
            "Shadow rays at the largest size": document.texts(widest, rays),
        }
    text = finding(widest, grown)
    return document.write(folder, EXPERIMENT, table, COLUMNS, text, tables, pictures, quiet)


def finding(widest: pd.DataFrame, grown: pd.DataFrame) -> str:
    """How much rearrangement varies with the model and grows with the pixels. Claims judge whether the paper is right."""
    times = widest[REARRANGEMENT]
    if widest["scene"].nunique() < 2:
        return "One scene alone does not say how the stages depend on the model."
    text = (
        f"Rearrangement takes {document.span(times)} ms over {len(times)} scenes, a coefficient of variation of "
        f"{variation(times):.0%} (the paper: more or less the same for all models)"
    )
    if len(grown):
        text += (
            f"; {compare.geometric(grown[REARRANGEMENT]):.1f} times as long at the larger size, same frames"
        )
    return text + "."


def by_stage(widest: pd.DataFrame, grown: pd.DataFrame, repeats: pd.DataFrame) -> pd.DataFrame:
    """Stages down, scenes across, then how much a stage varies over them and grows from the smallest size."""
    import pandas as pd

    cells = [
        widest.assign(stage=s.title, text=document.pass_texts(widest, repeats, s.part, s.pattern))
        for s in STAGES
    ]
    made = document.cross_table(pd.concat(cells), ["stage"], "title", "text")
    times = [f"{s.key}_ms" for s in STAGES]
    made["variation"] = [f"{variation(widest[time]):.0%}" for time in times]
    if len(grown):
        made["larger over smaller size"] = [f"{compare.geometric(grown[time]):.1f}" for time in times]
    return made


EXPERIMENT = Experiment(
    name="figure10",
    title="Figure 10: time of each stage of a frame",
    presets={
        "quick": with_half(Preset(
            256, 256, SCENES, METHODS, frames=3, samples=2, most=2, stage_samples=3, rounds=1, budget_s=8.0
        )),
        "paper": with_half(Preset(
            1024, 1024, SCENES, METHODS, frames=5, samples=10, most=40, deviation=0.005, stage_samples=20, rounds=3,
            budget_s=60.0, timeout_s=600.0,
        )),
    },
    draw=draw,
)  # fmt: skip
