"""Only what a scene calls for: the cost of each effect, alone and together, and of a frame by what moved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..harness.report import compare, document, panels, style
from ..harness.report.dots import dots
from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import MOVED, Lighting
from ._paper import METHOD

if TYPE_CHECKING:
    import pandas as pd

METHODS = (
    Entry(METHOD, {}, "perspective + spherical"),
    Entry(METHOD, {"clamp": "scene"}, "the same, clamped to the scene"),
    Entry("ray_grids"),
    Entry("uniform_grid"),
    Entry("warp_bvh"),
    Entry("warp_bvh", {"update": "bvh_rebuild"}, "BVH rebuilt in place, exact"),
    Entry("embree"),
)

BASE = "one light"
SPOT = 20.0

EFFECTS = (
    Lighting("no shadows", count=1, shadows=False),
    Lighting(BASE, count=1),
    Lighting("two lights", count=2),
    Lighting("a spot", count=1, spot=SPOT),
    Lighting("facing only", count=1, facing=True),
    Lighting("directional", count=1, directional=True),
    Lighting("alpha", count=1, alpha=4),
    Lighting("mirror", count=1, bounces=1),
    Lighting("shaded", count=1, color=True),
    Lighting("spot, facing, two", count=2, spot=SPOT, facing=True),
)
"""Each effect alone against one point light with shadows, then together."""

PLAIN = 6
"""So many of them ask for nothing but lights; the others are measured last, since their truth takes longest."""

CHANGES = tuple(Lighting(f"moved {what}", count=1, moved=what) for what in MOVED)
LIGHTINGS = (*EFFECTS[:PLAIN], *CHANGES, *EFFECTS[PLAIN:])


COLUMNS = [
    *document.COMMON, "moved", "ratio", "added_ms", "added_iqr_ms", "passes", "builds", "memory_bytes", "compile_s",
]  # fmt: skip
ORDER = [lighting.label for lighting in (*EFFECTS, *CHANGES)]
NEVER = 1e-3
"""Milliseconds below which a frame did nothing."""
ABOUT = (
    "Effects are measured one after another, not interleaved. The same frame was measured once more, as the one in which "
    "all moved: its difference from the first counts as noise of every effect, beside the spread of the repeats."
)
ABOUT_MOVED = (
    "In brackets: passes that build structures. A method that knows no parts of a mesh rebuilds all of it."
)


def read(folder: Path) -> pd.DataFrame:
    """The points, effects in their order, with what each adds to the frame :data:`BASE` of the same method and scene.

    added_iqr_ms  half the spread of the two, as one reads an error bar; noise_ms: or how far the base frame was from its
    own repetition, where that is more
    """
    frames = document.frames(folder)
    table = document.named(frames)
    table["passes"], table["builds"] = table["pass_count"], table["build_count"]
    rank = {label: i for i, label in enumerate(ORDER)}
    table = table.sort_values("light_label", key=lambda s: s.map(rank).fillna(len(rank)), kind="stable")
    same = (*compare.SCENE, *compare.SIZE, "label")
    own, base = compare.pairs(frames, frames["light_label"] == BASE, same)
    _, again = compare.pairs(frames, frames["moved"] == "all", same)
    found = compare.ratios(frames, frames["light_label"] == BASE, same)
    table["ratio"] = table["key"].map(found["ratio"])
    table["added_ms"] = table["key"].map(own["total_ms"] - base["total_ms"])
    table["added_iqr_ms"] = table["key"].map(np.hypot(compare.spread(own), compare.spread(base)))
    table["again_ms"] = table["key"].map(again["total_ms"])
    apart = table["key"].map((again["total_ms"] - base["total_ms"]).abs())
    table["noise_ms"] = np.fmax(table["added_iqr_ms"], apart)
    return table


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Two drawings and CSV."""
    table = read(folder)
    files = [document.write_csv(table, folder / "effects.csv", COLUMNS)]
    done = document.measured(table)
    effects, moved = done[(done["moved"] == "") & done["ratio"].notna()], done[done["moved"] != ""]
    adds, moves = (
        f"what each effect adds to the frame of {BASE}, ms (times its time)",
        "a frame by what alone moved, ms",
    )
    tables = {f"{title}: {adds}": effects_table(own) for title, own in effects.groupby("title", sort=False)}
    tables |= {f"{title}: {moves}": moved_table(own) for title, own in moved.groupby("title", sort=False)}
    if len(effects):
        below = f"frame time over that of {BASE} (bars: noise)"
        own = effects[effects["light_label"] != BASE].assign(
            noise=effects["noise_ms"] / (effects["total_ms"] - effects["added_ms"])
        )
        path = folder / "effects.svg"
        dots(
            path, own, "light_label", "ratio", "label", below=below, facet="title", whisker="noise", legend=3
        )
        files.append(path)
    if len(moved):
        files.append(moved_picture(moved, folder / "effects-moved.svg"))
    notes = [ABOUT] * bool(len(effects)) + [ABOUT_MOVED] * bool(len(moved))
    return document.write(
        folder, "effects", EXPERIMENT.title, finding(effects), tables, files, table, quiet, notes
    )


