"""The cost of each effect, alone and together, and of a frame by what has moved."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..harness.report import compare, document, numbers, panels, sentences
from ..harness.runner.planning.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import MOVED, Lighting
from ._paper import METHOD

METHODS = (
    Entry(METHOD, {}, "the paper's grids"),
    Entry(METHOD, {"clamp": "scene"}, "the same, clamped to the scene"),
    Entry("ray_grids", {}, "ray grids"),
    Entry("ray_grids", {"closed": "false"}, "ray grids, closed surfaces whole"),
    Entry("bvh2", {}, "BVH2 rebuilt"),
    Entry("uniform_grid", {}, "uniform grid"),
    Entry("warp_bvh", {}, "mesh rebuilt"),
    Entry("warp_bvh", {"update": "bvh_rebuild"}, "LBVH rebuilt in a graph"),
    Entry("embree", {}, "Embree"),
)

BASE = "one light"
SPOT, NARROW, WIDE = 20.0, 10.0, 40.0
"""Half-angles of spots, degrees."""

EFFECTS = (
    Lighting("no shadows", count=1, shadows=False),
    Lighting(BASE, count=1),
    Lighting("two lights", count=2),
    Lighting("a narrow spot", count=1, spot=NARROW),
    Lighting("a spot", count=1, spot=SPOT),
    Lighting("a wide spot", count=1, spot=WIDE),
    Lighting("facing only", count=1, facing=True),
    Lighting("directional", count=1, directional=True),
    Lighting("alpha", count=1, alpha=4),
    Lighting("mirror", count=1, bounces=1),
    Lighting("shaded", count=1, color=True),
    Lighting("spot, facing, two", count=2, spot=SPOT, facing=True),
)
"""Each effect alone against one point light with shadows, then together."""

PLAIN = 8
"""Number of them that need only lights; the others are measured last, because their reference takes longest."""

CHANGES = tuple(Lighting(f"moved {what}", count=1, moved=what) for what in MOVED)
LIGHTINGS = (*EFFECTS[:PLAIN], *CHANGES, *EFFECTS[PLAIN:])

COLUMNS = [
    *document.COMMON, "moved", "ratio", "added_ms", "added_iqr_ms", "pass_count", "build_count", "memory_bytes", "compile_s",
]  # fmt: skip
ORDER = [lighting.label for lighting in (*EFFECTS, *CHANGES)]
ABOUT = (
    "The same frame was measured again, as the one in which all moved: its difference from the first counts as noise of "
    "every effect, beside the spread of the repeats. In brackets: passes that build structures. A method that knows no "
    "parts of a mesh rebuilds all of it. "
    f"A spot has a half-angle of {SPOT:g} degrees, a narrow one {NARROW:g}, a wide one {WIDE:g}."
)


def read(folder: Path) -> document.DataFrame:
    """The points, effects in their order, with what each adds to the frame :data:`BASE` of the same method and scene.

    ratio_spread  half the spread of the two, or how far the base frame was from its own repetition, over the base frame
    """
    frames = document.frames(folder)
    table = document.named(frames)
    same = (*compare.SCENE, *compare.SIZE, "label")
    own, base = compare.pairs(frames, frames["light_label"] == BASE, same)
    _, again = compare.pairs(frames, frames["moved"] == "all", same)
    table["ratio"] = own["total_ms"] / base["total_ms"]
    table["added_ms"] = own["total_ms"] - base["total_ms"]
    table["added_iqr_ms"] = np.hypot(compare.spread(own), compare.spread(base))
    noise = np.fmax(table["added_iqr_ms"], (again["total_ms"] - base["total_ms"]).abs())
    table["ratio_spread"] = noise / base["total_ms"]
    return document.arranged(table, "light_label", ORDER)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Each effect over the plain frame, a frame by what moved, two tables and CSV."""
    table = read(folder)
    done = document.arranged(document.measured(table), "title", table["title"].unique())
    effects, moved = done[(done["moved"] == "") & done["ratio"].notna()], done[done["moved"] != ""]
    alone = effects[effects["light_label"] != BASE]
    pictures = [panels.dots(
        folder / "effects.svg", alone, "light_label", "ratio", "label", facet="title", whisker="ratio_spread",
        legend=3, below=f"frame time over that of {BASE} (bars: noise)",
    )] if len(effects) else []  # fmt: skip
    if len(moved):
        seen, kinds = moved[moved["pass_count"] > 0], list(MOVED)
        idle = "" if "nothing" in set(seen["moved"]) else " (nothing moved: no kernel is launched)"
        pictures.append(panels.lines(
            folder / "effects-moved.svg", seen.assign(place=seen["moved"].map(kinds.index)), "place", "total_ms",
            facet="title", across=moved["title"].nunique(), whisker="spread", drawn=panels.looks(moved), wide=1.2,
            sharey=True, ticks=kinds.__getitem__, below="what moved since the last frame" + idle, left="ms per frame",
        ))  # fmt: skip
    shown = numbers.carry(effects["ratio"], effects["ratio_spread"])
    effects = effects.assign(text=shown.where(effects["light_label"] != BASE, effects["ms"] + " ms"))
    text = moved["ms"] + " (" + moved["build_count"].astype(str) + ")"
    moved = moved.assign(text=text.where(moved["pass_count"] > 0, "no launch"))
    heading = f"Frame time over that of {BASE}, everything rebuilt"
    rows = {"title": "scene", "light_label": "effect", "label": "method"}
    tables = {
        heading: document.cross_table(effects, ["title", "light_label"], "label", "text"),
        "A frame by what alone moved, ms": document.cross_table(moved, ["title", "label"], "moved", "text"),
    }
    tables = {name: table.rename(columns=rows) for name, table in tables.items()}
    finding = sentences.ends(
        alone, "ratio", "light_label", f"Over a frame of {BASE}, one with {{}} takes the least, {{}} times as long",
        ", and one with {} the most, {} (geometric means over methods and scenes)", f"No effect was measured beside {BASE}",
    ) + "."  # fmt: skip
    notes = [*compare.in_sequence(document.frames(folder)), ABOUT]
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, pictures, quiet, notes)


EXPERIMENT = Experiment(
    name="effects",
    title="Effects: what each costs, and a frame by what moved",
    presets={
        "quick": Preset(
            128, 128, ("cloth",), METHODS, frames=1, samples=3, most=3, stage_samples=1, rounds=1, budget_s=3.0,
            lightings=LIGHTINGS,
        ),
        "paper": Preset(
            1024, 1024, ("fairy", "conference"), METHODS, frames=1, samples=5, most=20, deviation=0.005,
            stage_samples=2, rounds=9, budget_s=4.5, timeout_s=600.0, lightings=LIGHTINGS,
        ),
    },
    draw=draw,
)  # fmt: skip
