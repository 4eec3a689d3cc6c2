"""A moving light, one turn about the scene: for each animated scene and for static ones.

The animated scenes come first, so that a run that is stopped has them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..harness.report import document, numbers, panels, sentences
from ..harness.results.table import PART_COLUMNS
from ..harness.runner.planning.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from . import _rivals
from ._paper import METHOD, SCENES

METHODS = (
    Entry(METHOD, {}, "the paper's grids"),
    Entry("ray_grids", {}, "ray grids"),
    Entry("warp_bvh", {}, "mesh rebuilt"),
    *_rivals.BODIES,
)
ANIMATED = ("fairy", "bunny_dragon", "cloth")
STATIC = tuple(scene for scene in SCENES if scene not in ANIMATED)


def turn(places: int) -> tuple[Lighting, ...]:
    """One turn of the light: over this many places for a static scene, over all frames of an animated one."""
    return (Lighting("one turn", turns=1.0, frames=places),)


WORK = [
    "counter.shadow tests a hundred rays", "counter.light 0 tiles with rays", "counter.light 0 most rays in a tile",
    "counter.light 0 list, longest", "counter.light 0 pairs",
]  # fmt: skip
"""What explains a slow place: work counters."""

FRAME = ["frame", "total_ms", "iqr_ms", "true_errors", *(f"{part}_ms" for part in PART_COLUMNS.values()), *WORK]
COLUMNS = [*document.COMMON, "frame", "turn", *WORK]
TIMES = {"fastest": "min", "median": "median", "slowest": "max"}
TAILS = {"p95_ms": "95", "p99_ms": "99"}
"""Percentiles of the samples of all places, per cent."""
PAPER_SAYS = "The paper moves its lights too, and rebuilds everything each frame; it shows no path."


def read(folder: Path) -> tuple[document.DataFrame, document.DataFrame]:
    """The points, animated scenes first; and a row per frame of each (or one without a time) with the light's place."""
    frames = document.frames(folder)
    table = document.arranged(document.complete(document.named(frames)), "scene", (*ANIMATED, *STATIC))
    path = table.drop(columns=FRAME, errors="ignore")
    path = path.merge(frames.reindex(columns=["key", *FRAME]), on="key", how="left").copy()
    last = (path["frame_count"].fillna(1) - 1).clip(lower=1)
    turn = (path["frame"] / last * path["light_turns"].fillna(0.0)).astype(float)
    return table, path.assign(turn=turn, whisker=path["iqr_ms"] / 2, wrong=path["true_errors"].fillna(0) > 0)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time of each frame along the path, and CSV with the work of each."""
    import pandas as pd

    table, path = read(folder)
    paths = path.groupby(["title", "label"], sort=False)
    made, around = paths["total_ms"].agg(["count", "min", "median", "max"]), paths["whisker"].max()
    made["ratio"] = made["max"] / made["min"]
    made["ratio_spread"] = made["ratio"] * np.hypot(around / made["min"], around / made["max"])
    pictures = [panels.lines(
        folder / "moving.svg", path, "turn", "total_ms", facet="title", across=2,
        whisker="whisker", wrong="wrong", log_y=False, high=1.25, below="turns of the light about the scene",
        left="ms per frame, everything rebuilt", sharex=True,
    )] if made["count"].any() else []  # fmt: skip
    finding = sentences.ends(
        made.reset_index(), "ratio", "label",
        "Where the light stands matters the least for {}, whose slowest place takes {} times as long as its fastest",
        ", and the most for {}: {}", "No place of the light was measured",
    ) + f"{sentences.over(made.reset_index())}."  # fmt: skip
    count, left_out = made["count"].astype(str), paths["frames_left_out"].first()
    places = count.where(left_out == 0, count + " of " + (made["count"] + left_out).astype(str))
    shown = {"places": places.where(made["count"] > 0, paths["status"].first())}
    shown |= {name: numbers.carry(made[x], around) for name, x in TIMES.items()}
    shown |= {f"{name} % within": numbers.carry(paths[x].first(), around) for x, name in TAILS.items()}
    shown["slowest over fastest"] = numbers.carry(made["ratio"], made["ratio_spread"])
    shown["frames with wrong answers"] = paths["wrong"].sum().where(made["count"] > 0)
    body = pd.DataFrame(shown).rename_axis(["scene", "method"]).reset_index()
    about = finding, {"Milliseconds along the path": body}, pictures, quiet, [PAPER_SAYS]
    return document.write(folder, EXPERIMENT, table, COLUMNS, *about, rows=path)


EXPERIMENT = Experiment(
    name="moving",
    title="A moving light: time of each frame along its path",
    presets={
        "quick": Preset(
            128, 128, (*ANIMATED, "conference"), METHODS, frames=8, samples=3, most=3, stage_samples=1, rounds=1,
            budget_s=10.0, lightings=turn(8),
        ),
        "paper": Preset(
            1024, 1024, (*ANIMATED, *STATIC), METHODS, frames=12, samples=5, most=10, stage_samples=1, rounds=9,
            budget_s=20.0, timeout_s=600.0, lightings=turn(12),
        ),
    },
    draw=draw,
)  # fmt: skip
