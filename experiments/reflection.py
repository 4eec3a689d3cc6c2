"""Mirrors: the cost of one and four bounces of mirrored rays in every structure that can trace them.

The paper (section 6): grids are inefficient for reflected rays, since these are incoherent; trees do better on them, but
only where the SIMD width is low. Its own grids have no place for such rays: they hold what the eye and the lights see.
"""

from pathlib import Path

import numpy as np

from ..harness.report import compare, document, numbers, panels
from ..harness.report.dataframe import DataFrame, Series, pd
from ..harness.results.table import stage_ms
from ..harness.runner.planning.experiment import Entry, Experiment
from ..harness.scene.overrides import Lighting
from . import _rivals
from ._paper import SCENES, large, small

GRIDS = _rivals.GRIDS[1:]
TREES = (*_rivals.REBUILT, _rivals.REFITTED[0], Entry("embree", {}, "Embree"))
BOTH = (_rivals.HYBRID,)  # a tree for mirrored rays beside another structure for primary rays
METHODS = (*GRIDS, *TREES, *BOTH)
BASE = "no mirrors"
LIGHTINGS = (  # the scene's largest triangles are mirrors (`scene.overrides.largest_triangles`)
    Lighting(BASE, count=1),
    Lighting("1 bounce", count=1, bounces=1),
    Lighting("4 bounces", count=1, bounces=4),
)

MIRRORED = r"bounce \d+: mirrored rays"
COLUMNS = [*document.COMMON, "mirrored_rays", "primary_ns", "mirrored_ns", "loss", "added_ms", "ratio", "memory_bytes"]
HEADINGS = {"title": "scene", "light_label": "mirrors"}
KINDS = {**{entry.label: "grid" for entry in GRIDS}, **{entry.label: "tree" for entry in TREES}}


def read(folder: Path) -> DataFrame:
    """The points, with what mirrors add to the frame of :data:`BASE` of the same method and scene, and by ray:

    primary_ns, mirrored_ns  time of tracing a primary and a mirrored ray, ns, without shadow rays and without the build
    loss                     mirrored_ns over primary_ns: the cost of the lost coherence of the rays
    """
    frames = document.frames(folder)
    table = document.named(frames)
    same = (*compare.SCENE, *compare.SIZE, "label")
    own, base = compare.pairs(frames, frames["light_label"] == BASE, same)
    table["added_ms"] = own["total_ms"] - base["total_ms"]
    table["added_ms_spread"] = np.hypot(compare.spread(own), compare.spread(base))
    table["ratio"] = own["total_ms"] / base["total_ms"]
    table = document.with_passes(table, folder, {"mirrored": ("trace", MIRRORED), "traced": ("trace", "")})
    rays = table["mirrored_rays"].where(table["mirrored_rays"] > 0).astype("float64")
    bounces = stage_ms(table, "trace", "bounce ")
    table["primary_ns"] = (stage_ms(table, "trace") - bounces) * 1e6 / table["pixels"].astype("float64")
    table["mirrored_ns"] = mirrored_ms(table) * 1e6 / rays
    table["mirrored_ns_spread"] = table["mirrored_spread"] * 1e6 / rays
    table["loss"] = table["mirrored_ns"] / table["primary_ns"]
    shares = [table[f"{name}_spread"] / table[f"{name}_ms"] for name in ("mirrored", "traced")]
    return table.assign(loss_spread=table["loss"] * np.hypot(*shares))


def mirrored_ms(table: DataFrame) -> Series:
    """Time of tracing mirrored rays, ms; NaN where it is lost in the noise of the frame. Passes are differences of frames,
    which of a slow one may be less than nothing.
    """
    found = stage_ms(table, "trace", MIRRORED)
    return found.where(found > 0)


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The time that a bounce adds to the frame, and the time of a mirrored ray beside that of a primary ray; CSV."""
    table = read(folder)
    done = document.measured(table)
    bounced = done[done["mirrored_ns"].notna()]
    picture = panels.lines(
        folder / "reflection.svg", bounced.assign(bounces=bounced["light_label"].str.extract(r"(\d+)").astype(float)),
        "bounces", "mirrored_ns", facet="title", across=3, ticks="{:.0f}".format, wide=2,
        below="bounces", left="ns per mirrored ray", legend=3, sharey=True,
    )  # fmt: skip
    loss = numbers.texts(bounced, "loss").str.strip(numbers.NOISY)
    bounced = bounced.assign(
        each=numbers.texts(bounced, "mirrored_ns") + " (x" + loss + ")",
        added=numbers.carry(bounced["added_ms"], bounced["added_ms_spread"], "+"),
    )
    base = done[(done["light_label"] == BASE) & done["label"].isin(bounced["label"])]
    both = pd.concat([base.assign(added=numbers.carry(base["total_ms"], base["spread"])), bounced])
    both = document.arranged(both, "light_label", [lighting.label for lighting in LIGHTINGS])
    tables = {
        f"What mirrors add to the frame of {BASE}, ms":
            document.cross_table(both.sort_values("title", kind="stable"), HEADINGS, "label", "added"),
        "A mirrored ray, ns, and over a primary ray of the same structure":
            document.cross_table(bounced, HEADINGS, "label", "each"),
    }  # fmt: skip
    times = [(device, best_ratio(own)) for device, own in bounced.groupby("device_name", sort=False)]
    told = [
        f"On {device} the fastest grid takes {numbers.mean(own, 'ratio')} times as long for a mirrored ray as "
        "the fastest tree (geometric mean over scenes and numbers of bounces)."
        for device, own in times
        if len(own)
    ]
    finding = " ".join(told) or "No grid and tree were measured with mirrors."
    noisy = done[(done["mirrored_rays"] > 0) & done["mirrored_ns"].isna() & done["mirrored_ms"].notna()]
    lost = ", ".join(f"{row.title}, {row.label}, {row.light_label}" for row in noisy.itertuples())
    notes = [ABOUT] if len(bounced) else []
    if lost:
        notes.append(f"Lost in the noise of the frame, and left out: the mirrored rays of {lost}.")
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet, notes)


ABOUT = (
    "The scene's largest triangles, half of its area, are mirrors. Shadow rays of mirrored hits count in the frame, not in "
    "the time of a mirrored ray."
)


def best_ratio(bounced: DataFrame) -> DataFrame:
    """Time of a mirrored ray, fastest grid over fastest tree: ``ratio`` and ``ratio_spread`` by scene and bounces."""
    own = bounced.assign(kind=bounced["label"].map(KINDS)).sort_values("mirrored_ns")
    least = own.drop_duplicates(["kind", "scene", "light_label"]).set_index(["scene", "light_label"])
    sides = (least[least["kind"] == kind] for kind in ("grid", "tree"))
    ratio, around = compare.over(*(side[name] for side in sides for name in ("mirrored_ns", "mirrored_ns_spread")))
    return ratio.to_frame("ratio").assign(ratio_spread=around).dropna(subset="ratio")


EXPERIMENT = Experiment(
    "reflection", "Reflection: what mirrored rays cost in grids and in trees",
    {
        "quick": small(128, ("conference", "sibenik"), METHODS, 3.0, stage_samples=2, lightings=LIGHTINGS),
        "paper": large(SCENES, METHODS, deviation=0.01, lightings=LIGHTINGS),
    },
    draw,
)  # fmt: skip
