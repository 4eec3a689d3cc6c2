"""The cost of each effect, alone and together, and of a frame by what has moved."""

from pathlib import Path

import numpy as np

from ..harness.report import compare, document, numbers, panels
from ..harness.report.dataframe import DataFrame
from ..harness.runner.planning.experiment import Entry, Experiment
from ..harness.scene.overrides import MOVED, Lighting
from ._paper import METHOD, large, small

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
SPOT, NARROW, WIDE = 20.0, 10.0, 40.0  # half-angles of spots, degrees

EFFECTS = (  # each effect alone against one point light with shadows, then together
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

PLAIN = 8  # number of them that need only lights; the others are measured last, because their reference takes longest

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


def read(folder: Path) -> DataFrame:
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
    alone, seen, kinds = effects[effects["light_label"] != BASE], moved[moved["pass_count"] > 0], list(MOVED)
    idle = "" if "nothing" in set(seen["moved"]) else " (nothing moved: no kernel is launched)"
    pictures = [
        panels.dots(
            folder / "effects.svg", alone, "light_label", "ratio", "label", facet="title", whisker="ratio_spread",
            legend=3, below=f"frame time over that of {BASE} (bars: noise)",
        ),
        panels.lines(
            folder / "effects-moved.svg", seen.assign(place=seen["moved"].map(kinds.index)), "place", "total_ms",
            facet="title", across=moved["title"].nunique(), whisker="spread", drawn=panels.looks(moved), wide=1.2,
            sharey=True, ticks=kinds.__getitem__, below="what moved since the last frame" + idle, left="ms per frame",
        ),
    ]  # fmt: skip
    text = numbers.texts(effects, "ratio").where(effects["light_label"] != BASE, effects["ms"] + " ms")
    text_moved = (moved["ms"] + " (" + moved["build_count"].astype(str) + ")").where(
        moved["pass_count"] > 0, "no launch"
    )
    rows = {"title": "scene", "light_label": "effect"}, {"title": "scene", "label": "method"}
    tables = {
        f"Frame time over that of {BASE}, everything rebuilt":
            document.cross_table(effects.assign(text=text), rows[0], "label", "text"),
        "A frame by what alone moved, ms": document.cross_table(moved.assign(text=text_moved), rows[1], "moved", "text"),
    }  # fmt: skip
    finding = numbers.ends(
        alone, "ratio", "light_label", f"Over a frame of {BASE}, one with {{}} takes the least, {{}} times as long",
        ", and one with {} the most, {} (geometric means over methods and scenes)", f"No effect was measured beside {BASE}",
    ) + "."  # fmt: skip
    notes = [*compare.in_sequence(document.frames(folder)), ABOUT]
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, pictures, quiet, notes)


EXPERIMENT = Experiment(
    "effects", "Effects: what each costs, and a frame by what moved",
    {
        "quick": small(128, ("cloth",), METHODS, 3.0, lightings=LIGHTINGS),
        "paper": large(("fairy", "conference"), METHODS, 4.5, lightings=LIGHTINGS),
    },
    draw,
)  # fmt: skip
