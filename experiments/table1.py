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
PARTS = {"build_ms": "build", "trace_ms": "trace", "light_build_ms": "light build", "shadow_ms": "shadow"}
CUT = 3.0
"""A bar more than this many times longer than the median of its scene is cut off; its number stands beside it."""


def read(folder: Path) -> DataFrame:
    """The points of a folder, methods in the order of the table. Besides the columns of :func:`.report.document.read`:

    row   the label; what was set by hand; and the device where there are several
    best  the answers are right, and so fast is no other point with right answers, over the frames that both have
    """
    frames = document.frames(folder)
    table = document.named(frames)
    table.attrs["older"] = frames.attrs["older"]
    declared = {entry.label: settings_text(dict(entry.settings)) for entry in METHODS}
    usual = table["label"].map(declared).fillna("-").str.split(", ")
    extra = [
        ", ".join(x for x in text.split(", ") if x not in known and x != "-")
        for text, known in zip(table["settings"], usual, strict=True)
    ]
    device = table["device"] if table["device"].nunique() > 1 else [""] * len(table)
    names = zip(table["label"], extra, device, strict=True)
    table["row"] = [", ".join(filter(None, name)) for name in names]
    right = document.measured(table).query("error == @style.OK")
    table["best"] = table["key"].isin(
        [key for _, own in right.groupby("title") for key in fastest(frames, own)]
    )
    order = [*declared, *table["label"]]
    return table.sort_values("label", key=lambda s: s.map(order.index), kind="stable", ignore_index=True)


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
    rows = pd.concat([table.assign(origin="this run"), paper_rows(table["scene"].unique())])
    scenes = list(
        table.sort_values("scene", key=lambda s: s.map([*paper.ROWS, *s].index), kind="stable")[
            "title"
        ].unique()
    )
    files = [document.write_csv(rows, folder / "table1.csv", COLUMNS)]
    done = document.measured(table)
    if len(done):
        files.append(picture(table, scenes, folder / "table1.svg"))
    files += gallery.draw(folder, table, f"Table 1: the scenes; {document.where(table)}")
    tables = {FRAME: frame_table(table, scenes)}
    tables |= {
        f"{title}: {about(own)}": parts_table(own)
        for title in scenes
        for own in [table[table["title"] == title]]
    }
    tables |= {"What each method built": methods_table(table), "Scenes": scenes_table(table, scenes)}
    return document.write(
        folder, "table1", EXPERIMENT.title, finding(done), tables, files, table, quiet, notes(table)
    )


def finding(done: DataFrame) -> str:
    """On how many scenes who is fastest."""
    best, n = done[done["best"]], done["title"].nunique()
    told = [
        f"{row} on {len(own)} ({document.span(own['total_ms'])} ms)"
        for row, own in best.groupby("row", sort=False)
    ]
    known = f"Of {n} scene{'s' * (n != 1)} the fastest frame with every answer right: {', '.join(told)}."
    return known if told else "No scene has two methods with right answers over the same frames in one run."


def frame_table(table: DataFrame, scenes: list[str]) -> DataFrame:
    """Methods down, scenes across: frame time with its error, or why there is none; the fastest right one in bold."""
    time = document.carry(table["total_ms"], table["spread"])
    text = time + " " + table["error"].str.removesuffix(" wrong")
    text = text.where(table["status"] == "ok", table["status"])
    marked = table.assign(text=text.where(~table["best"], "**" + text + "**"))
    wide = document.cross_table(marked, ["row"], "title", "text")
    printed = dict(table[table["scene"].isin(paper.ROWS)].groupby("title")["scene"].first().map(paper.total))
    if printed:
        wide.loc[len(wide)] = {
            "row": f"*the paper, {paper.GPU}*",
            **{t: f"*{ms}*" for t, ms in printed.items()},
        }
    return wide[["row", *scenes]].rename(columns={"row": "method"})


def about(own: DataFrame) -> str:
    """What the scene has, and what a row of its table says."""
    frames = own["frames"].max()
    counted = f"{own['triangles'].iloc[0]:,} triangles" + f", {frames} frames" * bool(frames > 1)
    return f"{counted}; ms by part of the frame, and ± of the whole"


def parts_table(own: DataFrame) -> DataFrame:
    """A row a measured point of a scene: the parts of its frame, its error, rate and memory; then what the paper prints."""
    import pandas as pd

    done = document.measured(own)
    columns: document.Columns = {"method": ("row", str)}
    columns |= {name: (column, lambda ms: style.number(ms or None)) for column, name in PARTS.items()}
    columns |= {"whole": ("total_ms", style.number), "±": ("spread", style.number), "answers": ("error", str)}
    columns |= {"Mrays/s": ("frame_mrays_per_s", style.number), "MB": ("memory_bytes", style.megabytes)}
    theirs = []
    for column, text in zip(paper.COLUMNS, paper.cells(own["scene"].iloc[0]), strict=True):
        if text not in ("-", paper.NOT_AVAILABLE):
            names = ("build", "trace") if " / " in text else ("whole",)
            parts = [part.replace("*", r"\*") for part in text.removesuffix(" ms").split(" / ")]
            theirs.append({"method": f"paper: {column.title}", **dict(zip(names, parts, strict=True))})
    printed = pd.DataFrame(theirs).map("*{}*".format, na_action="ignore")
    return pd.concat([document.texts(done, columns), printed])


