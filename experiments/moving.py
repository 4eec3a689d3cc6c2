"""A moving light, one turn about the scene: for each animated scene and for static ones.

The animated scenes come first, so that a run that is stopped has them.
"""

from pathlib import Path

from ..harness.report import compare, document, numbers, panels
from ..harness.report.dataframe import DataFrame, pd
from ..harness.results.table import PART_COLUMNS
from ..harness.runner.planning.experiment import Entry, Experiment
from ..harness.scene.overrides import Lighting
from . import _rivals
from ._paper import METHOD, SCENES, large, small

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


WORK = [  # what explains a slow place: work counters
    "counter.shadow tests a hundred rays", "counter.light 0 tiles with rays", "counter.light 0 most rays in a tile",
    "counter.light 0 list, longest", "counter.light 0 pairs",
]  # fmt: skip

FRAME = ["frame", "total_ms", "iqr_ms", "true_errors", *(f"{part}_ms" for part in PART_COLUMNS.values()), *WORK]
COLUMNS = [*document.COMMON, "frame", "turn", *WORK]
TIMES = {"fastest": "min", "median": "median", "slowest": "max"}
TAILS = {"p95_ms": "95", "p99_ms": "99"}  # percentiles of the samples of all places, per cent
PAPER_SAYS = "The paper moves its lights too, and rebuilds everything each frame; it shows no path."


def read(folder: Path) -> tuple[DataFrame, DataFrame]:
    """The points, animated scenes first; and a row per frame of each (or one without a time) with the light's place."""
    frames = document.frames(folder)
    table = document.arranged(document.complete(document.named(frames)), "scene", (*ANIMATED, *STATIC))
    path = table.drop(columns=FRAME, errors="ignore")
    path = path.merge(frames.reindex(columns=["key", *FRAME]), on="key", how="left").copy()
    last = (path["frame_count"].fillna(1) - 1).clip(lower=1)
    turn = (path["frame"].astype("Int64") / last * path["light_turns"].fillna(0.0)).astype(float)
    return table, path.assign(turn=turn, whisker=path["iqr_ms"] / 2, wrong=path["true_errors"].fillna(0) > 0)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time of each frame along the path, and CSV with the work of each."""
    table, path = read(folder)
    paths = path.groupby(["title", "label"], sort=False)
    made, around = paths["total_ms"].agg(["count", "min", "median", "max"]), paths["whisker"].max()
    made["ratio"], made["ratio_spread"] = compare.over(made["max"], around, made["min"], around)
    picture = panels.lines(
        folder / "moving.svg", path, "turn", "total_ms", facet="title", across=2,
        whisker="whisker", wrong="wrong", log_y=False, high=1.25, below="turns of the light about the scene",
        left="ms per frame, everything rebuilt", sharex=True,
    )  # fmt: skip
    count, left_out = made["count"].astype(str), paths["frames_left_out"].first()
    places = count.where(left_out == 0, count + " of " + (made["count"] + left_out).astype(str))
    shown = {
        "places": places.where(made["count"] > 0, paths["status"].first()),
        **{name: numbers.carry(made[x], around) for name, x in TIMES.items()},
        **{f"{name} % within": numbers.carry(paths[x].first(), around) for x, name in TAILS.items()},
        "slowest over fastest": numbers.texts(made, "ratio"),
        "frames with wrong answers": paths["wrong"].sum().where(made["count"] > 0),
    }
    tables = {"Milliseconds along the path": pd.DataFrame(shown).rename_axis(["scene", "method"]).reset_index()}
    made = made.reset_index()
    finding = numbers.ends(
        made, "ratio", "label",
        "Where the light stands matters the least for {}, whose slowest place takes {} times as long as its fastest",
        ", and the most for {}: {}", "No place of the light was measured",
    ) + f"{numbers.over(made)}."  # fmt: skip
    return document.write(
        folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet, [PAPER_SAYS], rows=path
    )


EXPERIMENT = Experiment(
    "moving", "A moving light: time of each frame along its path",
    {
        "quick": small(128, (*ANIMATED, "conference"), METHODS, 10.0, frames=8, lightings=turn(8)),
        "paper": large(
            (*ANIMATED, *STATIC), METHODS, 20.0, frames=12, most=10, deviation=None, stage_samples=1, lightings=turn(12)
        ),
    },
    draw,
)  # fmt: skip
