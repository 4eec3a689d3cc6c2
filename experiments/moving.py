"""A moving light, one turn about the scene: over each animated scene and over those that stand still.

The animated ones come first: a run that is stopped has them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..harness.frame.passes import PARTS
from ..harness.report import document, panels, style
from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import METHOD, SCENES

if TYPE_CHECKING:
    import pandas as pd

METHODS = (Entry(METHOD, {}, "perspective + spherical"), Entry("ray_grids"), Entry("warp_bvh"))
ANIMATED = ("fairy", "bunny_dragon", "cloth")
STATIC = tuple(scene for scene in SCENES if scene not in ANIMATED)


def turn(places: int) -> tuple[Lighting, ...]:
    """One turn, at so many places over a scene that stands still, over all frames of one that does not."""
    return (Lighting("one turn", turns=1.0, frames=places),)


WORK = {
    "tests_a_shadow_ray": "shadow tests a hundred rays",
    "tiles_with_rays": "light 0 tiles with rays",
    "most_rays_in_a_tile": "light 0 most rays in a tile",
    "longest_list": "light 0 list, longest",
    "pairs_of_the_light": "light 0 pairs",
}
"""What explains a slow place: its column in the CSV, and the work counter."""

PART_MS = {f"frame_{part.replace(' ', '_')}_ms": part for part in PARTS}
COLUMNS = [
    *document.COMMON, "frame", "turn", "frame_ms", "frame_iqr_ms", "frame_true_errors", *PART_MS, *WORK,
]  # fmt: skip
LINE = ["title", "label"]
PAPER_SAYS = (
    "The paper moves its lights too, and says that everything is rebuilt each frame; it shows no path."
)


def read(folder: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The points, animated scenes first, and a row a frame of each: the light's place in turns, its time and its work.

    A point that was not measured has one row without a time.
    """
    frames = document.frames(folder)
    table = document.arranged(document.complete(document.named(frames)), "scene", (*ANIMATED, *STATIC))
    own = {"frame_ms": "total_ms", "frame_iqr_ms": "iqr_ms", "frame_true_errors": "true_errors"}
    own |= {name: name.removeprefix("frame_") for name in PART_MS}
    own |= {name: f"counter.{counter}" for name, counter in WORK.items()}
    timed = frames.reindex(columns=["key", "frame", *own.values()]).set_axis(["key", "frame", *own], axis=1)
    path = table.merge(timed, on="key", how="left")
    path["tests_a_shadow_ray"] /= 100
    last = (path["frame_count"].fillna(1) - 1).clip(lower=1)
    path["turn"] = (path["frame"] / last * path["light_turns"].fillna(0.0)).astype(float)
    path["whisker"] = path["frame_iqr_ms"] / 2
    path["wrong"] = path["frame_true_errors"].fillna(0) > 0
    return table, path


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time of each frame along the path, and CSV with the work of each."""
    table, path = read(folder)
    known = path[path["frame_ms"].notna()]
    pictures, tables, finding = [], {}, "Nothing was measured."
    if len(known):
        tables = {"Milliseconds along the path": ranges(path, known)}
        times = known.groupby(LINE, sort=False)["frame_ms"]
        most = (times.max() / times.min() - 1).groupby("label", sort=False).max().sort_values()
        told = ", ".join(f"{share:+.0%} ({label})" for label, share in most.items())
        finding = f"Slowest place of the light over the fastest, at most over {known['title'].nunique()} scenes: {told}."
        pictures = [panels.lines(
            folder / "moving.svg", path, "turn", "frame_ms", facet="title", across=min(2, path["title"].nunique()),
            whisker="whisker", wrong="wrong", log_y=False, high=1.25, below="turns of the light about the scene",
            left="ms per frame, everything rebuilt", sharex=True,
        )]  # fmt: skip
    about = finding, tables, pictures, quiet, [PAPER_SAYS]
    return document.write(folder, EXPERIMENT, table, COLUMNS, *about, rows=path)


def ranges(path: pd.DataFrame, known: pd.DataFrame) -> pd.DataFrame:
    """A row a scene and method: the range of the times along the path and where the slowest is, or why there is none."""
    import pandas as pd

    paths = known.groupby(LINE, sort=False)
    times = paths["frame_ms"]
    slow, fast = (known.loc[rows].set_index(LINE) for rows in (times.idxmax(), times.idxmin()))
    every = path.drop_duplicates(LINE).set_index(LINE)
    places, left_out = times.size().astype(str), slow["frames_left_out"]
    planned = (times.size() + left_out).astype(str)
    made = pd.DataFrame({
        "places": places.where(left_out == 0, places + " of " + planned),
        "fastest": document.carry(fast["frame_ms"], fast["whisker"]), "median": times.median().map(style.number),
        "slowest": document.carry(slow["frame_ms"], slow["whisker"]), "at turn": slow["turn"].map("{:.2f}".format),
        "slowest over fastest": (slow["frame_ms"] / fast["frame_ms"] - 1).map("{:+.0%}".format),
        "frames with wrong answers": paths["wrong"].sum(),
    }).reindex(every.index)  # fmt: skip
    made["places"] = made["places"].fillna(every["status"])
    return made.rename_axis(["scene", "method"]).reset_index()


EXPERIMENT = Experiment(
    name="moving",
    title="A moving light: time of each frame along its path",
    presets={
        "quick": Preset(
            128, 128, (*ANIMATED, "conference"), METHODS, frames=8, samples=3, most=3, stage_samples=1, rounds=1,
            budget_s=10.0, lightings=turn(8),
        ),
        "paper": Preset(
            1024, 1024, (*ANIMATED, *STATIC), METHODS, frames=12, samples=10, most=10, stage_samples=1, rounds=2,
            budget_s=20.0, timeout_s=600.0, lightings=turn(12),
        ),
    },
    draw=draw,
)  # fmt: skip
