"""Figure 11 of the paper: time against the light's distance from the model, for several r.

The light moves from inside the model to 1e7 scene radii. The rectangle of the light's grid is unclamped or clamped,
its axes are the world's or aimed at the scene: workload. Light-space coordinates are float64, or, at one r, float32
and (aimed) float32 relative to the middle of the hit points: number format. In exact arithmetic a rectangle clamped to
what is lit has the same tiles at every large distance.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..harness.report import compare, document, panels, style
from ..harness.results.table import samples, stage_ms
from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import UNBALANCED, faithful

if TYPE_CHECKING:
    import pandas as pd

CLAMPS = ("none", "hits")
VALUES = ("32", "64", "128")
LARGE = ("32", "64", "128", "256", "1024")
"""At 1024x1024 a tile may hold thousands of rays: what happens where r hardly cuts them up."""

FORMAT_R = "64"
"""The r at which number formats are compared."""

TRAVERSAL = "shadow rays"


def entries(light_tiles: int, values: tuple[str, ...]) -> tuple[Entry, ...]:
    """Every r, and none, in float64 and one r in each other number format, for each rectangle and axes."""
    made = []
    for clamp in CLAMPS:
        for aimed in ("false", "true"):
            formats = ["float32", "float32-centred"] if aimed == "true" else ["float32"]
            runs = [(r, "float64") for r in values] + [(FORMAT_R, precision) for precision in formats]
            for r, precision in runs:
                label = f"{clamp}, {'aimed' if aimed == 'true' else 'world'}, {precision}, r={r}"
                # The exact test, so that the light's distance costs no answer; the other map is the subject of ablation.
                changes = {
                    "triangle_test": "exact",
                    "light_map": "azimuth-elevation",
                    "light_tiles": str(light_tiles),
                }
                made.append(faithful(label, clamp=clamp, aimed=aimed, precision=precision, r=r, **changes))
    return tuple(made)


def distances(*radii: float) -> tuple[Lighting, ...]:
    """The light at each of these distances."""
    return tuple(Lighting(f"{radius:g} radii", distance=radius) for radius in radii)


CLAMP_TITLES = {"none": "unclamped", "view": "clamped to the view", "hits": "clamped to the hits"}
AXES = {False: "world axes", True: "aimed"}
PRECISE, COARSE, CENTRED = "float64", "float32", "float32-centred"
"""Number formats: the exact one; the others, of which the second is relative to the middle of the hit points."""

COUNTED = {
    "pairs": "light 0 pairs", "tiles_with_rays": "light 0 tiles with rays", "chunks": "light 0 chunks",
    "most_rays_in_a_tile": "light 0 most rays in a tile", "lanes": "light 0 lanes", "rays": "light 0 rays",
    "list_longest": "light 0 list, longest", "shadow_tests_a_hundred_rays": "shadow tests a hundred rays",
}  # fmt: skip
COLUMNS = [
    *document.COMMON, "clamp", "axes", "precision", "r", "traversal_ms", "without_balancing", "lane_fill", *COUNTED,
]  # fmt: skip
"""``without_balancing``: traversal without load balancing over that at this r, with the light at the same place."""
PANEL = ["rectangle", "axes"]
PAPER_SAYS = "The paper: time grows as the light moves away, and breaking full tiles into chunks of r rays compensates."
DISTANCE = "distance of the light from the middle, scene radii"


def read(folder: Path) -> pd.DataFrame:
    """The points, nearest light first, with what their panel is, the time of the traversal alone, and the work counted.

    over_exact  frame time over that of the same point in the exact number format
    """
    frames, repeats = document.frames(folder), samples(folder)
    table = document.named(frames)
    table["axes"] = table["set.aimed"].astype(str).str.lower().isin(["true", "1"]).map(AXES)
    table["clamp"], table["precision"] = table["set.clamp"], table["set.precision"]
    table["r"], table["rectangle"] = table["set.r"].astype(int), table["clamp"].map(CLAMP_TITLES)
    rank = {title: i for i, title in enumerate((*CLAMP_TITLES.values(), *AXES.values()))}
    by = ["light_distance", *PANEL, "r"]
    table = table.sort_values(by, key=lambda c: c.map(rank) if c.name in PANEL else c)
    table["traversal_ms"] = stage_ms(table, "shadow", TRAVERSAL)
    table["traversal_spread"] = table["key"].map(compare.pass_spread(repeats, "shadow", TRAVERSAL))
    table["traversal"] = document.pass_texts(table, repeats, "shadow", TRAVERSAL)
    for column, name in COUNTED.items():
        table[column] = table.get(f"counter.{name}", np.nan)
    table["tests"] = table["shadow_tests_a_hundred_rays"] / 100
    table["lane_fill"] = table["rays"] / table["lanes"]
    table["distance"] = table["light_distance"].map(style.radii)

    exact = frames["set.precision"] == PRECISE
    place = (*compare.SAME, "set.clamp", "set.aimed")
    own, plain = compare.pairs(frames, exact & (frames["set.r"].astype(int) == int(UNBALANCED)), place)
    gain = stage_ms(plain, "shadow", TRAVERSAL) / stage_ms(own, "shadow", TRAVERSAL)
    table["without_balancing"] = table["key"].map(gain).where(table["precision"] == PRECISE)
    own, same = compare.pairs(frames, exact, (*place, "set.r"))
    table["over_exact"] = table["key"].map(own["total_ms"] / same["total_ms"])
    return table


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Of each scene time against distance and against r, and tiles that hold rays; CSV, and what is work, what format."""
    table = read(folder)
    tables, pictures, findings = {}, [], []
    for (name, title), own in table.groupby(["file", "title"], sort=False):
        exact = document.measured(own[own["precision"] == PRECISE])
        if document.measured(own).empty:
            continue
        stem = "figure11" if table["file"].nunique() == 1 else f"figure11-{name}"
        pictures += [
            distance_picture(own, folder / f"{stem}.svg"),
            threshold_picture(exact, folder / f"{stem}-r.svg"),
            tiles_picture(own, folder / f"{stem}-tiles.svg"),
        ]
        tables[f"{title}: by the light's distance in radii, {PRECISE}"] = by_distance(exact)
        findings.append(conclusion(title, own))
    apart = [lighting.label for lighting in FORMATS_PRESET.lightings]
    finding = " ".join(findings) or "Nothing was measured."
    notes = [PAPER_SAYS]
    return document.write(
        folder, EXPERIMENT, table, COLUMNS, finding, tables, pictures, quiet, notes, apart=apart
    )


