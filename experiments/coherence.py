"""What the last frame's occluders save, by how much has moved since: light, camera and mesh at once.

A frame that is timed over and over would find its own occluders. So each frame is timed after one that lies a share of the
animation's step before it, in which the light, the camera and the mesh were elsewhere; and, apart, as the first frame of a
sequence, for which no occluder is known.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..harness.errors import UserError
from ..harness.frame.registry import make_method
from ..harness.report import compare, document, numbers, panels, sentences
from ..harness.results.record import Record
from ..harness.runner.planning.experiment import Entry, Experiment, Preset
from ..harness.runner.planning.run_options import Options
from ..harness.runner.progress import Silent
from ._sequence import measure

if TYPE_CHECKING:
    import pandas as pd

LAST = {"occluders": "last"}
NONE = Entry("ray_grids", {}, "no occluder kept")
NEXT = Entry("ray_grids", LAST, "last occluders first")
FIRST = Entry("ray_grids", LAST, "the same, first frame")
METHODS = (NONE, NEXT, FIRST)

STEPS = {"at rest": 0.0, "1/64 step": 1 / 64, "1/16 step": 1 / 16, "1/4 step": 1 / 4, "1 step": 1.0}
"""Shares of the animation's step that light, camera and mesh have moved since the frame before."""

ABOUT = (
    "A step is the time between two frames of the stored animation: the light turns by four degrees about the scene's "
    "middle, the camera by one about its target, vertices move on straight lines. In brackets: the share of the shadowed "
    "rays that their last occluder settled. Answers were compared bit by bit with those of the frame without occluders."
)
PARTS = ("build_ms", "trace_ms", "light_build_ms", "shadow_ms")
"""Not measured apart."""
COLUMNS = [name for name in document.COMMON if name not in PARTS]
COLUMNS += "step ratio ratio_spread settled memory_bytes".split()


def checked(options: Options) -> None:
    """Raise UserError for other methods and for scenes that cannot be traced.

    The answers are compared with those of the same method, so that no score would tell of a scene that it cannot trace.
    """
    for entry in options.preset.methods:
        if entry.method != NONE.method:
            raise UserError(f"--method {entry.method}: coherence measures ray_grids alone; leave out --method")
        for name in options.preset.scenes:
            reason = make_method(entry.method, dict(entry.settings)).applies(options.described(name), options.device)
            if reason is not None:
                raise UserError(f"--scene {name}: {entry.method} cannot trace it: {reason}")


def measured(options: Options, report: Silent) -> list[Record]:
    """The points of a run (:func:`._sequence.measure`). Raises UserError as :func:`checked` does."""
    checked(options)
    return measure(options, report, STEPS, FIRST.label)


def read(folder: Path) -> pd.DataFrame:
    """The points, with the frame time over that of :data:`NONE` after the same step, and the share of the shadowed rays
    that their last occluder settled."""
    frames = document.frames(folder)
    table = document.named(frames)
    found = compare.ratios(frames, frames["label"] == NONE.label)
    table["ratio"], table["ratio_spread"] = found["ratio"], found["spread"]
    table["step"] = table["light_label"].map(STEPS)
    names = [name for name in table if name.startswith("counter.light") and "settled" in name]
    shadowed = table["counter.shadowed rays"].where(table["counter.shadowed rays"] > 0)
    table["settled"] = table[names].sum(axis=1, min_count=1) / shadowed
    return document.arranged(
        document.arranged(table, "light_label", list(STEPS)), "label", [entry.label for entry in METHODS]
    )


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Frame time by how much has moved, CSV, and a table of each scene."""
    table = read(folder)
    done = document.measured(table)
    kept = done[(done["label"] != NONE.label) & done["ratio"].notna()]
    kept = kept.assign(place=kept["light_label"].map(list(STEPS).index))
    short = [label.removesuffix(" step") for label in STEPS]
    pictures = [panels.lines(
        folder / "coherence.svg", kept, "place", "ratio", facet="title", across=kept["title"].nunique(),
        whisker="ratio_spread", ticks=short.__getitem__, log_y=False, sharey=True, wide=2,
        below="moved since the frame before, steps of the animation", left="frame time over that without occluders",
    )] if len(kept) else []  # fmt: skip
    shown = numbers.carry(kept["ratio"], kept["ratio_spread"])
    known = (kept["label"] == NEXT.label) & kept["settled"].notna()
    settled = (100 * kept["settled"]).map(" ({:.0f} %)".format).where(known, "")
    cells = document.cross_table(
        document.arranged(kept.assign(text=shown + settled), "title", table["title"].unique()),
        {"title": "scene", "label": "setting"}, "light_label", "text",
    )  # fmt: skip
    after = kept[(kept["label"] == NEXT.label)]
    steps = {step: own for step in STEPS if len(own := after[after["light_label"] == step])}
    told = [f"{sentences.mean(own, 'ratio')} times as long ({step})" for step, own in steps.items()]
    told = told if len(told) < 2 else [told[0], told[-1]]  # from rest to the longest step
    finding = f"With the last frame's occluders a frame takes {sentences.listed(told)}{sentences.over(after)}."
    finding = finding if told else "The last frame's occluders were not measured."
    tables = {"Frame time over that without occluders": cells}
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, pictures, quiet, [ABOUT])


EXPERIMENT = Experiment(
    name="coherence",
    title="Coherence: what the last frame's occluders save",
    presets={
        "quick": Preset(
            128, 128, ("fairy", "cloth", "bunny_dragon"), METHODS, frames=1, samples=3, most=3, stage_samples=1, rounds=2,
            budget_s=3.0,
        ),
        "paper": Preset(
            1024, 1024, ("fairy", "cloth", "bunny_dragon"), METHODS, frames=3, samples=5, most=10, stage_samples=1,
            rounds=9, budget_s=9.0,
        ),
    },
    draw=draw,
    measure=measured,
)  # fmt: skip
