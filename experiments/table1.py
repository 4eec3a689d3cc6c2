"""Table 1 of the paper: build, trace and shadow times of every method on every scene, everything rebuilt.

The paper's columns are an HBVH, a kd-tree, a uniform grid and its own two structures on a GTX 280; ours are the
methods below on this machine. The quick preset is for a CPU: at its size it is not to be held against the paper.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from ..harness.report import compare, document, gallery, panels, style
from ..harness.report import paper_table1 as paper
from ..harness.results.newest import settings_text
from ..harness.runner.experiment import Entry, Experiment, Preset
from ._paper import METHOD, SCENES, faithful

if TYPE_CHECKING:
    from pandas import DataFrame

REAL = ("bunny",) if find_spec("pxr") else ()
"""A small real scene that needs no download, where USD files can be read."""

QUICK_ROWS = ("perspective + spherical, tuned", "ray grids", "bvh2", "uniform grid", "Warp mesh", "Embree")

METHODS = (
    faithful("paper-faithful"),
    Entry(METHOD, {}, "perspective + spherical, tuned"),
    Entry("ray_grids", {}, "ray grids"),
    Entry("hybrid", {}, "hybrid"),
    Entry("visibility_buffer", {}, "visibility buffer"),
    Entry("bvh2", {}, "bvh2"),
    Entry("bvh2", {"precision": "float32"}, "bvh2, float32"),
    Entry("uniform_grid", {}, "uniform grid"),
    Entry("warp_bvh", {}, "Warp mesh"),
    Entry("warp_bvh", {"origin": "plain"}, "Warp mesh, plain origins"),
    Entry("warp_bvh", {"update": "bvh_rebuild"}, "Warp BVH, exact"),
    Entry("embree", {}, "Embree"),
    Entry("embree", {"quality": "low"}, "Embree, fast build"),
)
"""The rows, in the order of the table. A line here adds a row."""

QUICK = tuple(e for e in METHODS if e.label in QUICK_ROWS)
"""What a CPU compiles and runs in less than four minutes."""

COLUMNS = (
    "origin scene scene_title stand_in source source_file source_sha256 triangles "
    "method method_title label settings built "
    "device device_name width height preset status reason "
    "build_ms trace_ms light_build_ms shadow_ms total_ms "
    "build_iqr_ms trace_iqr_ms light_build_iqr_ms shadow_iqr_ms iqr_ms between_ms stage_gap "
    "frames frames_left_out samples primary_mrays_per_s shadow_mrays_per_s frame_mrays_per_s "
    "memory_bytes peak_rss_bytes true_errors pixels_scored excused_share check reference_errors known_inexact unscored "
    "regrown compile_s first_frame_s environment key"
).split()
"""The columns of the CSV: those of a point (:func:`.results.means.points`), after ``origin``: this run or the paper."""


FRAME = "Whole frame with shadows, everything rebuilt, ms"
PARTS: document.Columns = {
    "method": ("row", str), "build": ("build_ms", lambda ms: style.number(ms or None)), "trace": ("trace_ms", style.number),
    "light build": ("light_build_ms", lambda ms: style.number(ms or None)), "shadow": ("shadow_ms", style.number),
    "whole": ("total_ms", style.number), "±": ("spread", style.number), "answers": ("error", str),
    "Mrays/s": ("frame_mrays_per_s", style.number), "MB": ("memory_bytes", style.megabytes),
}  # fmt: skip
SCENE_FACTS: document.Columns = {
    "scene": ("title", str), "made as": ("stand_in", lambda text: text or "-"),
    "excused as too close to an edge, at most": ("excused_share", "{:.4%}"),
    "answers that the reference (Embree) got wrong": ("reference_errors", "{:,}"),
}  # fmt: skip
CUT = 3.0
"""A bar more than this many times longer than the median of its scene is cut off; its number stands beside it."""
ABOUT = (
    f"{style.OK} no wrong answer; {style.WRONG} n: n wrong pixels and visibility bits over all frames measured; "
    f"{style.UNSCORED}: there was no exact reference. Mrays/s: primary and shadow rays over the whole frame. MB: "
    "structures and work buffers. Where a scene moves, times are means over its frames."
)
LEFT_OUT = (
    "Frames left out, beyond the point's budget; best is who is fastest over the frames that both have: "
)


def read(folder: Path) -> DataFrame:
    """The points of a folder, methods in the order of the table. Besides the columns of :func:`.report.document.read`:

    row   the label; what was set by hand; and the device where there are several
    best  the answers are right, and so fast is no other point with right answers, over the frames that both have
    """
    frames = document.frames(folder)
    table = document.named(frames)
    table.attrs["older"] = frames.attrs["older"]
    declared = {entry.label: settings_text(dict(entry.settings)) for entry in METHODS}
    usual = table["label"].map(declared).fillna("-")
    device = table["device"] if table["device"].nunique() > 1 else [""] * len(table)
    table["row"] = [
        ", ".join(
            [
                label,
                *(x for x in settings.split(", ") if x not in f"-, {known}".split(", ")),
                *filter(None, [place]),
            ]
        )
        for label, settings, known, place in zip(
            table["label"], table["settings"], usual, device, strict=True
        )
    ]
    right = document.measured(table).query("error == @style.OK")
    best = [key for _, own in right.groupby("title") for key in fastest(frames, own)]
    table["best"] = table["key"].isin(best)
    return document.arranged(table, "label", [*declared, *table["label"]]).reset_index(drop=True)


def fastest(frames: DataFrame, own: DataFrame) -> list[str]:
    """The key of the fastest of the points ``own``; none where one of them has no frame or no run in common with it."""
    first = own.loc[own["total_ms"].idxmin(), "key"]
    beside = frames[frames["key"].isin(own["key"])]
    same = [name for name in compare.SAME if name != "device"]
    ratios = compare.ratios(beside, beside["key"] == first, same)["ratio"].reindex(own["key"])
    return [first] if len(own) > 1 and (ratios >= 1).all() else []


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Table, drawing and gallery from the records in a folder; printed too unless ``quiet``.

    table1.csv  one row a point, then the paper's printed entries
    table1.md   the whole frame, methods down and scenes across; then the parts of the frame, scene by scene
    table1.svg  stacked bars of each scene
    gallery.png the pictures of ``folder/images``, where there are any
    """
    import pandas as pd

    table = read(folder)
    by_scene = document.arranged(table, "scene", [*paper.ROWS, *table["scene"]])
    done, pictures = document.measured(table), []
    if len(done):
        time = by_scene["total_ms"].map(style.number) + " " + by_scene["error"]
        across = min(2, by_scene["title"].nunique())
        pictures = [panels.bars(
            folder / "table1.svg", by_scene.assign(text=time.where(by_scene["total_ms"].notna(), by_scene["status"])),
            name="row", facet="title", across=across, cut=CUT, wide=0.35 + 0.65 * across, legend=5,
            below=["ms per frame, split by part; whisker: interquartile range of repeats"],
        )]  # fmt: skip
    pictures += gallery.draw(folder, table, f"Table 1: the scenes; {document.where(table)}")
    tables = {FRAME: frame_table(by_scene)}
    for title, own in by_scene.groupby("title", sort=False):
        facts = f"{own['triangles'].iloc[0]:,} triangles, {own['frames'].max()} frame(s)"
        tables[f"{title}: {facts}; ms by part of the frame, and ± of the whole"] = parts_table(own)
    tables |= {"What each method built": methods_table(table), "Scenes": scenes_table(by_scene)}
    rows = pd.concat([table.assign(origin="this run"), paper_rows(table["scene"].unique())])
    return document.write(
        folder, EXPERIMENT, table, COLUMNS, finding(done), tables, pictures, quiet, notes(table), rows=rows
    )


