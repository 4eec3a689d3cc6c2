"""One change at a time from the paper's configuration, and one change at a time removed from ours: the gain of each.

Warp's tree, rebuilt every frame, is measured in the same run, and both configurations are compared with it. Culling needs
the exact triangle test and a scene that is declared closed; elsewhere it is listed as skipped, with the reason.
"""

from pathlib import Path

import numpy as np

from ..harness.report import compare, document, numbers, panels
from ..harness.report.dataframe import DataFrame
from ..harness.runner.planning.experiment import Entry, Experiment
from ._paper import METHOD, PAPER, SCENES, UNBALANCED, faithful, large, small

BASE = "paper-faithful"
BEST = "all of ours"
TREE = "Warp's tree rebuilt"
EXACT = "exact test"
CULLED = "exact test, back faces culled"

TAKEN_BACK = {
    "16 slices": ("slices", "light_slices"), "every slice spanned": ("depth_lists",),
    "Möller-Trumbore": ("triangle_test",), "world axes": ("aimed",), "float32 light coordinates": ("precision",),
    "clamped to the view": ("clamp",), "pairs without rays": ("skip_empty",), "radix sort": ("sort",),
    "2x2 of 8x8 tiles": ("k",), "r = 128": ("r",), "Algorithm 1": ("balancing",),
}  # fmt: skip
"""The differences of our best configuration from the paper's, setting by setting, by the paper's label for each."""


def without(label: str) -> Entry:
    """Our best configuration with one of its changes removed."""
    return Entry(METHOD, {key: PAPER[key] for key in TAKEN_BACK[label]}, f"ours with {label}")


LEFT_OUT = tuple(without(label) for label in TAKEN_BACK)

METHODS = (
    faithful(BASE),
    faithful("direct mapping, 16x16 tiles", tile="16", k="1"),
    faithful("direct mapping, 8x8 tiles", k="1"),
    faithful("4x4 of 4x4 tiles", tile="4", k="4"),
    faithful("no slices", slices="1", light_slices="1"),
    faithful("64 slices", slices="64", light_slices="64"),
    faithful("triangles in first slice only", depth_lists="nearest"),
    faithful("edge planes", triangle_test="edge_planes"),
    faithful(EXACT, triangle_test="exact"),
    faithful(CULLED, triangle_test="exact", cull="primary"),
    faithful(f"{CULLED}, lights too", triangle_test="exact", cull="primary+light"),
    faithful("two-angle map", light_map="two-angle"),
    faithful("cube map", light_map="cube"),
    faithful("aimed at the scene", aimed="true"),
    faithful("float64 light coordinates", precision="float64"),
    faithful("light not clamped", clamp="none"),
    faithful("light clamped to hits", clamp="hits"),
    faithful("64x64 light tiles", light_tiles="64"),
    faithful("256x256 light tiles", light_tiles="256"),
    faithful("pairs only where rays are", skip_empty="true"),
    faithful("counting sort", sort="counting"),
    faithful("r = 32", r="32"),
    faithful("r = 64", r="64"),
    faithful("r = 256", r="256"),
    faithful("no load balancing", r=UNBALANCED),
    faithful("chunks from tile counts", balancing="direct"),
    faithful("no shared memory", staging="none"),
    faithful("lists in chunks of 256", triangle_chunk="256"),
    Entry(METHOD, {}, BEST),
    Entry("warp_bvh", {}, TREE),
    *LEFT_OUT,
)

COLUMNS = [
    *document.COMMON, "ratio", "ratio_to_best", "pairs", "primary_tests_per_ray", "shadow_tests_per_ray", "built",
]  # fmt: skip
ORDER = [entry.label for entry in METHODS]
APART = [TREE, *(entry.label for entry in LEFT_OUT)]  # entries that are not a change to the paper's configuration
BASES = {"ratio": BASE, "ratio_to_best": BEST, "ratio_to_tree": TREE}


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The relative time of each change, one mark per scene: a drawing and a table per configuration; CSV."""
    frames = document.frames(folder)
    table = document.named(frames)
    for name, label in BASES.items():
        table[[name, f"{name}_spread"]] = compare.ratios(frames, frames["label"] == label)[["ratio", "spread"]]
    pairs = table.filter(regex=r"^counter\..* pairs$").sum(axis=1)
    table["pairs"] = pairs.where(pairs > 0)
    for rays in ("primary", "shadow"):
        table[f"{rays}_tests_per_ray"] = table.get(f"counter.{rays} tests a hundred rays", np.nan) / 100
    done = document.measured(table)
    apart, tables, pictures = done["label"].isin(APART), {}, []
    for name, own, ratio in (("ablation", done[~apart], "ratio"), ("ablation-ours", done[apart], "ratio_to_best")):
        own = own[own[ratio].notna() & (own["label"] != BASE)]
        below = f"frame time over that of {BASES[ratio]}"
        tables[below.capitalize()] = ratios(own[own["label"] != TREE], ratio)
        pictures.append(panels.dots(
            folder / f"{name}.svg", own, "label", ratio, "title", order=ORDER, whisker=f"{ratio}_spread", below=below
        ))  # fmt: skip
    both = done[done["label"].isin([BASE, BEST])]
    finding = numbers.ends(
        both, "ratio_to_tree", "label", f"Over {TREE}, {{}} takes {{}} times as long", " and {} {}",
        f"{TREE} was not measured",
    ) + f"{numbers.over(both)}. " + numbers.ends(
        done[~apart & ~done["label"].isin([BASE, BEST])], "ratio", "label",
        f"Of single changes to {BASE}, {{}} takes the least: {{}} times as long", "; {} takes the most: {}",
        f"No change to {BASE} was measured",
    ) + "."  # fmt: skip
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, pictures, quiet)


def ratios(own: DataFrame, column: str) -> DataFrame:
    """Scenes across, points down, the least geometric mean first; numbers have the digits that their spread carries."""
    wide = document.cross_table(
        own.assign(text=numbers.texts(own, column)), {"label": "configuration"}, "title", "text"
    )
    points, names = own.groupby("label"), wide["configuration"]
    wide.insert(1, "geometric mean", [numbers.mean(points.get_group(name), column) for name in names])
    return wide.loc[names.map(points[column].agg(compare.geometric)).sort_values(kind="stable").index]


EXPERIMENT = Experiment(
    "ablation", "Ablation: one change at a time from the paper's configuration, and from ours",
    {
        "quick": small(128, ("cloth", "buddha"), METHODS, 4.0, samples=1),
        "paper": large(SCENES, METHODS, deviation=0.01, timeout_s=300.0),
    },
    draw,
)  # fmt: skip
