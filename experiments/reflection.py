"""Mirrors: the cost of one and four bounces of mirrored rays in every structure that can trace them.

The paper (section 6): grids are inefficient for reflected rays, since these are incoherent; trees do better on them, but
only where the SIMD width is low. Its own grids have no place for such rays: they hold what the eye and the lights see.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..harness.report import compare, document, numbers, panels, sentences
from ..harness.results.table import stage_ms
from ..harness.runner.planning.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from . import _rivals
from ._paper import SCENES

GRIDS = _rivals.GRIDS[1:]
TREES = (*_rivals.REBUILT, _rivals.REFITTED[0], Entry("embree", {}, "Embree"))
BOTH = (_rivals.HYBRID,)
"""A tree for mirrored rays beside another structure for primary rays."""
METHODS = (*GRIDS, *TREES, *BOTH)
BASE = "no mirrors"
LIGHTINGS = (
    Lighting(BASE, count=1),
    Lighting("1 bounce", count=1, bounces=1),
    Lighting("4 bounces", count=1, bounces=4),
)
"""The scene's largest triangles are mirrors (:func:`.scene.surface_rules.largest_triangles`)."""

MIRRORED = r"bounce \d+: mirrored rays"
COLUMNS = [*document.COMMON, "mirrored_rays", "primary_ns", "mirrored_ns", "loss", "added_ms", "ratio", "memory_bytes"]
HEADINGS = {"title": "scene", "light_label": "mirrors"}
KINDS = {**{entry.label: "grid" for entry in GRIDS}, **{entry.label: "tree" for entry in TREES}}


def read(folder: Path) -> document.DataFrame:
    """The points, with what mirrors add to the frame of :data:`BASE` of the same method and scene, and by ray:

    primary_ns, mirrored_ns  time of tracing a primary and a mirrored ray, ns, without shadow rays and without the build
    loss                     mirrored_ns over primary_ns: the cost of the lost coherence of the rays
    """
    frames = document.frames(folder)
    table = document.named(frames)
    same = (*compare.SCENE, *compare.SIZE, "label")
    own, base = compare.pairs(frames, frames["light_label"] == BASE, same)
    table["added_ms"] = table["key"].map(own["total_ms"] - base["total_ms"])
    table["added_spread"] = table["key"].map(np.hypot(compare.spread(own), compare.spread(base)))
    table["ratio"] = table["key"].map(compare.ratios(frames, frames["light_label"] == BASE, same)["ratio"])
    passes = {"mirrored": ("trace", MIRRORED), "traced": ("trace", "")}
    table = document.with_passes(table, folder, passes)
    rays = table["mirrored_rays"].where(table["mirrored_rays"] > 0).astype("float64")
    bounces = stage_ms(table, "trace", "bounce ")
    table["primary_ns"] = (stage_ms(table, "trace") - bounces) * 1e6 / table["pixels"].astype("float64")
    table["mirrored_ns"] = stage_ms(table, "trace", MIRRORED) * 1e6 / rays
    table["mirrored_ns_spread"] = table["mirrored_spread"] * 1e6 / rays
    table["loss"] = table["mirrored_ns"] / table["primary_ns"]
    shares = [table[f"{name}_spread"] / table[f"{name}_ms"] for name in passes]
    table["loss_spread"] = table["loss"] * np.hypot(*shares)
    return table


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The time that a bounce adds to the frame, and the time of a mirrored ray beside that of a primary ray; CSV."""
    table = read(folder)
    files = []
    done = document.measured(table)
    bounced = done[done["mirrored_ns"].notna()]
    tables = {}
    if len(bounced):
        files.append(picture(bounced, folder / "reflection.svg"))
        added = numbers.carry(bounced["added_ms"], bounced["added_spread"], "+")
        each = numbers.carry(bounced["mirrored_ns"], bounced["mirrored_ns_spread"])
        loss = numbers.carry(bounced["loss"], bounced["loss_spread"]).str.strip(numbers.NOISY)
        shown = bounced.assign(added=added, each=each + " (x" + loss + ")")
        tables = {
            f"What mirrors add to the frame of {BASE}, ms": added_table(shown, done),
            "A mirrored ray, ns, and over a primary ray of the same structure":
                document.cross_table(shown, HEADINGS, "label", "each"),
        }  # fmt: skip
    notes = [ABOUT] if len(bounced) else []
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding(bounced), tables, files, quiet, notes)


ABOUT = (
    "The scene's largest triangles, half of its area, are mirrors. Shadow rays of mirrored hits count in the frame, not in "
    "the time of a mirrored ray."
)


def added_table(shown: document.DataFrame, done: document.DataFrame) -> document.DataFrame:
    """Scenes and bounces down, methods across: the frame without mirrors, then what bounces add to it."""
    import pandas as pd

    base = done[(done["light_label"] == BASE) & done["label"].isin(shown["label"])]
    base = base.assign(added=numbers.carry(base["total_ms"], base["spread"]))
    both = document.arranged(pd.concat([base, shown]), "light_label", [lighting.label for lighting in LIGHTINGS])
    return document.cross_table(both.sort_values("title", kind="stable"), HEADINGS, "label", "added")


def finding(bounced: document.DataFrame) -> str:
    """How many times longer the best grid takes for a mirrored ray than the best tree, by device."""
    told = []
    for device, own in bounced.groupby("device_name", sort=False):
        times = best_ratio(own)
        if len(times):
            told.append(
                f"On {device} the fastest grid takes {sentences.mean(times, 'ratio')} times as long for a mirrored ray as "
                "the fastest tree (geometric mean over scenes and numbers of bounces)."
            )
    return " ".join(told) or "No grid and tree were measured with mirrors."


def best_ratio(bounced: document.DataFrame) -> document.DataFrame:
    """Time of a mirrored ray, fastest grid over fastest tree: ``ratio`` and ``ratio_spread`` by scene and bounces."""
    own = bounced.assign(kind=bounced["label"].map(KINDS)).sort_values("mirrored_ns")
    least = own.drop_duplicates(["kind", "scene", "light_label"]).set_index(["scene", "light_label"])
    sides = [least[least["kind"] == kind] for kind in ("grid", "tree")]
    grid, tree = (side["mirrored_ns"] for side in sides)
    shares = [side["mirrored_ns_spread"] / side["mirrored_ns"] for side in sides]
    ratio = grid / tree
    return ratio.to_frame("ratio").assign(ratio_spread=ratio * np.hypot(*shares)).dropna(subset="ratio")


def picture(bounced: document.DataFrame, path: Path) -> Path:
    """One panel per scene, one line per method: the time of a mirrored ray over that of a primary ray, by number of
    bounces."""
    own = bounced.assign(bounces=bounced["light_label"].str.split().str[0].astype(int))
    return panels.lines(
        path, own, "bounces", "mirrored_ns", facet="title", across=3, ticks=str, wide=2,
        below="bounces", left="ns per mirrored ray", legend=3, sharey=True,
    )  # fmt: skip


EXPERIMENT = Experiment(
    name="reflection",
    title="Reflection: what mirrored rays cost in grids and in trees",
    presets={
        "quick": Preset(
            128, 128, ("conference", "sibenik"), METHODS, frames=1, samples=3, most=3, stage_samples=2, rounds=1,
            budget_s=3.0, lightings=LIGHTINGS,
        ),
        "paper": Preset(
            1024, 1024, SCENES, METHODS, frames=1, samples=5, most=20, deviation=0.01, stage_samples=2, rounds=9,
            budget_s=9.0, timeout_s=600.0, lightings=LIGHTINGS,
        ),
    },
    draw=draw,
)  # fmt: skip