def finding(effects: pd.DataFrame) -> str:
    """The effects that cost most and least, over all methods and scenes."""
    means = effects[effects["light_label"] != BASE].groupby("light_label")["ratio"].agg(compare.geometric)
    if means.empty:
        return f"No effect was measured beside {BASE}."
    return (
        f"Over the frame of {BASE}, everything rebuilt, the dearest is {means.idxmax()} (x{means.max():.2f}) and the "
        f"cheapest {means.idxmin()} (x{means.min():.2f}): geometric means over methods and scenes."
    )


def effects_table(own: pd.DataFrame) -> pd.DataFrame:
    """Effects down, methods across; the frame that they are added to first, and its repetition."""
    import pandas as pd

    ratio = document.carry(own["ratio"], own["noise_ms"] * own["ratio"] / own["total_ms"]).str.strip(
        document.NOISY
    )
    added = document.carry(own["added_ms"], own["noise_ms"], "+") + " (x" + ratio + ")"
    base = own["light_label"] == BASE
    first = own[base].assign(
        light_label=f"{BASE}, ms", text=document.carry(own["total_ms"], own["spread"])[base]
    )
    again = first.assign(light_label="the same, once more, ms", text=first["again_ms"].map(style.number))
    rows = pd.concat([first, again, own[~base].assign(text=added[~base])])
    return document.cross_table(rows, {"light_label": "effect"}, "label", "text")


def moved_table(own: pd.DataFrame) -> pd.DataFrame:
    """Methods down, what moved across; beside the time how many passes build structures."""
    text = document.carry(own["total_ms"], own["spread"]) + " (" + own["builds"].astype(str) + ")"
    wide = document.cross_table(
        own.assign(text=text.where(own["passes"] > 0, "no launch")), {"label": "method"}, "moved", "text"
    )
    return wide[["method", *(what for what in MOVED if what in wide)]]


def moved_picture(moved: pd.DataFrame, path: Path) -> Path:
    """Time of a frame against what moved, a line a method; a panel a scene. Nothing moved: nothing is launched."""
    kinds = [x for x in MOVED if moved.loc[moved["moved"] == x, "passes"].any()]
    seen = moved[moved["moved"].isin(kinds) & (moved["total_ms"] > NEVER)]
    seen = seen.assign(place=seen["moved"].map(kinds.index), half=seen["iqr_ms"] / 2).sort_values(
        "place", kind="stable"
    )
    scenes = moved["title"].nunique()
    size = (style.COLUMN_WIDTH * max(1.0, 0.25 + 0.6 * scenes), 2.7)
    look = {
        "facet": "title",
        "across": scenes,
        "whisker": "half",
        "drawn": panels.looks(moved),
        "sharey": True,
    }
    with panels.lines(path, seen, "place", "total_ms", size, legend=2 + (scenes > 1), **look) as (
        figure,
        places,
    ):
        for axes, _ in places:
            style.plain_log(axes)
            axes.set_xticks(range(len(kinds)), kinds)
            axes.set_xlim(-0.3, len(kinds) - 0.7)
        places[0][0].set_ylabel("ms per frame")
        idle = not moved.loc[moved["moved"] == "nothing", "passes"].any()
        figure.supxlabel(
            "what moved since the last frame" + "\n(nothing moved: no kernel is launched)" * idle, fontsize=8
        )
    return path


EXPERIMENT = Experiment(
    name="effects",
    title="Effects: what each costs, and a frame by what moved",
    presets={
        "quick": Preset(
            128, 128, ("cloth",), METHODS, frames=1, samples=3, most=3, stage_samples=1, rounds=1, budget_s=3.0,
            lightings=LIGHTINGS,
        ),
        "paper": Preset(
            1024, 1024, ("fairy", "conference"), METHODS, frames=2, samples=10, most=20, deviation=0.005,
            stage_samples=3, rounds=2, budget_s=4.0, timeout_s=600.0, lightings=LIGHTINGS,
        ),
    },
    draw=draw,
)  # fmt: skip
