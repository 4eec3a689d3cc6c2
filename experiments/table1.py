"""Table 1 of the paper: build, trace and shadow times of every method on every scene, everything rebuilt.

The paper's columns are an HBVH, a kd-tree, a uniform grid and its own two structures on a GTX 280; ours are the
methods below on this machine. The quick preset is for a CPU: its image size is not comparable with the paper's.
"""

from pathlib import Path
from typing import Any

from ..harness.report import document, numbers, panels, ranking
from ..harness.report import paper_table1 as paper
from ..harness.report.dataframe import DataFrame, pd
from ..harness.results.schema import settings_text
from ..harness.results.table import PART_COLUMNS
from ..harness.runner.planning.experiment import Entry, Experiment
from ._paper import METHOD, REAL, SCENES, faithful, large, small
from .figure9 import gallery

QUICK_ROWS = ("the paper's grids", "ray grids", "BVH2 rebuilt", "uniform grid", "mesh rebuilt", "Embree")

METHODS = (  # The rows, in the order of the table. A line here adds a row.
    faithful("paper-faithful"),
    Entry(METHOD, {}, "the paper's grids"),
    Entry("ray_grids", {}, "ray grids"),
    Entry("hybrid", {}, "hybrid"),
    Entry("visibility_buffer", {}, "visibility buffer"),
    Entry("bvh2", {}, "BVH2 rebuilt"),
    Entry("bvh2", {"precision": "float32"}, "BVH2 rebuilt, float32"),
    Entry("uniform_grid", {}, "uniform grid"),
    Entry("warp_bvh", {}, "mesh rebuilt"),
    Entry("warp_bvh", {"origin": "plain"}, "mesh rebuilt, plain"),
    Entry("warp_bvh", {"update": "bvh_rebuild"}, "LBVH rebuilt in a graph"),
    Entry("embree", {}, "Embree"),
    Entry("embree", {"quality": "low"}, "Embree, fast build"),
)

QUICK = tuple(e for e in METHODS if e.label in QUICK_ROWS)  # a CPU compiles and runs these in four minutes

COLUMNS = ["origin", *document.COMMON, *(
    "source source_file source_sha256 method_title built build_iqr_ms trace_iqr_ms light_build_iqr_ms shadow_iqr_ms "
    "stage_gap frames_left_out primary_mrays_per_s shadow_mrays_per_s frame_mrays_per_s memory_bytes peak_rss_bytes "
    "pixels_scored excused_share check reference_errors known_inexact regrown compile_s first_frame_s"
).split()]  # fmt: skip
"""``origin``: this run or the paper."""
FRAME = f"Whole frame with shadows, everything rebuilt, ms; {paper.LABEL}: as printed, build / trace of primary rays"
PARTS = {
    "scene": "title", "method": "row", **{name: name for name in PART_COLUMNS}, "whole": "ms", "±": "around",
    "answers": "error", "Mrays/s": "rate", "MB": "mb",
}  # fmt: skip
CUT = 8.0  # longer bars are cut off, in shortest bars of the scene; their number stands beside them
ABOUT = (
    f"{numbers.OK} no wrong answer; {numbers.WRONG} n: n wrong pixels and shadow bits over all frames measured; "
    f"{numbers.UNSCORED}: there was no reference. Mrays/s: primary and shadow rays over the whole frame. MB: "
    "structures and work buffers. Where a scene moves, times are means over its frames. What each method built, and why "
    "it declares itself inexact, is in the CSV."
)
SPLIT = "ms per frame, split by part"
APART = (
    "On a CPU, and where a frame on a GPU is no graph, the parts were measured apart: they need not add up to the whole, "
    "and are drawn as shares of it."
)
LEFT_OUT = "Frames left out, beyond the point's budget; best is who is fastest over the frames of both: "


