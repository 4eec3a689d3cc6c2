"""The whole frame, everything rebuilt, of our fastest method against every peer in its best configuration.

All are interleaved in one run. Rebuild peers make their tree anew each frame, as the paper's table does; refit peers
keep the tree of the first frame and only refit its boxes, which is less than is asked of the others.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..harness.report import compare, document, panels, roofline, style
from ..harness.runner.experiment import Entry, Experiment, Preset
from ._paper import METHOD, SCENES, faithful
from ._work import ray_grids

if TYPE_CHECKING:
    import pandas as pd

OURS = "ray grids"
REBUILD = (
    Entry("warp_bvh", {}, "mesh rebuilt"),
    Entry("warp_bvh", {"update": "bvh_rebuild"}, "LBVH rebuilt in a graph"),
)
REFIT = (
    Entry("warp_bvh", {"update": "refit", "constructor": "cubql"}, "cubql refitted"),
    Entry("warp_bvh", {"update": "refit", "constructor": "sah"}, "SAH refitted"),
    Entry("warp_bvh", {"update": "refit", "constructor": "lbvh"}, "LBVH refitted"),
)
METHODS = (
    Entry("ray_grids", {}, OURS),
    Entry(METHOD, {}, "the paper's grids"),
    faithful("paper-faithful"),
    *REBUILD,
    *REFIT,
    Entry("uniform_grid", {}, "uniform grid"),
)


COLUMNS = [*document.COMMON, "times_slower", "low", "high", "memory_bytes", "built"]
KINDS = {"rebuilds": [entry.label for entry in REBUILD], "refits": [entry.label for entry in REFIT]}


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Ratios to the fastest peer of each kind, with the rounds' range; bars by part of the frame; the floor; CSV."""
    import pandas as pd

    frames = document.frames(folder)
    table, ours = document.named(frames), frames["label"] == OURS
    table = table.join(compare.ratios(frames, ours).drop(columns=["spread", "frames"]), on="key")
    table = table.rename(columns={"ratio": "times_slower"})
    files = [document.write_csv(table, folder / "frame_time.csv", COLUMNS)]
    done, stages = document.measured(table), roofline.stages(frames[ours], ray_grids)
    floors = roofline.of_frames(stages)
    if len(stages):
        files.append(document.write_csv(stages, folder / "frame_time-stages.csv", roofline.COLUMNS))
    if OURS in set(done["label"]):
        files.append(picture(done, floors, folder / "frame_time.svg"))
    own = done[done["label"] == OURS].set_index("scene")
    peers = pd.concat([fastest(done, kind) for kind in KINDS])
    tables = {
        f"Frame time of the fastest peer over that of {OURS}, and its range over the rounds": against(
            own, peers, floors
        )
    }
    notes = ["Floor: bytes over bandwidth or ray-triangle tests over rate, and launches. Farthest from theirs, mean of the "
             f"scenes: {farthest(stages, floors)}."] if len(floors) else []  # fmt: skip
    return document.write(
        folder, "frame_time", EXPERIMENT.title, finding(own, peers), tables, files, table, quiet, notes
    )


def fastest(done: pd.DataFrame, kind: str) -> pd.DataFrame:
    """The fastest peer of a kind on each scene, over the frames that it has in common with ours."""
    peers = done[done["label"].isin(KINDS[kind]) & done["times_slower"].notna()]
    return peers.loc[peers.groupby("scene", sort=False)["times_slower"].idxmin()].assign(kind=kind)


def finding(own: pd.DataFrame, peers: pd.DataFrame) -> str:
    """Our times, and how many times slower the fastest peer of each kind is."""
    if own.empty:
        return f"{OURS} was not measured."
    text = f"A frame of {OURS}, everything rebuilt, takes {document.span(own['total_ms'])} ms"
    for kind, ratio in peers.groupby("kind", sort=False)["times_slower"]:
        text += f"; the fastest peer that {kind} its tree {document.span(ratio, '{:.2f}'.format)} times that"
        text += f" (geometric mean {compare.geometric(ratio):.2f})"
    return text + "."


def against(own: pd.DataFrame, peers: pd.DataFrame, floors: pd.Series) -> pd.DataFrame:
    """A row a scene: our time, the fastest peer of each kind and its ratio with the range, and our time over the floor."""
    import pandas as pd

    made = pd.DataFrame({"scene": own["title"], f"{OURS}, ms": own["total_ms"].map(style.number)})
    for kind, best in peers.groupby("kind", sort=False):
        made[f"fastest that {kind}"] = pd.Series(
            {
                r.scene: f"{r.times_slower:.2f} ({r.low:.2f} to {r.high:.2f}; {r.label})"
                for r in best.itertuples()
            }
        )
    if len(floors):
        made["floor, ms"] = floors.map("{:.3f}".format)
        made["times the floor"] = (own["total_ms"] / floors).map("{:.1f}".format)
    return made