def finding(done: DataFrame) -> str:
    """On how many scenes who is fastest."""
    n = done["title"].nunique()
    told = [
        f"{row} on {len(own)} ({document.span(own['total_ms'])} ms)"
        for row, own in done[done["best"]].groupby("row", sort=False)
    ]
    known = f"Of {n} scene{'s' * (n != 1)} the fastest frame with every answer right: {', '.join(told)}."
    return known if told else "No scene has two methods with right answers over the same frames in one run."


def frame_table(table: DataFrame) -> DataFrame:
    """Methods down, scenes across: frame time with its error, or why there is none; the fastest right one in bold."""
    text = table["ms"] + " " + table["error"].str.removesuffix(" wrong")
    text = text.where(table["status"] == "ok", table["status"])
    marked = table.assign(text=text.where(~table["best"], "**" + text + "**")).sort_index()
    wide = document.cross_table(marked, {"row": "method"}, "title", "text")
    theirs = table[table["scene"].isin(paper.ROWS)].groupby("title")["scene"].first().map(paper.total)
    if len(theirs):
        wide.loc[len(wide)] = {"method": f"*the paper, {paper.GPU}*", **("*" + theirs + "*")}
    return wide[["method", *table["title"].unique()]]


def parts_table(own: DataFrame) -> DataFrame:
    """A row a measured point of a scene: the parts of its frame, its error, rate and memory; then what the paper prints."""
    import pandas as pd

    theirs = []
    for column, text in zip(paper.COLUMNS, paper.cells(own["scene"].iloc[0]), strict=True):
        if text not in ("-", paper.NOT_AVAILABLE):
            names = ("build", "trace") if " / " in text else ("whole",)
            parts = text.removesuffix(" ms").replace("*", r"\*").split(" / ")
            theirs.append({"method": f"paper: {column.title}", **dict(zip(names, parts, strict=True))})
    printed = pd.DataFrame(theirs).map("*{}*".format, na_action="ignore")
    return pd.concat([document.texts(document.measured(own), PARTS), printed])


