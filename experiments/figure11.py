"""Figure 11 of the paper: time against the light's distance from the model, for several r.

The light moves from inside the model to 1e7 scene radii. The rectangle of the light's grid is unclamped or clamped,
its axes are the world's or aimed at the scene: workload. Light-space coordinates are float64, or, at one r, float32
and (aimed) float32 relative to the middle of the hit points: number format. In exact arithmetic a rectangle clamped to
what is lit has the same tiles at every large distance.
"""

import itertools
from dataclasses import replace
from functools import partial
from pathlib import Path

from ..harness.errors import UserError
from ..harness.report import compare, document, numbers, panels, style
from ..harness.report.dataframe import DataFrame, Series
from ..harness.results.table import stage_ms
from ..harness.runner.planning.experiment import Entry, Experiment
from ..harness.scene.overrides import Lighting
from ._paper import UNBALANCED, faithful, large, small

CLAMPS = ("none", "hits")
VALUES = ("32", "64", "128")
LARGE = ("32", "64", "128", "256", "1024")  # at 1024x1024 these r divide hardly any tile
FORMAT_R = "64"  # the r at which number formats are compared

TRAVERSAL = ("shadow", "shadow rays")
PRECISE, COARSE, CENTRED = "float64", "float32", "float32-centred"
"""Number formats: the exact one; the others, of which the second is relative to the middle of the hit points."""


def entries(light_tiles: int, values: tuple[str, ...]) -> tuple[Entry, ...]:
    """Every r, and none, in float64 and one r in each other number format, for each rectangle and axes."""
    made = []
    # The exact test, so that the light's distance costs no answer; the other map is the subject of ablation.
    same = {"triangle_test": "exact", "light_map": "azimuth-elevation", "light_tiles": str(light_tiles)}
    for clamp, (aimed, axes) in itertools.product(CLAMPS, {"false": "world", "true": "aimed"}.items()):
        others = (COARSE, CENTRED) if axes == "aimed" else (COARSE,)
        for r, precision in [*((r, PRECISE) for r in values), *((FORMAT_R, other) for other in others)]:
            label = f"{clamp}, {axes}, {precision}, r={r}"
            made.append(faithful(label, clamp=clamp, aimed=aimed, precision=precision, r=r, **same))
    return tuple(made)


def distances(*radii: float) -> tuple[Lighting, ...]:
    return tuple(Lighting(f"{radius:g} radii", distance=radius) for radius in radii)


RECTANGLES = {"none": "unclamped", "view": "clamped to the view", "hits": "clamped to the hits"}
AXES = {False: "world axes", True: "aimed"}
TILES, RAYS, LANES = "counter.light 0 tiles with rays", "counter.light 0 rays", "counter.light 0 lanes"
COUNTED = [
    "counter.light 0 pairs", TILES, "counter.light 0 chunks", "counter.light 0 most rays in a tile", LANES, RAYS,
    "counter.light 0 list, longest", "counter.shadow tests a hundred rays",
]  # fmt: skip
BY_R = {"traversal_ms": "shadow traversal, ms", "counter.light 0 chunks": "blocks, C_total", "lane_fill": "lane fill"}
COLUMNS = [*document.COMMON, "set.clamp", "axes", "precision", "r", "traversal_ms", "lane_fill", *COUNTED]
PANEL = ["title", "rectangle", "axes"]
PAPER_SAYS = "The paper: time grows as the light moves away, and breaking full tiles into chunks of r rays compensates."


def aimed(table: DataFrame) -> Series:
    """Which points have their light's axes aimed at the scene."""
    return table["set.aimed"].astype(str).str.lower().isin(["true", "1"])