def farthest(stages: pd.DataFrame, floors: pd.Series) -> str:
    """The three stages that lose most milliseconds to their floors, mean of the scenes with a floor."""
    known = stages[stages["scene"].isin(floors.index)]
    lost = (known["ms"] - known["floor_ms"]).groupby(known["stage"]).sum() / max(1, len(floors))
    return ", ".join(f"{stage} by {ms:.3f} ms" for stage, ms in lost.nlargest(3).items())


def picture(done: pd.DataFrame, floors: pd.Series, path: Path) -> Path:
    """A panel a scene, stacked bars by part of the frame: beside each its time, its time over ours, and wrong answers."""
    labels = [OURS, *(label for label in done["label"].unique() if label != OURS)]
    tints = style.colours(labels)
    scenes = list(done.groupby("scene", sort=False))
    across = 1 if len(scenes) <= 3 else 2
    down = -(-len(scenes) // across)
    size = (
        style.COLUMN_WIDTH * (0.35 + 0.65 * across),
        (0.125 * len(labels) + 0.28) * down + 0.75 + 0.12 * (across == 1),
    )
    with panels.sheet(path, size, down, across, legend=5 if across == 2 else 3, grid="x") as (figure, grid):
        panels.name_parts(grid[0, 0])
        cut, named = False, list[str]()
        for place, (scene, own) in enumerate(scenes):
            axes = grid.flat[place]
            own = own.sort_values("label", key=lambda column: column.map(labels.index))
            # A method many times slower than the rest would leave them no room: its bar is cut and says its time.
            limit = 4.0 * own["total_ms"].median()
            cut |= bool((own["total_ms"] > limit).any())
            texts = [beside(row) for row in own.to_dict("records")]
            panels.bars(
                axes, own, [panels.part_tints(tints[x]) for x in own["label"]], texts, limit, size=5.5
            )
            if scene in floors and own["label"].iloc[0] == OURS:
                axes.plot(
                    floors[scene], -0.42, "v", color="black", ms=3.5, label=f"floor of {OURS}", clip_on=False
                )
            shown = list(own["label"])
            axes.set_yticks(
                range(len(own)), shown if place % across == 0 or shown != named else [""] * len(own)
            )
            named = shown
            axes.set_xlim(0, 1.5 * min(limit, own["total_ms"].max()))
            axes.set_title(own["title"].iloc[0], loc="left", fontsize=7)
        for axes in grid.flat[len(scenes) :]:
            axes.set_axis_off()
        wrong = (
            f"{style.WRONG} n: n wrong pixels and visibility bits" if done["true_errors"].gt(0).any() else ""
        )
        said = [
            f"ms per frame; 2.0x: twice the time of {OURS}",
            "black tick: the whole frame",
            wrong,
            "//: cut off" * cut,
        ]
        figure.supxlabel("; ".join(said[:2]) + "\n" + "; ".join(filter(None, said[2:])), fontsize=7)
    return path


def beside(row: dict[str, Any]) -> str:
    """What stands at a bar's end: three digits of its time, its time over ours, and what is wrong of its answers."""
    text = f"{digits(row['total_ms'])} ms"
    if row["label"] != OURS and row["times_slower"] == row["times_slower"]:
        text += f", {digits(row['times_slower'])}x"
    return text if row["error"] == style.OK else f"{text}  {row['error'].removesuffix(' wrong')}"


def digits(value: float) -> str:
    """A number with three digits, whatever its size: 0.312, 5.00, 61.3, 1,234."""
    places = max(0, 2 - math.floor(math.log10(abs(value)))) if value else 2
    return f"{value:,.{places}f}"


EXPERIMENT = Experiment(
    name="frame_time",
    title="Frame time: our fastest method against every peer",
    presets={
        "quick": Preset(
            256, 256, ("sibenik", "cloth"), METHODS, frames=1, samples=3, most=3, stage_samples=1, rounds=2, budget_s=6.0,
        ),
        "paper": Preset(
            1024, 1024, SCENES, METHODS, frames=3, samples=10, most=30, deviation=0.005, stage_samples=5, rounds=3,
            budget_s=12.0, timeout_s=300.0,
        ),
    },
    draw=draw,
)  # fmt: skip
