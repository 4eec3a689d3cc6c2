"""The whole frame, everything rebuilt, of our fastest method against every peer in its best configuration.

All are interleaved in one run. Rebuild peers make their tree anew each frame, as the paper's table does; refit peers
keep the tree of the first frame and only refit its boxes, which is less than is asked of the others.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..harness.report import compare, document, panels, roofline, style
from ..harness.runner.experiment import Entry, Experiment, Preset
from . import _rivals
from ._paper import SCENES, faithful
from ._work import ray_grids

if TYPE_CHECKING:
    import pandas as pd

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
    **dict.fromkeys([entry.label for entry in REBUILD], "that rebuilds its tree"),
    **dict.fromkeys([entry.label for entry in REFIT], "that refits its tree"),
    **dict.fromkeys(["cubql refitted", "SAH refitted", "LBVH refitted"], "that refits its tree"),
}
"""What a peer does with its tree in each frame, by label; the last three are in earlier records alone."""
CUT = 4.0
"""So many times the median of its panel a bar is cut off: a much slower method would leave the others no room."""


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Ratios to the fastest peer of each kind, with the rounds' range; bars by part of the frame; the floor; CSV."""
    frames = document.frames(folder)
    table, ours = document.named(frames), frames["label"] == OURS
    found = compare.ratios(frames, ours).drop(columns=["spread", "frames"])
    table = table.join(found, on="key").rename(columns={"ratio": "times_slower"})
    files = [document.write_csv(table, folder / "frame_time.csv", COLUMNS)]
    stages = roofline.stages(frames[ours], ray_grids)
    floors = roofline.of_frames(stages)
    table = table.join(floors, on=roofline.SCENE).assign(kind=table["label"].map(KINDS))
    if len(stages):
        files.append(document.write_csv(stages, folder / "frame_time-stages.csv", roofline.COLUMNS))
    done = document.measured(table)
    if OURS in set(done["label"]):
        files.append(picture(done, folder / "frame_time.svg"))
    own, peers = done[done["label"] == OURS], fastest(done)
    heading = f"Frame time of the fastest peer over that of {OURS}, and its range over the rounds"
    notes = ["Floor: bytes over bandwidth or ray-triangle tests over rate, and launches. Farthest from theirs, mean of the "
             f"scenes: {farthest(stages, floors)}."] if len(floors) else []  # fmt: skip
    told = [finding(rows, peers[peers["pixels"] == size], own["pixels"].nunique() > 1)
            for size, rows in own.groupby("pixels")]  # fmt: skip
    return document.write(
        folder, "frame_time", EXPERIMENT.title, " ".join(told) or f"{OURS} was not measured.",
        {heading: against(own, peers)}, files, table, quiet, notes,
    )  # fmt: skip


def fastest(done: pd.DataFrame) -> pd.DataFrame:
    """The fastest peer of each kind on each scene and size, over the frames that it has in common with ours.

    Of each kind all peers, and those apart that call themselves exact.
    """
    import pandas as pd

    every = done[done["kind"].notna() & done["times_slower"].notna()]
    exact = every[every["known_inexact"] == ""]
    peers = pd.concat([every, exact.assign(kind=exact["kind"] + ", exact")], ignore_index=True)
    return peers.loc[peers.groupby(["kind", "title"], sort=False)["times_slower"].idxmin()]


def finding(own: pd.DataFrame, peers: pd.DataFrame, several: bool) -> str:
    """At one image size, named where there are ``several``: our times, and how much slower the fastest peers are."""
    size = f"At {own['width'].iloc[0]}x{own['height'].iloc[0]}, a" if several else "A"
    text = f"{size} frame of {OURS}, everything rebuilt, takes {document.span(own['total_ms'])} ms"
    for kind, ratio in peers.groupby("kind", sort=False)["times_slower"]:
        text += f"; the fastest peer {kind} {document.span(ratio, '{:.2f}'.format)} times that"
        text += f" (geometric mean {compare.geometric(ratio):.2f})"
    return text + "."


def against(own: pd.DataFrame, peers: pd.DataFrame) -> pd.DataFrame:
    """A row a scene: our time, the fastest peer of each kind and its ratio with the range, and our time over the floor."""
    made = own[["title"]].set_axis(["scene"], axis=1)
    made[f"{OURS}, ms"] = document.carry(own["total_ms"], own["spread"])
    texts = [f"{r.times_slower:.2f} ({r.low:.2f} to {r.high:.2f}; {r.label})" for r in peers.itertuples()]
    best = document.cross_table(
        peers.assign(text=texts, heading="fastest " + peers["kind"]), ["title"], "heading", "text"
    )
    made = made.merge(best.rename(columns={"title": "scene"}), how="left", on="scene")
    floor = own["frame_floor_ms"].to_numpy()
    if own["frame_floor_ms"].notna().any():
        made["floor, ms"] = [f"{ms:.3f}" if ms == ms else None for ms in floor]
        made["times the floor"] = [f"{ms:.1f}" if ms == ms else None for ms in own["total_ms"] / floor]
    return made


def farthest(stages: pd.DataFrame, floors: pd.Series) -> str:
    """The three stages that lose most milliseconds to their floors, mean of the scenes with a floor."""
    known = stages.join(floors, on=roofline.SCENE, how="inner")
    lost = (known["ms"] - known["floor_ms"]).groupby(known["stage"]).sum() / max(1, len(floors))
    return ", ".join(f"{stage} by {ms:.3f} ms" for stage, ms in lost.nlargest(3).items())


def picture(done: pd.DataFrame, path: Path) -> Path:
    """A panel a scene and size, stacked bars by part of the frame: beside each its time, its time over ours, and wrong
    answers.
    """
    labels = [OURS, *(label for label in done["label"].unique() if label != OURS)]
    rows = done.assign(text=[beside(row) for row in done.to_dict("records")])
    places = {title: i for i, title in enumerate(rows["title"].unique())}
    rows = rows.sort_values(
        ["title", "label"], key=lambda c: c.map(places if c.name == "title" else labels.index)
    )
    across = 1 if len(places) <= 3 else 2
    down = -(-len(places) // across)
    size = (style.COLUMN_WIDTH * (0.35 + 0.65 * across), (0.125 * len(labels) + 0.28) * down + 1.0)
    tints = {method: panels.part_tints(style.look(method)["color"]) for method in rows["method"]}
    with panels.bar_panels(path, rows, size, facet="title", across=across, tints=tints, cut=CUT, room=1.5, font=5.5,
                           legend=3 * across) as (figure, cells):  # fmt: skip
        panels.name_parts(cells[0][0])
        for axes, own in cells:
            floor = own["frame_floor_ms"].iloc[0]
            if own["label"].iloc[0] == OURS and floor == floor:
                axes.plot(floor, -0.42, "v", color="black", ms=3.5, label=f"floor of {OURS}", clip_on=False)
        wrong = f"{style.WRONG} n: n wrong pixels and visibility bits" * bool((done["true_errors"] > 0).any())
        panels.caption(figure, panels.WHOLE, f"2.0x: twice the time of {OURS}", wrong)
    return path


def beside(row: dict[str, Any]) -> str:
    """What stands at a bar's end: three digits of its time, its time over ours, and what is wrong of its answers."""
    text = f"{style.number(row['total_ms'])} ms"
    if row["label"] != OURS and row["times_slower"] == row["times_slower"]:
        text += f", {style.number(row['times_slower'])}x"
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