def read(folder: Path) -> DataFrame:
    """The points, nearest light first, with their panel, the traversal alone, and ``line``: r, with an inexact format.
    Those of other methods are left out, which have no such settings.
    """
    table = document.with_passes(document.read(folder), folder, {"traversal": TRAVERSAL})
    table = table[table["method"] == "perspective_spherical"].copy()
    if table.empty:
        raise UserError(
            f"{folder}: no point of perspective_spherical, which figure11 is about; it draws no other method"
        )
    table = table.reindex(columns=[*table, *(name for name in COUNTED if name not in table)])
    precision, r = table["set.precision"], "r = " + table["set.r"].astype(int).astype(str)
    r = r.replace(f"r = {UNBALANCED}", f"r = {UNBALANCED} (no balancing)")
    table = table.assign(
        axes=aimed(table).map(AXES), rectangle=table["set.clamp"].map(RECTANGLES), precision=precision,
        distance=table["light_distance"].map(style.radii), r=table["set.r"].astype(int),
        lane_fill=table[RAYS] / table[LANES], line=r.where(precision == PRECISE, precision + ", " + r),
    )  # fmt: skip
    table = document.arranged(table.sort_values("r", kind="stable"), "axes", [*AXES.values()])
    table = document.arranged(table, "rectangle", [*RECTANGLES.values()])
    return table.sort_values("light_distance", kind="stable")


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Time against distance, and tiles that hold rays; CSV with blocks and lane fill, and what is work and what format."""
    table = read(folder)
    exact = document.measured(table[table["precision"] == PRECISE])
    tables, pictures, finding = {}, list[Path | None](), "Nothing was measured."
    if len(exact):
        pictures = [*drawings(table, folder), by_r(table, exact, folder)]
        text = table["traversal_text"].where(table["status"] == "ok", table["status"])
        tables["Shadow traversal, ms, by the light's distance in radii"] = document.cross_table(
            table.assign(text=text), [*PANEL, "line"], "distance", "text"
        )
        far = exact[(exact["light_distance"] >= 1.0) & (exact["r"] == exact["r"].min())]
        ends = far.dropna(subset="traversal_ms").groupby(PANEL, sort=False)["traversal_ms"]
        grown = (ends.last() / ends.first())[ends.count() > 1].rename("ratio").reset_index()
        grown = grown.assign(what=grown["title"] + ", " + grown["rectangle"])
        told = [f"{ratio} times as long ({what})" for what, ratio in numbers.means(grown, "ratio", "what")]
        finding = (
            f"From the farthest light, shadow traversal takes {numbers.listed(told)} as from one radius ({PRECISE})."
        )
        finding = finding if told else "Shadow traversal was not measured at two distances."
    apart, notes = [lighting.label for lighting in FORMATS_PRESET.lightings], [PAPER_SAYS]
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, pictures, quiet, notes, apart=apart)


def balanced(frames: DataFrame) -> DataFrame:
    """Traversal, ms, of aimed axes in float64 by scene, rectangle and distance: ``without`` balancing, ``best`` with it."""
    own = frames[aimed(frames) & (frames["set.precision"] == PRECISE)]
    one, plain = compare.pairs(own, own["set.r"].astype(int) == int(UNBALANCED), (*compare.SAME, "set.clamp"))
    words = [f"{style.radii(x)} {'radius' if x == 1 else 'radii'}" for x in one["light_distance"]]
    one = one.assign(best=stage_ms(one, *TRAVERSAL), without=stage_ms(plain, *TRAVERSAL), distance=words)
    one = one[one["set.r"].astype(int) < int(UNBALANCED)]
    return one.loc[one.groupby(["scene", "scene_title", "set.clamp", "light_distance"])["best"].idxmin()]


def drawings(table: DataFrame, folder: Path) -> list[Path | None]:
    """Time against distance, one line per r or number format; and the tiles that hold rays, the same for every r."""
    titles = table["title"].unique()
    table["where"] = table["rectangle"] if len(titles) == 1 else table["title"] + ", " + table["rectangle"]
    table["panel"], table["formats"] = table["where"] + ", " + table["axes"], table["precision"] != PRECISE
    times = table.sort_values("formats", kind="stable")
    tiles = table.drop_duplicates(["where", "axes", "precision", "light_distance"])
    tiles = tiles.assign(line=tiles["axes"] + ", " + tiles["precision"])
    looks = panels.looks(times.sort_values(["formats", "r"]), "line")
    of_tiles = panels.looks(tiles, "line")
    for name, look in [*looks.items(), *of_tiles.items()]:
        # Number formats are dashed, the centred one hollow too, so that what it lies upon is seen.
        look |= {"ls": "--"} if COARSE in name else {}
        look |= {"mfc": "none", "ms": 6.0} if CENTRED in name else {}
    lines = partial(panels.lines, hue="line", across=2, log_x=10, sharex=True, sharey=True,
                    below="\n".join(["distance of the light from the middle, scene radii", *titles]))  # fmt: skip
    return [
        lines(folder / "figure11.svg", times, "light_distance", "traversal_ms", facet="panel", drawn=looks,
              whisker="traversal_spread", left="shadow traversal, ms"),
        lines(folder / "figure11-tiles.svg", tiles, "light_distance", TILES, facet="where",
              drawn=of_tiles, left="tiles that hold rays"),
    ]  # fmt: skip


def by_r(table: DataFrame, exact: DataFrame, folder: Path) -> Path | None:
    """Time, blocks and lane fill against r, one line per distance, of the two extremes of the panels."""
    several = exact.groupby("light_distance")["r"].transform("nunique") > 1
    own = table.loc[several[several | ~several.any()].index].sort_values(["light_distance", "r"])
    extremes = [(RECTANGLES[CLAMPS[0]], AXES[False]), (RECTANGLES[CLAMPS[-1]], AXES[True])]
    own = own[own.set_index(PANEL[1:]).index.isin(extremes)].assign(line=own["distance"] + " radii")
    across = max(1, own["panel"].nunique())
    own = own.melt(["panel", "line", "r", "status"], list(BY_R), "measure").dropna(subset="value")
    own["panel"] = own["measure"].map(BY_R) + "\n" + own["panel"]
    below = "\n".join(["r, most rays per block", *table["title"].unique()])
    return panels.lines(folder / "figure11-r.svg", own, "r", "value", hue="line", facet="panel", across=across, log_x=2,
                        ticks=str, high=1.4, legend=3, below=below, left="", sharex=True, sharey="row")  # fmt: skip


# Between 1e3 and 1e7 radii only number formats differ: at 1e5 each is measured at one r. One round of few samples: an
# unclamped grid of a far light takes seconds per frame.
FORMATS_PRESET = large(
    ("cloth",), entries(128, (FORMAT_R,)), 4.5, samples=3, most=10, deviation=0.01, stage_samples=1, timeout_s=120.0,
    lightings=distances(1e5), memory=16 << 30,
)  # fmt: skip

EXPERIMENT = Experiment(
    "figure11", "Figure 11: time against the distance of the light",
    {
        # Few rays, since each is tested against half of all triangles where the rectangle is unclamped and the light far:
        # there they share one tile, so that r has something to do.
        "quick": small(
            16, ("cloth",), entries(4, (*VALUES, UNBALANCED)), 0.8, samples=1, frames=3, timeout_s=180.0,
            lightings=distances(0.1, 1, 10, 1e3, 1e7), memory=256 << 20,
        ),
        "paper": replace(
            FORMATS_PRESET, methods=entries(128, (*LARGE, UNBALANCED)), lightings=distances(0.1, 1, 10, 1e3, 1e7),
            also=(FORMATS_PRESET,),
        ),
    },
    draw,
)  # fmt: skip