def read(folder: Path) -> DataFrame:
    """The points of a folder, methods in the order of the table. Besides the columns of :func:`.report.document.named`:

    row   the label; what was set by hand; and the device where there are several. The columns of :data:`PARTS` as text
    best  the answers are right, and no other point with right answers is faster, over the frames that both have
    """
    frames = document.frames(folder)
    parts = {name: (part, "") for part, name in PART_COLUMNS.items()}
    table = document.with_passes(document.named(frames), folder, parts)
    usual = {entry.label: ["-", *settings_text(dict(entry.settings)).split(", ")] for entry in METHODS}
    several = table["device"].nunique() > 1

    def called(row: Any) -> str:
        by_hand = [text for text in row.settings.split(", ") if text not in usual.get(row.label, ["-"])]
        return ", ".join([row.label, *by_hand, *([row.device] if several else [])])

    table["row"] = list(map(called, table.itertuples()))
    for part, name in PART_COLUMNS.items():
        table[part] = table[f"{name}_text"].where(table[f"{name}_ms"] != 0, "-")
    table["around"] = table["spread"].map(numbers.carried)
    table["mb"] = (table["memory_bytes"].astype("float64") / 1e6).map(numbers.carried)
    rate = table["frame_mrays_per_s"]
    table["rate"] = numbers.carry(rate, rate * table["spread"] / table["total_ms"])
    table["best"] = ranking.best(frames, table)
    table.attrs["older"] = frames.attrs["older"]
    return document.arranged(table, "label", [*usual, *table["label"]])


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """``table1.csv``: one row per point, then the paper's printed entries; ``table1.md``: whole frames beside what the paper
    prints, then the parts of each; stacked bars of each scene; and the gallery of ``folder/images``.
    """
    table = read(folder)
    by_scene = document.arranged(table, "scene", [*paper.ROWS, *table["scene"]])
    done = document.measured(by_scene)
    time = by_scene["ms"] + " " + by_scene["error"]
    pictures = [
        panels.bars(
            folder / "table1.svg", by_scene.assign(text=time.where(by_scene["total_ms"].notna(), by_scene["status"])),
            name="row", facet="title", across=2, cut=CUT, legend=5,
            below=f"{panels.WHOLE if apart(done) else SPLIT}; whisker: interquartile range of repeats",
        ) if len(done) else None,
        *gallery(folder, table, f"Table 1: the scenes; {document.where(table)}"),
    ]  # fmt: skip
    tables = {FRAME: frame_table(by_scene), "Parts of the frame, ms, and ± of the whole":
              done[[*PARTS.values()]].set_axis([*PARTS], axis=1)}  # fmt: skip
    best, right = table[table["best"]], done[done["error"] == numbers.OK]
    wins = [dict(zip(own["row"], own["method"], strict=True)) for _, own in best.groupby("title", sort=False)]
    finding = "No two frames with every answer right were measured over the same frames in one run."
    times = [dict(zip(own["row"], own["total_ms"], strict=True)) for _, own in right.groupby("title", sort=False)]
    finding = ranking.most_wins(wins, times, done["title"].nunique()) if wins else finding
    rows = pd.concat([table.assign(origin="this run"), paper.entries(table["scene"].unique())])
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, pictures, quiet, notes(table), rows=rows)


def frame_table(by_scene: DataFrame) -> DataFrame:
    """Methods down, scenes across: frame time and error or status, the fastest right one in bold; then the paper's."""
    own = document.arranged(by_scene, "label", [entry.label for entry in METHODS])
    text = own["ms"] + " " + own["error"].str.removesuffix(" wrong")
    text = text.where(own["status"] == "ok", own["status"])
    own = own.assign(text=text.where(~own["best"], "**" + text + "**"))
    printed = paper.entries(own["scene"].unique()).merge(own[["scene", "title"]].drop_duplicates())
    printed["row"] = "*the paper: " + printed["method"] + "*"
    printed["text"] = "*" + printed["printed"].str.replace("*", r"\*") + "*"
    wide = document.cross_table(pd.concat([own, printed]), {"row": "method"}, "title", "text")
    return wide[["method", *by_scene["title"].unique()]]


def apart(done: DataFrame) -> bool:
    """Whether parts of any point were measured apart from its whole, not as differences of graphs that stop earlier."""
    return bool(((done["device"] == "cpu") | done["submitted_ms"].notna()).any())


def notes(table: DataFrame) -> list[str]:
    """How to read an entry, what was left out, and where the paper's numbers are from."""
    told, theirs = [ABOUT], set(table["scene"]) & set(paper.ROWS)
    if theirs and set(table["width"]) | set(table["height"]) != set(paper.SIZE):
        told.append(f"Only {paper.SIZE[0]}x{paper.SIZE[1]} can be compared with the paper's rows.")
    told += [APART] * apart(document.measured(table))
    short = table[table["frames_left_out"] > 0]
    if len(short):
        told.append(f"{LEFT_OUT}{document.listed(list(short['title'] + ', ' + short['row']))}.")
    told += [f"Unscored: {reason}." for reason in sorted(set(table["unscored"]) - {""})]
    if older := table.attrs.get("older"):
        told.append(f"Not shown: older records of these points, or of other scenes of their names: {older}.")
    told += document.never_hit_notes(table)
    if theirs:
        printed = "; ".join(f"{title}: {source}" for title, source in paper.COLUMNS.items())
        told.append(f"The paper's numbers: {printed}. {' '.join(paper.FOOTNOTES)}".replace("*", r"\*"))
    return told


EXPERIMENT = Experiment(
    "table1", "Table 1: build, trace and shadow times",
    {
        "quick": small(256, SCENES + REAL, QUICK, 40.0, frames=2, rounds=2, timeout_s=180.0),
        "paper": large(SCENES + REAL, METHODS, 12.0, frames=3, most=30),
    },
    draw,
)  # fmt: skip
