"""What the last frame's occluders save, by how much has moved since: light, camera and mesh at once.

A frame that is timed over and over would find its own occluders. So each frame is timed after one that lies a share of the
animation's step before it, in which the light, the camera and the mesh were elsewhere; and, apart, as the first frame of a
sequence, for which no occluder is known.
"""

from pathlib import Path

from ..harness.errors import UserError
from ..harness.frame.registry import make_method
from ..harness.report import compare, document, numbers, panels
from ..harness.results.record import Record
from ..harness.runner.planning.experiment import Entry, Experiment
from ..harness.runner.planning.planned_point import Options
from ..harness.runner.progress import Silent
from ._paper import large, small
from ._played import measure

LAST = {"occluders": "last"}
NONE = Entry("ray_grids", {}, "no occluder kept")
NEXT = Entry("ray_grids", LAST, "last occluders first")
FIRST = Entry("ray_grids", LAST, "the same, first frame")
METHODS = (NONE, NEXT, FIRST)
SCENES = ("fairy", "cloth", "bunny_dragon")

STEPS = {"at rest": 0.0, "1/64 step": 1 / 64, "1/16 step": 1 / 16, "1/4 step": 1 / 4, "1 step": 1.0}
"""Shares of the animation's step that light, camera and mesh have moved since the frame before."""

ABOUT = (
    "A step is the time between two frames of the stored animation: the light turns by four degrees about the scene's "
    "middle, the camera by one about its target, vertices move on straight lines. In brackets: the share of the shadowed "
    "rays that their last occluder settled. Answers were compared bit by bit with those of the frame without occluders."
)
PARTS = ("build_ms", "trace_ms", "light_build_ms", "shadow_ms")  # not measured apart
COLUMNS = [name for name in document.COMMON if name not in PARTS]
COLUMNS += "step ratio ratio_spread settled memory_bytes".split()


def measured(options: Options, report: Silent) -> list[Record]:
    """The points of a run (:func:`._played.measure`). Raises UserError for other methods and for scenes that cannot be
    traced: the answers are compared with those of the same method, so that no score would tell of a scene that it
    cannot trace.
    """
    for entry in options.preset.methods:
        if entry.method != NONE.method:
            raise UserError(f"--method {entry.method}: coherence measures ray_grids alone; leave out --method")
        for name in options.preset.scenes:
            reason = make_method(entry.method, dict(entry.settings)).applies(options.described(name), options.device)
            if reason is not None:
                raise UserError(f"--scene {name}: {entry.method} cannot trace it: {reason}")
    return measure(options, report, STEPS, FIRST.label)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Frame time by how much has moved, over that of :data:`NONE` after the same step, and the share of the shadowed rays
    that their last occluder settled: a drawing, CSV, and a table of each scene.
    """
    frames = document.frames(folder)
    table, found = document.named(frames), compare.ratios(frames, frames["label"] == NONE.label)
    shadowed = table["counter.shadowed rays"].where(table["counter.shadowed rays"] > 0)
    counted = table.filter(regex=r"^counter\.light.*settled").sum(axis=1, min_count=1)
    table = table.assign(
        ratio=found["ratio"],
        ratio_spread=found["spread"],
        step=table["light_label"].map(STEPS),
        settled=counted / shadowed,
    )
    table = document.arranged(table, "light_label", list(STEPS))
    table = document.arranged(table, "label", [entry.label for entry in METHODS])
    done = document.measured(table)
    kept = done[(done["label"] != NONE.label) & done["ratio"].notna()]
    kept = kept.assign(place=kept["light_label"].map(list(STEPS).index))
    short = [label.removesuffix(" step") for label in STEPS]
    picture = panels.lines(
        folder / "coherence.svg", kept, "place", "ratio", facet="title", across=kept["title"].nunique(),
        whisker="ratio_spread", ticks=short.__getitem__, log_y=False, sharey=True, wide=2,
        below="moved since the frame before, steps of the animation", left="frame time over that without occluders",
    )  # fmt: skip
    known = (kept["label"] == NEXT.label) & kept["settled"].notna()
    settled = (100 * kept["settled"]).map(" ({:.0f} %)".format).where(known, "")
    kept = kept.assign(text=numbers.texts(kept, "ratio") + settled)
    after = kept[kept["label"] == NEXT.label]
    cells = document.cross_table(
        document.arranged(kept, "title", table["title"].unique()),
        {"title": "scene", "label": "setting"},
        "light_label",
        "text",
    )
    steps = {step: own for step in STEPS if len(own := after[after["light_label"] == step])}
    told = [f"{numbers.mean(own, 'ratio')} times as long ({step})" for step, own in steps.items()]
    told = told if len(told) < 2 else [told[0], told[-1]]  # from rest to the longest step
    finding = f"With the last frame's occluders a frame takes {numbers.listed(told)}{numbers.over(after)}."
    finding = finding if told else "The last frame's occluders were not measured."
    tables = {"Frame time over that without occluders": cells}
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet, [ABOUT])


EXPERIMENT = Experiment(
    "coherence", "Coherence: what the last frame's occluders save",
    {
        "quick": small(128, SCENES, METHODS, 3.0, rounds=2),
        "paper": large(SCENES, METHODS, frames=3, most=10, deviation=None, stage_samples=1, timeout_s=300.0),
    },
    draw, measure=measured,
)  # fmt: skip