def methods_table(table: DataFrame) -> DataFrame:
    """What each method really built, and what it says of its answers itself."""
    own = table[table["built"] != "-"].drop_duplicates(["row", "built", "known_inexact"])
    said = {"known_inexact": "declares itself inexact", "row": "method"}
    return own[["row", "built", "known_inexact"]].replace("", "-").rename(columns=said)


def scenes_table(table: DataFrame) -> DataFrame:
    """What each scene stands in for, and what of its answers needs to be known."""
    facts = {"stand_in": "first", "excused_share": "max", "reference_errors": "max"}
    return document.texts(table.groupby("title", sort=False).agg(facts).reset_index(), SCENE_FACTS)


def notes(table: DataFrame) -> list[str]:
    """How to read an entry, what was left out, and where the paper's numbers are from."""
    told = [ABOUT]
    theirs = set(table["scene"]) & set(paper.ROWS)
    if theirs and set(table["width"]) | set(table["height"]) != set(paper.SIZE):
        told += [
            f"Only {paper.SIZE[0]}x{paper.SIZE[1]} is to be held against the paper's rows ({paper.LABEL})."
        ]
    short = table[table["frames_left_out"] > 0]
    told += [f"{LEFT_OUT}{'; '.join(short['title'] + ', ' + short['row'])}."] * bool(len(short))
    told += [f"Unscored: {reason}." for reason in sorted(set(table["unscored"]) - {""})]
    if older := table.attrs.get("older"):
        told += [f"Not shown: older records of these points, or of other scenes of their names: {older}."]
    told += document.never_hit_notes(table)
    if theirs:
        printed = " ".join(cell for scene in theirs for cell in paper.cells(scene))
        footnotes = [note for note in paper.FOOTNOTES if note.split()[0] in f"Our {printed}"]
        sources = "; ".join(f"{c.title}: {c.source}" for c in paper.COLUMNS).replace("*", r"\*")
        told += [f"The paper's rows: {paper.LABEL}, as printed. {sources}. {' '.join(footnotes)}"]
    return told


def paper_rows(scenes: Iterable[str]) -> DataFrame:
    """The paper's printed entries for these scenes, in the columns of the CSV, marked as the paper's own."""
    import pandas as pd

    rows = []
    for scene in (scene for scene in scenes if scene in paper.ROWS):
        for column, text in zip(paper.COLUMNS, paper.cells(scene), strict=True):
            values = paper.numbers(scene, column.key)
            rows.append({"origin": paper.LABEL, "scene": scene, "scene_title": paper.ROWS[scene].title,
                         "method": column.title, "label": column.source, "device_name": f"NVIDIA {paper.GPU}",
                         "width": paper.SIZE[0], "height": paper.SIZE[1], "status": "printed" if values else "n/a",
                         "reason": f"printed as {text!r}", "unscored": "the paper states no errors",
                         **{f"{name}_ms": value for name, value in values.items()}})  # fmt: skip
    return pd.DataFrame(rows)


EXPERIMENT = Experiment(
    name="table1",
    title="Table 1: build, trace and shadow times",
    presets={
        "quick": Preset(
            256, 256, SCENES + REAL, QUICK, frames=2, samples=3, most=3, stage_samples=1, rounds=2, budget_s=40.0,
            timeout_s=180.0,
        ),
        "paper": Preset(
            1024, 1024, SCENES + REAL, METHODS, frames=5, samples=10, most=40, deviation=0.005, stage_samples=10, rounds=3,
            budget_s=40.0, timeout_s=600.0,
        ),
    },
    draw=draw,
)  # fmt: skip
