"""The whole frame, everything rebuilt or refitted: the strongest methods of every kind, each in its best configuration.

All are interleaved in one run. Some make their structure anew in each frame, as the paper's table does; refitted trees are
those of the first frame, whose boxes alone are refitted, which is less work than the others do.
"""

from pathlib import Path
from typing import Any

from ..harness.report import document, numbers, panels, ranking
from ..harness.report.dataframe import DataFrame, pd
from ..harness.runner.planning.experiment import Entry, Experiment
from . import _floor, _rivals
from ._paper import SCENES, faithful, large, small

REBUILD = (Entry("warp_bvh", {}, "mesh rebuilt"), *_rivals.REBUILT)
METHODS = (
    _rivals.OURS, _rivals.HYBRID, _rivals.RASTERISED, faithful("paper-faithful"), *REBUILD, *_rivals.REFITTED,
    *_rivals.BODIES, *_rivals.GRIDS, *_rivals.DRIVER,
)  # fmt: skip

RATIO = ["times_fastest_exact", "low", "high"]
"""Time over that of the fastest exact method of the scene, and its range between rounds."""
COLUMNS = [*document.COMMON, *RATIO, "memory_bytes", "built", "in_each_frame"]
CUT = 5.0  # longer bars are cut off, in shortest bars of the panel: rivals that are near each other are told apart
FLOOR = "Floor: bytes over bandwidth or ray-triangle tests over rate, and launches; stage by stage in frame_time-stages.csv."


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Every scene's methods sorted by time, as tables and as bars by part of the frame; the floor; CSV."""
    frames = document.frames(folder)
    done = ranking.ranked(frames)
    done = done.assign(in_each_frame=_rivals.in_each_frame(done))
    stages = _floor.stages(frames[frames["label"] == _rivals.OURS.label], _floor.ray_grids)
    stages_csv = folder / "frame_time-stages.csv"
    across = 1 if done["title"].nunique() <= 3 else 2
    below = [panels.WHOLE, "2.0x: twice the time of the fastest exact method"]
    below += [f"{numbers.WRONG} n: n wrong pixels and shadow bits"] * int((done["true_errors"] > 0).any())
    files = [
        document.write_csv(stages, stages_csv, _floor.COLUMNS) if len(stages) else None,
        panels.bars(
            folder / "frame_time.svg", done.assign(text=[beside(row) for row in done.to_dict("records")]), facet="title",
            across=across, cut=CUT, room=2.4, legend=3 * across, below="\n".join(below),
        ),
    ]  # fmt: skip
    floor = over_floor(done, stages)
    tables = {
        f"Time of {_rivals.OURS.label} over its floor": floor,
        "Frames that are no graph: the host launches them, ms": launched(done),
        **ranking.tables(done, frames),
    }
    table = document.named(frames).join(done[["times", "low", "high"]].set_axis(RATIO, axis=1))
    table["in_each_frame"] = _rivals.in_each_frame(table)
    notes = [ranking.ABOUT, *([FLOOR] if len(floor) else [])]
    return document.write(folder, EXPERIMENT, table, COLUMNS, ranking.finding(done), tables, files, quiet, notes)


def launched(done: DataFrame) -> DataFrame:
    """Of points whose passes the host launches: a frame of several in a row, one alone, the time to submit it."""
    own = done[done["submitted_ms"].notna()]
    alone, submitted = (own[name].map("{:.2f}".format) for name in ("wall_ms", "submitted_ms"))
    rows = {"scene": own["setting"], "method": own["label"], "in a row": own["ms"], "alone": alone}
    return pd.DataFrame({**rows, "submitted in": submitted})


def over_floor(done: DataFrame, stages: DataFrame) -> DataFrame:
    """One row per scene whose device has known rates: the time, the floor of its stages and how many times that it is."""
    own = done[done["label"] == _rivals.OURS.label].join(_floor.of_frames(stages), on=_floor.SCENE)
    own = own[own["frame_floor_ms"].notna()]
    floor = own["frame_floor_ms"]
    rows = {"scene": own["setting"], "ms": own["ms"], "floor, ms": floor.map("{:.3f}".format),
            "times the floor": (own["total_ms"] / floor).map("{:.1f}".format)}  # fmt: skip
    return pd.DataFrame(rows)


def beside(row: dict[str, Any]) -> str:
    """The text at a bar's end: its time, how many times the fastest exact that is, and wrong answers."""
    text = f"{row['ms']} ms"
    if row["times"] == row["times"] and row["times"] != 1.0:
        text += f", {numbers.carried(row['times'], row['times_spread'])}x"
    return text if row["error"] == numbers.OK else f"{text}  {row['error'].removesuffix(' wrong')}"


EXPERIMENT = Experiment(
    "frame_time", "Frame time of the strongest methods of every kind",
    {
        "quick": small(256, ("sibenik", "cloth"), METHODS, 6.0, rounds=2),
        "paper": large(SCENES, METHODS, 12.0, frames=3, most=30, timeout_s=300.0),
    },
    draw,
)  # fmt: skip