def methods_table(table: DataFrame) -> DataFrame:
    """What each method really built, and what it says of its answers itself."""
    own = table[table["built"] != "-"].drop_duplicates(["row", "built", "known_inexact"])
    said = own["known_inexact"].where(own["known_inexact"] != "", "-")
    return own[["row", "built"]].assign(**{"declares itself inexact": said}).rename(columns={"row": "method"})


def scenes_table(table: DataFrame, scenes: list[str]) -> DataFrame:
    """What each scene stands in for, and what of its answers needs to be known."""
    own = table.groupby("title").agg({"stand_in": "first", "excused_share": "max", "reference_errors": "max"})
    columns: document.Columns = {
        "scene": ("title", str), "made as": ("stand_in", lambda text: text or "-"),
        "excused as too close to an edge, at most": ("excused_share", "{:.4%}"),
        "answers that the reference (Embree) got wrong": ("reference_errors", "{:,}"),
    }  # fmt: skip
    return document.texts(own.loc[scenes].reset_index(), columns)


def notes(table: DataFrame) -> list[str]:
    """How to read an entry, and how far to trust its digits."""
    done = document.measured(table)
    told = [
        f"{style.OK} no wrong answer; {style.WRONG} n: n wrong pixels and visibility bits over all frames measured; "
        f"{style.UNSCORED}: there was no exact reference. Mrays/s: primary and shadow rays over the whole frame. MB: "
        "structures and work buffers. Where a scene moves, times are means over its frames."
    ]
    theirs = set(table["scene"]) & set(paper.ROWS)
    if theirs and set(table["width"]) | set(table["height"]) != set(paper.SIZE):
        told.append(
            f"Only {paper.SIZE[0]}x{paper.SIZE[1]} is to be held against the paper's rows ({paper.LABEL})."
        )
    if len(done):
        gap = done["stage_gap"].abs().fillna(0.0)
        worst = done.loc[gap.idxmax()]
        told.append(
            f"The sum of the parts, measured apart, differs from the whole frame by {gap.median():.1%} (median), at most "
            f"{gap.max():.1%} ({worst['title']}, {worst['row']})."
        )
    for column, text in (("frames_left_out", "Frames left out, beyond the point's budget; best is who is fastest over "
                          "the frames that both have"), ("regrown", "Capacities grew before timing")):  # fmt: skip
        rows = done[done[column] > 0]
        told += [f"{text}: {'; '.join(rows['title'] + ', ' + rows['row'])}."] * bool(len(rows))
    told += [f"Unscored: {reason}." for reason in sorted(set(done["unscored"]) - {""})]
    if table.attrs.get("older"):
        told.append(
            f"Not shown: older records of these points, or of other scenes of their names: {table.attrs['older']}."
        )
    missing = [entry.label for entry in METHODS if entry.label not in set(table["label"])]
    if missing and set(table["preset"]) == {"quick"}:
        told.append(f"Not in this run: {', '.join(missing)}; the preset paper has all.")
    printed = " ".join(cell for scene in table["scene"].unique() for cell in paper.cells(scene))
    footnotes = [note for note in paper.FOOTNOTES if note.split()[0] in printed or note.startswith("Our")]
    sources = "; ".join(f"{c.title}: {c.source}" for c in paper.COLUMNS).replace("*", r"\*")
    told += document.never_hit_notes(table)
    if theirs:
        told.append(f"The paper's rows: {paper.LABEL}, as printed. {sources}. {' '.join(footnotes)}")
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


def picture(table: DataFrame, scenes: list[str], path: Path) -> Path:
    """A panel a scene, stacked bars by part of the frame; the whole frame and its error beside each."""
    colours = style.colours(table["method"])
    own = table.sort_values("title", key=lambda s: s.map(scenes.index), kind="stable")
    time = own["total_ms"].map(style.number) + " " + own["error"]
    own = own.assign(text=time.where(own["total_ms"].notna(), own["status"]))
    across = min(2, len(scenes))
    rows = own["row"].nunique()
    size = (
        style.COLUMN_WIDTH * (0.35 + 0.65 * across),
        (0.125 * rows + 0.3) * -(-len(scenes) // across) + 0.7,
    )
    tints = {method: panels.part_tints(colour) for method, colour in colours.items()}
    with panels.bar_panels(path, own, size, tints=tints, name="row", facet="title", across=across, cut=CUT, room=1.5,
                           legend=5, font=5.5) as (figure, places):  # fmt: skip
        panels.name_parts(places[0][0])
        figure.supxlabel("ms per frame, split by part; whisker: interquartile range of repeats", fontsize=7)
    return path


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
