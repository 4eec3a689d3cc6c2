"""A moving light, one turn about the scene: over each animated scene and over those that stand still.

The animated ones come first: a run that is stopped has them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..harness.frame.passes import PARTS
from ..harness.report import document, panels, style
from ..harness.results import tidy
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


SPIKE = 1.5
"""A place is slow where its frame takes so many times the median of the path: a table says what was done there."""

WORK = {
    "tests a shadow ray": "shadow tests a hundred rays",
    "tiles with rays": "light 0 tiles with rays",
    "most rays in a tile": "light 0 most rays in a tile",
    "longest list": "light 0 list, longest",
    "pairs of the light": "light 0 pairs",
}
"""What explains a slow place: what it is called, and the work counter."""

PART_MS = {part: f"frame_{part.replace(' ', '_')}_ms" for part in PARTS}
COLUMNS = [
    *document.COMMON, "frame", "turn", "frame_ms", "frame_iqr_ms", "frame_true_errors", *PART_MS.values(),
    *(name.replace(" ", "_") for name in WORK),
]  # fmt: skip


def steps(folder: Path, done: pd.DataFrame) -> pd.DataFrame:
    """A row a measured frame of the points: the light's place on its path in turns, the frame's median time, its work."""
    own = {"total_ms": "frame_ms", "iqr_ms": "frame_iqr_ms", "true_errors": "frame_true_errors"}
    own |= {name.removeprefix("frame_"): name for name in PART_MS.values()}
    own |= {f"counter.{counter}": name.replace(" ", "_") for name, counter in WORK.items()}
    path = done.merge(tidy(folder).reindex(columns=["key", "frame", *own]).rename(columns=own), on="key")
    path["tests_a_shadow_ray"] /= 100
    last = (path["frame_count"].fillna(1) - 1).clip(lower=1)
    path["turn"] = (path["frame"] / last * path["light_turns"].fillna(0.0)).astype(float)
    return path


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time of each frame along the path, CSV, and what the slowest frames did more of than others."""
    import pandas as pd

    table = document.read(folder)
    rank = {scene: i for i, scene in enumerate((*ANIMATED, *STATIC))}
    table = table.sort_values("scene", key=lambda s: s.map(rank).fillna(len(rank)), kind="stable")
    done = document.measured(table)
    path = steps(folder, done)
    files = [document.write_csv(path, folder / "moving.csv", COLUMNS)]
    if path.empty:
        return document.write(
            folder, "moving", EXPERIMENT.title, "Nothing was measured.", {}, files, table, quiet
        )
    files.append(picture(path, folder / "moving.svg"))
    lines = path.groupby(["title", "label"], sort=False)
    ranges = pd.DataFrame([line_range(title, label, own) for (title, label), own in lines])
    slow = pd.DataFrame([line for (title, label), own in lines for line in slow_place(title, label, own)])
    tables = {
        "Milliseconds along the path": ranges,
        f"Places that take over {SPIKE:g} times the median of their path": slow,
    }
    notes = [
        "The paper moves its lights too, and says that everything is rebuilt each frame; it shows no path."
    ]
    return document.write(
        folder, "moving", EXPERIMENT.title, finding(path), tables, files, table, quiet, notes
    )


def finding(path: pd.DataFrame) -> str:
    """Which method's time depends least on where the light is, and which most."""
    times = path.groupby(["title", "label"], sort=False)["frame_ms"]
    most = (times.max() / times.min() - 1).groupby("label", sort=False).max().sort_values()
    told = ", ".join(f"{share:+.0%} ({label})" for label, share in most.items())
    return (
        f"Slowest place of the light over the fastest, at most over {path['title'].nunique()} scenes: {told}."
    )


def line_range(title: str, label: str, own: pd.DataFrame) -> dict[str, Any]:
    """The range of the times along a path, and where the slowest is."""
    slow, fast = (own.loc[i()] for i in (own["frame_ms"].idxmax, own["frame_ms"].idxmin))
    planned = len(own) + own["frames_left_out"].iloc[0]
    return {
        "scene": title, "method": label, "places": f"{len(own)} of {planned}" if planned > len(own) else str(len(own)),
        "fastest": document.carried(fast["frame_ms"], fast["frame_iqr_ms"] / 2),
        "median": style.number(own["frame_ms"].median()),
        "slowest": document.carried(slow["frame_ms"], slow["frame_iqr_ms"] / 2), "at turn": f"{slow['turn']:.2f}",
        "slowest over fastest": f"{slow['frame_ms'] / fast['frame_ms'] - 1:+.0%}",
        "frames with wrong answers": int((own["frame_true_errors"].fillna(0) > 0).sum()),
    }  # fmt: skip


def slow_place(title: str, label: str, own: pd.DataFrame) -> list[dict[str, str]]:
    """What was done more at the slowest place of a path, beside the median over its places; nothing where none is slow."""
    slow, usual = own.loc[own["frame_ms"].idxmax()], own.median(numeric_only=True)
    if slow["frame_ms"] < SPIKE * usual["frame_ms"]:
        return []
    part = max(PART_MS, key=lambda name: slow[PART_MS[name]] - usual[PART_MS[name]])
    ms = f"{style.number(slow[PART_MS[part]])} ({style.number(usual[PART_MS[part]])})"
    counted = dict.fromkeys(WORK, "not counted")
    for name, key in ((name, name.replace(" ", "_")) for name in WORK):
        if own[key].notna().all():
            counted[name] = f"{slow[key]:,.0f} ({usual[key]:,.0f})"
    first = {"scene": title, "method": label, "at turn": f"{slow['turn']:.2f}", "slowest part": part}
    return [{**first, "its ms there (median)": ms, **counted}]


def picture(path: pd.DataFrame, file: Path) -> Path:
    """One panel a scene; whiskers are the interquartile range of repeats."""
    scenes = path["title"].unique()
    looks = panels.looks(path)
    across = min(2, len(scenes))
    down = -(-len(scenes) // 2)
    size = (style.COLUMN_WIDTH, 1.25 * down + 0.9)
    with panels.sheet(file, size, down, across, sharex=True) as (figure, grid):
        for i, axes in enumerate(grid.ravel()):
            axes.set_visible(i < len(scenes))
            axes.tick_params(labelbottom=i + across >= len(scenes))  # the lowest of a column has the numbers
        for axes, (title, own) in zip(grid.ravel(), path.groupby("title", sort=False), strict=False):
            for label, line in own.groupby("label", sort=False):
                look = {**looks[label], "ms": 2.5, "elinewidth": 0.6, "label": label}
                axes.errorbar(line["turn"], line["frame_ms"], yerr=line["frame_iqr_ms"] / 2, **look)
            wrong = own[own["frame_true_errors"].fillna(0) > 0]
            if len(wrong):
                axes.plot(
                    wrong["turn"], wrong["frame_ms"], "kx", ms=5, mew=0.9, label="a frame with wrong answers"
                )
            axes.set_title(title, fontsize=6.5)
            axes.set_ylim(bottom=0)
        figure.supxlabel("turns of the light about the scene", fontsize=7)
        figure.supylabel("ms per frame, everything rebuilt", fontsize=7)
    return file


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
