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
FORMATS = (COARSE, CENTRED)
"""Number formats beside the exact one; the second is relative to the middle of the hit points, of aimed frames."""
LOOKS: dict[str, dict[str, Any]] = {
    COARSE: {"color": "black", "ls": "--", "marker": "s", "mfc": "black"},
    CENTRED: {"color": "#8C564B", "ls": ":", "marker": "o", "mfc": "none", "ms": 6.0},
}
"""How the number formats are drawn: the centred one hollow, so that what it lies upon is seen."""

COUNTED = {
    "pairs": "pairs", "tiles_with_rays": "tiles with rays", "most_rays_in_a_tile": "most rays in a tile", "chunks": "chunks",
    "lanes": "lanes", "rays": "rays", "list_longest": "list, longest",
}  # fmt: skip
COLUMNS = [
    *document.COMMON, "clamp", "axes", "precision", "r", "traversal_ms", "without_balancing", "lane_fill", *COUNTED,
    "shadow_tests_a_hundred_rays",
]  # fmt: skip
"""``without_balancing``: traversal without load balancing over that at this r, with the light at the same place."""
PANEL = ["rectangle", "axes"]
PAPER_SAYS = "The paper: time grows as the light moves away, and breaking full tiles into chunks of r rays compensates."


def read(folder: Path) -> pd.DataFrame:
    """The points, nearest light first, with what their panel is, the time of the traversal alone, and the work counted."""
    frames = document.frames(folder)
    table = document.named(frames)
    table["axes"] = table["set.aimed"].astype(str).str.lower().isin(["true", "1"]).map(AXES)
    table["clamp"], table["precision"] = table["set.clamp"], table["set.precision"]
    table["r"], table["rectangle"] = table["set.r"].astype(int), table["clamp"].map(CLAMP_TITLES)
    rank = {title: i for i, title in enumerate((*CLAMP_TITLES.values(), *AXES.values()))}
    table = table.sort_values(
        ["light_distance", *PANEL, "r"], key=lambda c: c.map(rank) if c.name in PANEL else c
    )
    table["traversal_ms"] = stage_ms(table, "shadow", TRAVERSAL)
    table["traversal_spread"] = table["key"].map(compare.pass_spread(samples(folder), "shadow", TRAVERSAL))
    for column, name in COUNTED.items():
        table[column] = table.get(f"counter.light 0 {name}", np.nan)
    table["shadow_tests_a_hundred_rays"] = table.get("counter.shadow tests a hundred rays", np.nan)
    table["tests_a_ray"] = table["shadow_tests_a_hundred_rays"] / 100
    table["lane_fill"] = table["rays"] / table["lanes"]
    exact = frames["set.precision"] == PRECISE
    place = (*compare.SAME, "set.clamp", "set.aimed")
    own, plain = compare.pairs(frames, exact & (frames["set.r"].astype(int) == int(UNBALANCED)), place)
    gain = stage_ms(plain, "shadow", TRAVERSAL) / stage_ms(own, "shadow", TRAVERSAL)
    table["without_balancing"] = table["key"].map(gain).where(table["precision"] == PRECISE)
    own, same = compare.pairs(frames, exact, (*place, "set.r"))
    for name in ("total_ms", "counter.light 0 pairs"):
        if name in own:
            table[f"{name.split()[-1]}_over_exact"] = table["key"].map(own[name] / same[name])
    tiles = same.get("counter.light 0 tiles with rays", same["total_ms"] * np.nan)
    table["exact_tiles"] = table["key"].map(tiles)
    return table


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Of each scene time against distance and against r, and tiles that hold rays; CSV, and what is work, what format."""
    table = read(folder)
    files = [document.write_csv(table, folder / "figure11.csv", COLUMNS)]
    tables: dict[str, pd.DataFrame] = {}
    findings = []
    for (name, title), own in table.groupby(["file", "title"], sort=False):
        exact = document.measured(own[own["precision"] == PRECISE])
        if document.measured(own).empty:
            continue
        stem = folder / ("figure11" if table["file"].nunique() == 1 else f"figure11-{name}")
        files += [
            distance_picture(own, stem.with_suffix(".svg")),
            threshold_picture(exact, stem.with_name(f"{stem.name}-r.svg")),
            tiles_picture(own, stem.with_name(f"{stem.name}-tiles.svg")),
        ]
        tables |= {
            f"{title}: shadow traversal with the light 10 radii away or more, over that at one, {PRECISE}": growth(exact),
            f"{title}: by the light's distance in radii, {PRECISE}": by_distance(exact),
            f"{title}: number formats against {PRECISE}, at the farthest light where both have a time": formats(own),
        }  # fmt: skip
        findings.append(conclusion(title, own))
    finding = " ".join(findings) or "Nothing was measured."
    apart = [lighting.label for lighting in FORMATS_PRESET.lightings]
    return document.write(
        folder, "figure11", EXPERIMENT.title, finding, tables, files, table, quiet, [PAPER_SAYS], apart
    )


def short(distance: float) -> str:
    """A distance as a person writes it: 0.1, 10, 1e5, 1e7."""
    return f"{distance:.0e}".replace("e+0", "e") if distance >= 1e4 else f"{distance:g}"


def growth(exact: pd.DataFrame) -> pd.DataFrame:
    """A row a rectangle and axes, a column an r: median of the far lights over the nearest at one radius or more."""
    beyond = exact[exact["light_distance"] >= 1.0]
    groups = [*PANEL, "r"]
    near = beyond.groupby(groups, sort=False)["traversal_ms"].first()
    far = beyond[beyond["light_distance"] >= 10.0].groupby(groups, sort=False)["traversal_ms"].median()
    rows = (far / near).dropna().map("{:.2f}".format).rename("text").reset_index()
    return document.cross_table(rows.assign(r=rows["r"].map("r = {}".format)), PANEL, "r", "text")


def by_distance(exact: pd.DataFrame) -> pd.DataFrame:
    """Work and time at each distance: rows a rectangle, axes and quantity."""
    import pandas as pd

    place = [*PANEL, "light_distance"]
    balanced = exact[exact["r"] != int(UNBALANCED)].sort_values("traversal_ms", kind="stable")
    best = balanced.drop_duplicates(place).sort_index()
    any_r = exact.drop_duplicates(place)
    quantities = {
        "traversal at the fastest r, ms": (best, document.carry(best["traversal_ms"], best["traversal_spread"])),
        f"without load balancing (r = {UNBALANCED}), over the fastest r":
            (best, best["without_balancing"].map("{:.2f}".format, na_action="ignore")),
        "tests per shadow ray": (any_r, any_r["tests_a_ray"].map("{:,.0f}".format, na_action="ignore")),
        "tiles that hold rays": (any_r, any_r["tiles_with_rays"].map("{:,.0f}".format, na_action="ignore")),
    }  # fmt: skip
    cells = pd.concat([rows.assign(quantity=name, text=text) for name, (rows, text) in quantities.items()])
    cells = cells.sort_values("light_distance", kind="stable")
    cells["distance"] = cells["light_distance"].map(short)
    made = document.cross_table(cells, [*PANEL, "quantity"], "distance", "text").dropna(thresh=4)
    return made.sort_values(PANEL, kind="stable")


def formats(own: pd.DataFrame) -> pd.DataFrame:
    """What light-space coordinates in another format cost: a row a rectangle, axes and format."""
    import pandas as pd

    made = []
    other = own[own["precision"] != PRECISE]
    for (rectangle, axes, precision), rows in other.groupby([*PANEL, "precision"]):
        lost = rows[rows["status"].isin(style.LOST)]
        line = {"rectangle": rectangle, "axes": axes, "format": precision}
        for x in rows[rows["total_ms_over_exact"].notna()].tail(1).itertuples():
            line |= {"at, radii": short(x.light_distance), "frame time": f"x{x.total_ms_over_exact:,.2f}",
                     "pairs": f"x{x.pairs_over_exact:,.1f}",
                     "tiles that hold rays": f"{x.tiles_with_rays:,.0f} for {x.exact_tiles:,.0f}"}  # fmt: skip
        told = [f"{short(x.light_distance)} ({x.status})" for x in lost.itertuples()]
        made.append({**line, "not measured at, radii": ", ".join(told)})
    return pd.DataFrame(made).replace({"": None, "xnan": None, "nan for nan": None})


def conclusion(title: str, own: pd.DataFrame) -> str:
    """One sentence of a scene: how much of the growth with distance is work, how much number format."""
    rows = own[(own["precision"] == PRECISE) & (own["light_distance"] >= 1.0)].dropna(subset="traversal_ms")
    ends = rows[rows["r"] == rows["r"].min()].groupby(PANEL, sort=False)["traversal_ms"]
    grown = (ends.last() / ends.first())[ends.count() > 1].groupby("rectangle", sort=False)
    work = " and ".join(f"{document.span(ratios)} {rectangle}" for rectangle, ratios in grown)
    text = [
        f"with the farthest light the traversal takes {work} times as long as at one radius ({PRECISE}: work)"
    ] * bool(work)
    for precision, other in own[own["precision"] != PRECISE].groupby("precision"):
        ratios = other["total_ms_over_exact"].dropna()
        lost = other.loc[other["status"].isin(style.LOST), "light_distance"]
        frames = f"{document.span(ratios)} times the frame" if len(ratios) else "no frame in time"
        refused = f", or it is rejected (from {short(lost.min())} radii on)" if len(lost) else ""
        text.append(f"the number format {precision} costs {frames}{refused}")
    return f"{title}: {'; '.join(text) or 'too little was measured to tell work from number format'}."


DISTANCE = "distance of the light from the middle, scene radii"


def distance_picture(own: pd.DataFrame, path: Path) -> Path:
    """Panels: rectangles and axes; lines: r, and number formats. Both scales logarithmic and shared."""
    exact = own["precision"] == PRECISE
    r = "r = " + own["r"].astype(str)
    balancing = r.where(own["r"] != int(UNBALANCED), r + " (no balancing)")
    rows = own.assign(
        line=balancing.where(exact, own["precision"] + ", " + r), panel=own["rectangle"] + ",\n" + own["axes"]
    )
    drawn = panels.looks(rows[exact].sort_values("r"), "line")
    drawn |= {
        name: LOOKS[precision]
        for name, precision in zip(rows["line"], own["precision"], strict=True)
        if precision in LOOKS
    }
    rows = rows.sort_values("precision", key=lambda c: c != PRECISE, kind="stable")  # formats lie on top
    size = (style.COLUMN_WIDTH, 1.55 * len(CLAMPS) + 1.2)
    with panels.lines(path, rows, "light_distance", "traversal_ms", size, hue="line", facet="panel", across=2,
                      whisker="traversal_spread", drawn=drawn, sharex=True, sharey=True) as (figure, places):  # fmt: skip
        for axes, _ in places:
            axes.set(xscale="log", yscale="log", ymargin=0.14)
        panels.caption(figure, DISTANCE, own["title"].iloc[0])
        figure.supylabel("shadow traversal, ms", fontsize=7)
    return path


def tiles_picture(own: pd.DataFrame, path: Path) -> Path:
    """A panel a rectangle: tiles of the light's grid that hold shadow rays against distance, the same for every r."""
    one = own.sort_values("r", kind="stable").drop_duplicates([*PANEL, "precision", "light_distance"])
    one = one.sort_values("light_distance", kind="stable").assign(line=one["axes"] + ", " + one["precision"])
    drawn: dict[str, dict[str, Any]] = {}
    for name, axes, precision in one[["line", "axes", "precision"]].drop_duplicates().itertuples(index=False):
        i = (PRECISE, *FORMATS).index(precision)
        drawn[name] = {
            "color": style.COLOURS[i],
            "marker": style.MARKERS[i],
            "ls": "-" if axes == AXES[True] else "--",
        }
        drawn[name] |= {"mfc": "none", "ms": 6.0} if precision == CENTRED else {}
    size, across = (style.COLUMN_WIDTH, 2.4), one["rectangle"].nunique()
    with panels.lines(path, one, "light_distance", "tiles_with_rays", size, hue="line", facet="rectangle", across=across,
                      drawn=drawn, sharex=True, sharey=True) as (figure, places):  # fmt: skip
        for axes, _ in places:
            axes.set(xscale="log", yscale="log", ymargin=0.14)
        panels.caption(figure, DISTANCE, own["title"].iloc[0])
        figure.supylabel("tiles that hold rays", fontsize=7)
    return path


