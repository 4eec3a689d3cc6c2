"""The whole frame, everything rebuilt, of our fastest method against every peer in its best configuration.

All are interleaved in one run. Rebuild peers make their tree anew each frame, as the paper's table does; refit peers
keep the tree of the first frame and only refit its boxes, which is less work than the others do.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..harness.report import compare, document, panels, style
from ..harness.runner.experiment import Entry, Experiment, Preset
from . import _floor, _rivals
from ._paper import SCENES, faithful

OURS = _rivals.OURS.label
REBUILD = (Entry("warp_bvh", {}, "mesh rebuilt"), *_rivals.REBUILT)
REFIT = _rivals.REFITTED
METHODS = (
    _rivals.OURS,
    _rivals.HYBRID,
    _rivals.RASTERISED,
    faithful("paper-faithful"),
    *REBUILD,
    *REFIT,
    *_rivals.GRIDS,
)

COLUMNS = [*document.COMMON, "times_slower", "low", "high", "memory_bytes", "built"]
KINDS = {
    **dict.fromkeys([entry.label for entry in REBUILD], "rebuilds its tree"),
    **dict.fromkeys([entry.label for entry in REFIT], "refits its tree"),
    _rivals.RASTERISED.label: "rasterises",
    **dict.fromkeys(["cubql refitted", "SAH refitted", "LBVH refitted"], "refits its tree"),
}
"""What a peer does in each frame, by label; the last three are in earlier records only."""
CUT = 4.0
"""A bar longer than this many times the median of its panel is cut off."""
FLOOR = "Floor: bytes over bandwidth or ray-triangle tests over rate, and launches; stage by stage in frame_time-stages.csv."


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Ratios to the fastest peer of each kind, with the rounds' range; bars by part of the frame; the floor; CSV."""
    frames = document.frames(folder)
    ours = frames["label"] == OURS
    found = compare.ratios(frames, ours).drop(columns="frames")
    found = found.rename(columns={"ratio": "times_slower", "spread": "times_slower_spread"})
    stages, table = _floor.stages(frames[ours], _floor.ray_grids), document.named(frames).join(found)
    table = table.join(_floor.of_frames(stages), on=_floor.SCENE)
    table["kind"], table["other"] = table["label"].map(KINDS), table["label"] != OURS
    done = document.measured(table)
    own, peers, files = done[~done["other"]], fastest(done), []
    if len(stages):
        files.append(document.write_csv(stages, folder / "frame_time-stages.csv", _floor.COLUMNS))
    if len(own):
        rows = done.assign(text=[beside(row) for row in done.to_dict("records")])
        rows = document.arranged(rows.sort_values("other", kind="stable"), "title", done["title"].unique())
        wrong = f"{style.WRONG} n: n wrong pixels and shadow bits" * bool((done["true_errors"] > 0).any())
        across = 1 if done["title"].nunique() <= 3 else 2
        files.append(panels.bars(
            folder / "frame_time.svg", rows, facet="title", across=across, cut=CUT, room=1.75, legend=3 * across,
            below=f"{panels.WHOLE}\n2.0x: twice the time of {OURS}\n{wrong}",
        ))  # fmt: skip
    told = [
        f"A frame of {OURS} at {document.where(rows).split(' on ')[0]}, everything rebuilt, takes "
        f"{document.span(rows['total_ms'], rows['spread'])} ms; over that the fastest peer that "
        f"{document.ranked(peers[peers['pixels'] == pixels], 'times_slower', 'kind')}"
        for pixels, rows in own.groupby("pixels")
    ]
    finding = ". ".join(told or [f"{OURS} was not measured"]) + "."
    tables = {f"Frame time of the fastest peer over that of {OURS}": against(own, peers)}
    notes = [FLOOR] * bool(own["frame_floor_ms"].notna().any())
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, files, quiet, notes)


def fastest(done: document.DataFrame) -> document.DataFrame:
    """The fastest peer of each kind, and of the exact ones of it, on each scene and size, over the frames in common."""
    import pandas as pd

    every = done[done["kind"].notna() & done["times_slower"].notna()]
    exact = every[(every["known_inexact"] == "") & (every["label"] != _rivals.RASTERISED.label)]
    peers = pd.concat([every, exact.assign(kind=exact["kind"] + ", exact")], ignore_index=True)
    return peers.loc[peers.groupby(["kind", "title"], sort=False)["times_slower"].idxmin()]


def against(own: document.DataFrame, peers: document.DataFrame) -> document.DataFrame:
    """One row per scene: our time, the fastest peer of each kind with the ratio's range, and our time over the floor."""
    import pandas as pd

    own = own.set_index("title", drop=False)
    made = own[["title", "ms"]].set_axis(["scene", f"{OURS}, ms"], axis=1)
    times = document.carry(peers["times_slower"], peers["times_slower_spread"])
    ranges = [f" ({r.low:.2f} to {r.high:.2f}; {r.label})" for r in peers.itertuples()]
    told = times + pd.Series(ranges, peers.index, dtype="str")
    for kind, cells in peers.assign(text=told).groupby("kind", sort=False):
        made[f"fastest that {kind}"] = cells.set_index("title")["text"]
    if own["frame_floor_ms"].notna().any():
        floor = own["frame_floor_ms"].map("{:.3f}".format, na_action="ignore")
        made["floor, ms (times)"] = floor + (own["total_ms"] / own["frame_floor_ms"]).map(" ({:.1f})".format)
    return made


def beside(row: dict[str, Any]) -> str:
    """The text at a bar's end: its time and its time over ours, with the digits that they carry, and wrong answers."""
    text = f"{row['ms']} ms"
    if row["label"] != OURS and row["times_slower"] == row["times_slower"]:
        text += f", {document.carried(row['times_slower'], row['times_slower_spread'])}x"
    return text if row["error"] == style.OK else f"{text}  {row['error'].removesuffix(' wrong')}"


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