def by_distance(exact: pd.DataFrame) -> pd.DataFrame:
    """Work and time at each distance at the fastest r: rows a rectangle, axes and quantity."""
    import pandas as pd

    balanced = exact[exact["r"] != int(UNBALANCED)].sort_values("traversal_ms", kind="stable")
    best = balanced.drop_duplicates([*PANEL, "light_distance"]).sort_values("light_distance", kind="stable")
    columns: document.Columns = {
        "traversal at the fastest r, ms": ("traversal", str),
        f"without load balancing (r = {UNBALANCED}), over the fastest r": ("without_balancing", "{:.2f}"),
        "tests per shadow ray": ("tests", "{:,.0f}"), "tiles that hold rays": ("tiles_with_rays", "{:,.0f}"),
    }  # fmt: skip
    cells = pd.concat([best[[*PANEL, "distance"]], document.texts(best, columns)], axis=1)
    cells = cells.melt([*PANEL, "distance"], var_name="quantity").dropna(subset="value")
    return document.cross_table(cells, [*PANEL, "quantity"], "distance", "value").sort_values(
        PANEL, kind="stable"
    )


def conclusion(title: str, own: pd.DataFrame) -> str:
    """One sentence of a scene: how much of the growth with distance is work, how much number format."""
    rows = own[(own["precision"] == PRECISE) & (own["light_distance"] >= 1.0)].dropna(subset="traversal_ms")
    ends = rows[rows["r"] == rows["r"].min()].groupby(PANEL, sort=False)["traversal_ms"]
    grown = (ends.last() / ends.first())[ends.count() > 1].groupby("rectangle", sort=False)
    text = []
    if work := " and ".join(f"{document.span(ratios)} {rectangle}" for rectangle, ratios in grown):
        far = "with the farthest light the traversal takes"
        text = [f"{far} {work} times as long as at one radius ({PRECISE}: work)"]
    for precision, other in own[own["precision"] != PRECISE].groupby("precision"):
        ratios = other["over_exact"].dropna()
        lost = other.loc[other["status"].isin(style.LOST), "light_distance"]
        frames = f"{document.span(ratios)} times the frame" if len(ratios) else "no frame in time"
        refused = f", or it is rejected (from {style.radii(lost.min())} radii on)" if len(lost) else ""
        text.append(f"the number format {precision} costs {frames}{refused}")
    return f"{title}: {'; '.join(text) or 'too little was measured to tell work from number format'}."


def looks(rows: pd.DataFrame) -> dict[Any, dict[str, Any]]:
    """How lines are drawn: number formats dashed, the centred one hollow too, so that what it lies upon is seen."""
    drawn = panels.looks(rows, "line")
    for name, look in drawn.items():
        look |= {"ls": "--"} if COARSE in name else {}
        look |= {"mfc": "none", "ms": 6.0} if CENTRED in name else {}
    return drawn