def threshold_picture(exact: pd.DataFrame, path: Path) -> Path:
    """Time, C_total and lane fill against r, lines: distances; columns: the two extremes of the panels above."""
    several = exact.groupby("light_distance")["r"].transform("nunique") > 1
    exact = exact[several] if several.any() else exact
    measures = {"traversal_ms": "shadow traversal, ms", "chunks": "blocks, C_total", "lane_fill": "lane fill"}
    extremes = [(CLAMP_TITLES[CLAMPS[0]], AXES[False]), (CLAMP_TITLES[CLAMPS[-1]], AXES[True])]
    own = exact[exact[PANEL].apply(tuple, axis=1).isin(extremes)].sort_values(["r", "light_distance"])
    own = own.assign(
        distance=own["light_distance"].map(lambda x: f"{short(x)} radi{'us' if x == 1 else 'i'}")
    )
    rows = own.melt([*PANEL, "distance", "r", "status"], list(measures), "measure")
    rows = rows.dropna(subset="value").assign(panel=rows["rectangle"] + ", " + rows["axes"])
    ticks: list[int] = []
    for r in sorted(map(int, exact["r"].unique())):  # labels that do not touch
        ticks += [r] * (not ticks or r >= 4 * ticks[-1])
    size, across = (style.COLUMN_WIDTH, 4.3), max(1, rows["panel"].nunique())
    with panels.lines(path, rows, "r", "value", size, hue="distance", facet=["measure", "panel"], across=across, legend=3,
                      drawn=panels.looks(own.sort_values("light_distance"), "distance"), sharex=True,
                      sharey="row") as (figure, places):  # fmt: skip
        for place, (axes, here) in enumerate(places):
            measure, panel = here[["measure", "panel"]].iloc[0]
            axes.set_xscale("log", base=2)
            axes.set_xticks(ticks, ticks)
            axes.minorticks_off()
            axes.set(**{"ylim": (0, 1.02)} if measure == "lane_fill" else {"yscale": "log"})
            axes.set_ylabel("" if place % across else measures[measure])
            axes.set_title(panel if place < across else "", fontsize=6.5)
        panels.caption(figure, "r, rays a block at most", exact["title"].iloc[0])
    return path


# Between 1e3 and 1e7 radii only number formats differ: at 1e5 each is measured at one r. One round of few samples: an
# unclamped grid of a far light takes seconds a frame.
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
