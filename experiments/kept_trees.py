"""Trees that keep: what a tree costs by the age of the frame it was made of, over animations; and when rebuilding pays.

Trees of several frames are kept through a whole animation, their boxes refitted in each frame; the same frames are measured
with a tree rebuilt in each. A new tree every n-th frame is put together from them, frame by frame, and so is the best single
tree (Bittner and Meister, "T-SAH: Animation Optimized Bounding Volume Hierarchies", 2015, ask for that). A kept tree is
made by the surface area heuristic on the host, which no time includes. Where only the light or the camera moves, a static
tree is kept without refitting.
"""

from dataclasses import replace
from pathlib import Path

from ..harness.report import compare, document, numbers, panels
from ..harness.report.dataframe import DataFrame, pd
from ..harness.runner.planning.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ..harness.texts import numbered
from . import _rivals
from ._paper import large, small

EVERY = 5  # frames from one kept tree to the next
REBUILT, FIRST = _rivals.REBUILT[0], _rivals.REFITTED[0]
KEPT = tuple(
    Entry("bvh2", {"update": "refit", "tree_frame": str(k)}, f"tree of frame {k}")
    for k in range(EVERY, 4 * EVERY, EVERY)
)
METHODS = (REBUILT, FIRST, *KEPT, _rivals.OURS)
STATIC = (REBUILT, Entry("bvh2", {"update": "static"}, "BVH2 static"), _rivals.OURS)
LIGHTINGS = (
    Lighting("1 light", count=1),
    Lighting("moved light", count=1, moved="light"),
    Lighting("moved camera", count=1, moved="camera"),
)
"""On the scene of :data:`STATIC`: a frame in which all is made anew, and those in which only the light or camera moved."""

ONE, BEST = "one tree, of the first frame", "one tree, the best"
POLICIES = {f"a new tree every {EVERY} frames": EVERY, f"a new tree every {2 * EVERY} frames": 2 * EVERY, ONE: 10**6}
"""By name, after how many frames a new tree is taken."""
SAME = [*compare.SAME, "frame"]
TIME, QUALITY = "time of the frame", "SAH cost of the tree"
COLUMNS = [*document.COMMON, "moved", "frame", "tree_frame", "age", "total_ms", "ratio", "sah_cost", "sah_ratio",
           "expected_nodes", "expected_tests", "p50_ms", "p95_ms", "p99_ms"]  # fmt: skip
ABOUT = "A kept tree is made on the host, by the surface area heuristic, before its frame: no time includes that."


def read(folder: Path) -> tuple[DataFrame, DataFrame]:
    """The points; and a row per frame: with the frame that its tree was made of, its ``age``, and ``ratio`` and
    ``sah_ratio``, time and SAH cost over those of the rebuilt tree in the same frame of the same run.
    """
    frames = document.frames(folder)
    table = document.named(frames)
    rows = frames.assign(title=frames["key"].map(table["title"]), light_count=frames["lights"], between_ms=0.0)
    rows["spread"] = compare.spread(rows)
    rows = rows.reindex(columns=[*rows, *{"set.update", "set.tree_frame"}.difference(rows)])  # of other methods alone
    made_of = pd.to_numeric(rows["set.tree_frame"]).fillna(0)
    rows["tree_frame"] = made_of.where(rows["set.update"] == "refit")
    rows["age"] = (rows["frame"] - rows["tree_frame"]).astype("float64")
    base = rows[(rows["label"] == REBUILT.label) & rows["total_ms"].notna()]
    base = base[[*SAME, "total_ms", "sah_cost", "spread"]].drop_duplicates(SAME)
    rows = rows.merge(base, on=SAME, how="left", suffixes=("", "_base"))
    return table, rows.assign(
        ratio=rows["total_ms"] / rows["total_ms_base"], sah_ratio=rows["sah_cost"] / rows["sah_cost_base"]
    )


def policies(rows: DataFrame) -> DataFrame:
    """A row per frame and way to have a tree there, ``policy``; ``rows`` of scenes that move."""
    kept = rows[rows["tree_frame"].notna()]
    old = kept[kept["age"] >= 0].sort_values("tree_frame")
    found = [rows[rows["label"] == REBUILT.label].assign(policy="rebuilt each frame")]
    for name, every in POLICIES.items():
        own = old[old["tree_frame"] % every == 0]
        found.append(own.drop_duplicates(["title", "frame"], keep="last").assign(policy=name))
    if len(kept):
        means = kept.groupby(["title", "label"])["total_ms"].mean()
        best = [label for _, label in means.groupby("title").idxmin()]
        chosen = pd.Series(best, means.index.levels[0]).reindex(kept["title"]).to_numpy()
        found.append(kept[kept["label"] == chosen].assign(policy=BEST))
    return pd.concat([*found, rows[rows["label"] == _rivals.OURS.label].assign(policy=_rivals.OURS.label)])