def distance_picture(own: pd.DataFrame, path: Path) -> Path:
    """Panels: rectangles and axes; lines: r, and number formats. Both scales logarithmic and shared."""
    exact, r = own["precision"] == PRECISE, "r = " + own["r"].astype(str)
    balancing = r.where(own["r"] != int(UNBALANCED), r + " (no balancing)")
    line = balancing.where(exact, own["precision"] + ", " + r)
    rows = own.assign(line=line, panel=own["rectangle"] + ", " + own["axes"], coarse=~exact)
    order = looks(rows.sort_values(["coarse", "r"]))
    rows = rows.sort_values("coarse", kind="stable")  # formats lie on top
    return panels.lines(
        path, rows, "light_distance", "traversal_ms", hue="line", facet="panel", across=2, whisker="traversal_spread",
        drawn=order, log_x=10, below=[DISTANCE, own["title"].iloc[0]], left="shadow traversal, ms", sharex=True, sharey=True,
    )  # fmt: skip


def tiles_picture(own: pd.DataFrame, path: Path) -> Path:
    """A panel a rectangle: tiles of the light's grid that hold shadow rays against distance, the same for every r."""
    rows = own.drop_duplicates([*PANEL, "precision", "light_distance"])
    rows = rows.assign(line=rows["axes"] + ", " + rows["precision"])
    return panels.lines(
        path, rows, "light_distance", "tiles_with_rays", hue="line", facet="rectangle", across=2, drawn=looks(rows),
        log_x=10, below=[DISTANCE, own["title"].iloc[0]], left="tiles that hold rays", sharex=True, sharey=True,
    )  # fmt: skip


def threshold_picture(exact: pd.DataFrame, path: Path) -> Path:
    """Time, C_total and lane fill against r, lines: distances; columns: the two extremes of the panels above."""
    several = exact.groupby("light_distance")["r"].transform("nunique") > 1
    exact = exact[several] if several.any() else exact
    measures = {"traversal_ms": "shadow traversal, ms", "chunks": "blocks, C_total", "lane_fill": "lane fill"}
    extremes = [(CLAMP_TITLES[CLAMPS[0]], AXES[False]), (CLAMP_TITLES[CLAMPS[-1]], AXES[True])]
    own = exact[exact[PANEL].apply(tuple, axis=1).isin(extremes)].sort_values(["light_distance", "r"])
    own = own.assign(line=own["distance"] + " radii")
    rows = own.melt([*PANEL, "line", "r", "status"], list(measures), "measure").dropna(subset="value")
    rows["panel"] = rows["measure"].map(measures) + "\n" + rows["rectangle"] + ", " + rows["axes"]
    return panels.lines(
        path, rows, "r", "value", hue="line", facet="panel", across=max(1, own[PANEL].drop_duplicates().shape[0]), log_x=2,
        ticks=str, high=1.4, legend=3, below=["r, rays a block at most", exact["title"].iloc[0]], left="", sharex=True,
        sharey="row",
    )  # fmt: skip


# Between 1e3 and 1e7 radii only number formats differ: at 1e5 each is measured at one r. One round of few samples: an
# unclamped grid of a far light takes seconds per frame.
FORMATS_PRESET = Preset(
    1024, 1024, ("cloth",), entries(128, (FORMAT_R,)), frames=1, samples=3, most=10, deviation=0.01, stage_samples=5,
    rounds=1, budget_s=0.2, timeout_s=120.0, lightings=distances(1e5), memory=16 << 30,
)  # fmt: skip

EXPERIMENT = Experiment(
    name="figure11",
    title="Figure 11: time against the distance of the light",
    presets={
        # Few rays, since each is tested against half of all triangles where the rectangle is unclamped and the light far:
        # there they share one tile, so that r has something to do.
        "quick": Preset(
            16, 16, ("cloth",), entries(4, (*VALUES, UNBALANCED)), frames=3, samples=1, most=1, stage_samples=1, rounds=1,
            budget_s=0.8, timeout_s=180.0, lightings=distances(0.1, 1, 10, 1e3, 1e7), memory=256 << 20,
        ),
        "paper": Preset(
            1024, 1024, ("cloth",), entries(128, (*LARGE, UNBALANCED)), frames=1, samples=3, most=10, deviation=0.01,
            stage_samples=5, rounds=1, budget_s=0.2, timeout_s=120.0, lightings=distances(0.1, 1, 10, 1e3, 1e7),
            memory=16 << 30, also=(FORMATS_PRESET,),
        ),
    },
    draw=draw,
)  # fmt: skip