def summary(ways: DataFrame) -> DataFrame:
    """What each way takes over an animation: a row of texts per scene and policy."""
    groups = ways.groupby(["title", "policy"], sort=False)
    found = groups[["total_ms", "total_ms_base", "spread", "spread_base", "sah_cost"]].mean()
    ratio, around = compare.over(found["total_ms"], found["spread"], found["total_ms_base"], found["spread_base"])
    most = groups[["total_ms", "sah_cost"]].max()
    texts = {
        "ms a frame": numbers.carry(found["total_ms"], found["spread"], numbers.TIME),
        "over rebuilt": numbers.carry(ratio, around),
        "slowest frame, ms": numbers.carry(most["total_ms"], found["spread"], numbers.TIME),
        "SAH cost": numbers.carry(found["sah_cost"], ratio * 0.0), "the most": numbers.carry(most["sah_cost"], ratio * 0.0),
    }  # fmt: skip
    rows = pd.DataFrame(texts).rename_axis(["scene", "tree"]).reset_index()
    return document.arranged(rows, "scene", list(ways["title"].unique()))


def by_age(rows: DataFrame) -> DataFrame:
    """A row per scene, age and quantity: its geometric mean over the trees, as a ratio to the rebuilt tree's."""
    kept = rows[rows["age"] >= 0].rename(columns={"ratio": TIME, "sah_ratio": QUALITY})
    found = kept.melt(["title", "age", "status"], [TIME, QUALITY], "what", "times").dropna(subset="times")
    groups = found.groupby(["title", "what", "age"], sort=False)["times"]
    return groups.agg(compare.geometric).reset_index().sort_values("age").assign(status="ok")


def pays(curve: DataFrame) -> str:
    """Up to which age a kept tree takes less time than a rebuilt one, scene by scene, as a sentence; "" of none."""
    told = []
    for title, own in curve[curve["what"] == TIME].groupby("title", sort=False):
        loses = own[own["times"] >= 1.0]["age"]
        if loses.empty:
            told.append(f"{title}, at every age measured (up to {own['age'].max():.0f} frames)")
        elif loses.min() == own["age"].min():
            told.append(f"{title}, not even when it is new")
        else:
            told.append(f"{title}, until it is {numbered(int(loses.min()), 'frame')} old")
    if not told:
        return ""
    return f"A kept tree takes less time than one rebuilt each frame: {'; '.join(told)}."


def stays(frames: DataFrame, still: DataFrame) -> str:
    """How a static tree compares with one rebuilt in the same run, where the geometry does not move, by what does; "" of
    none. ``still``: the points of such scenes, indexed by their keys.
    """
    found = compare.ratios(frames, frames["label"] == REBUILT.label)
    own = still[still["label"] == STATIC[1].label].drop(columns="spread").join(found[["ratio", "spread"]], how="inner")
    told = own.assign(text=numbers.carry(own["ratio"], own["spread"]))
    said = [
        f"on {title} {numbers.listed(group['text'] + ' (' + group['what'] + ')')}"
        for title, group in told.groupby("title", sort=False)
    ]
    return f"A static tree's frame over a rebuilt one's, by what has moved: {'; '.join(said)}." if said else ""


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time and quality by the age of a tree, the ways to have one, a tree that does not move; CSV."""
    table, rows = read(folder)
    done, lightings = rows[rows["total_ms"].notna()], [lighting.label for lighting in LIGHTINGS]
    moving = done[(done["frame_count"] > 1) & (done["light_label"] == "")]
    still = document.measured(table[table["frame_count"].fillna(1) == 1])
    still = document.arranged(still, "light_label", lightings)
    still = still.assign(what=still["moved"].where(still["moved"] != "", "everything"))
    curve = by_age(moving)
    picture = panels.lines(
        folder / "kept_trees.svg", curve, "age", "times", hue="what", facet="title", across=2, sharex=True,
        below="frames since the kept tree was made (at 1: as much as the tree that is rebuilt in that frame)",
        left="over the rebuilt tree",
    )  # fmt: skip
    tables = {
        "Ways to have a tree": summary(policies(moving)) if len(moving) else moving,
        "Geometry that does not move, ms by what has moved":
            document.cross_table(still, {"title": "scene", "label": "method"}, "what", "ms"),
    }  # fmt: skip
    finding = " ".join(filter(None, [pays(curve), stays(document.frames(folder), still)])) or "Nothing was measured."
    notes = [ABOUT] + ["A static tree, and one that reads no input that moved, is not made anew."] * bool(len(still))
    return document.write(
        folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet, notes, rows=rows, apart=lightings
    )


def static(base: Preset, scene: str) -> Preset:
    """The same of a scene that does not move, all made anew or only what depends on the light or the camera."""
    return replace(base, scenes=(scene,), methods=STATIC, frames=1, lightings=LIGHTINGS)


def with_static(base: Preset, scene: str) -> Preset:
    """A preset, and after it a scene that does not move."""
    return replace(base, also=(static(base, scene),))


PAPER = large(
    ("cloth", "bunny_dragon", "fairy", "balls-100k-swirl10", "balls-100k-swirl50"), METHODS, 40.0, frames=25, most=5,
    deviation=None, stage_samples=1,
)  # fmt: skip

EXPERIMENT = Experiment(
    "kept_trees", "Trees that keep: time and quality by the age of a tree",
    {
        "quick": with_static(small(64, ("balls-3k-swirl50",), METHODS, 10.0, samples=1, frames=21), "balls-3k"),
        "paper": with_static(PAPER, "conference"),
        "static": static(PAPER, "conference"),
    },
    draw,
)  # fmt: skip
