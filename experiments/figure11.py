"""Figure 11 of the paper: time against the light's distance from the model, for several r.

The light moves from inside the model to 1e7 scene radii. The rectangle of the light's grid is unclamped or clamped,
its axes are the world's or aimed at the scene: workload. Light-space coordinates are float64, or, at one r, float32
and (aimed) float32 relative to the middle of the hit points: number format. In exact arithmetic a rectangle clamped to
what is lit has the same tiles at every large distance.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..harness.report import compare, document, panels, style
from ..harness.results.table import stage_ms
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
REJECTED = {"rejected": "x", "timeout": "+", "failed": "1"}
"""The mark at the upper edge of a panel for a point without a time, by its status."""
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
PANEL = ["clamp", "axes"]
PAPER_SAYS = "The paper: time grows as the light moves away, and breaking full tiles into chunks of r rays compensates."


def read(folder: Path) -> pd.DataFrame:
    """The points, nearest light first, with what their panel is, the time of the traversal alone, and the work counted."""
    frames = document.frames(folder)
    table = document.named(frames).sort_values("light_distance", kind="stable")
    table = table.assign(
        clamp=table["set.clamp"], precision=table["set.precision"], r=table["set.r"].astype(int)
    )
    table["axes"] = [AXES[str(value).lower() in ("true", "1")] for value in table["set.aimed"]]
    table["traversal_ms"] = stage_ms(table, "shadow", TRAVERSAL)
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
    one = table["file"].nunique() == 1
    for (name, title), own in table.groupby(["file", "title"], sort=False):
        done = document.measured(own)
        if done.empty:
            continue
        stem = "figure11" if one else f"figure11-{name}"
        files += [
            distance_picture(own, folder / f"{stem}.svg"),
            threshold_picture(done, folder / f"{stem}-r.svg"),
            tiles_picture(own, folder / f"{stem}-tiles.svg"),
        ]
        exact = done[done["precision"] == PRECISE]
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
    wide = (far / near).dropna().unstack("r").sort_index(axis=1)
    return titled(wide.map("{:.2f}".format, na_action="ignore").rename(columns=lambda r: f"r = {r}"))


def by_distance(exact: pd.DataFrame) -> pd.DataFrame:
    """Work and time at each distance: rows a rectangle, axes and quantity."""
    import pandas as pd

    best = exact[exact["r"] != int(UNBALANCED)].sort_values("traversal_ms", kind="stable")
    lines = {
        "traversal at the fastest r, ms": (best, "traversal_ms", style.number),
        f"without load balancing (r = {UNBALANCED}), over the fastest r": (best, "without_balancing", "{:.2f}".format),
        "tests per shadow ray": (exact, "tests_a_ray", "{:,.0f}".format),
        "tiles that hold rays": (exact, "tiles_with_rays", "{:,.0f}".format),
    }  # fmt: skip
    made = []
    for name, (rows, column, form) in lines.items():
        first = rows.groupby([*PANEL, "light_distance"], sort=False)[column].first().dropna().map(form)
        made.append(first.unstack("light_distance").assign(quantity=name).set_index("quantity", append=True))
    wide = pd.concat(made).sort_index(axis=1).rename(columns=short)
    return titled(wide.sort_index(level=PANEL, sort_remaining=False, kind="stable"))


def formats(own: pd.DataFrame) -> pd.DataFrame:
    """What light-space coordinates in another format cost: a row a rectangle, axes and format."""
    import pandas as pd

    made = []
    other = own[own["precision"] != PRECISE]
    for (clamp, axes, precision), rows in other.groupby([*PANEL, "precision"], sort=False):
        both = rows[rows["total_ms_over_exact"].notna()]
        lost = rows[rows["status"].isin(REJECTED)]
        line = {"rectangle": CLAMP_TITLES[clamp], "axes": axes, "format": precision}
        for x in both.tail(1).itertuples():
            line |= {"at, radii": short(x.light_distance), "frame time": f"x{x.total_ms_over_exact:,.2f}",
                     "pairs": f"x{x.pairs_over_exact:,.1f}",
                     "tiles that hold rays": f"{x.tiles_with_rays:,.0f} for {x.exact_tiles:,.0f}"}  # fmt: skip
        told = [f"{short(x.light_distance)} ({x.status})" for x in lost.itertuples()]
        made.append({**line, "not measured at, radii": ", ".join(told)})
    return pd.DataFrame(made).replace({"": None, "xnan": None, "nan for nan": None})


def conclusion(title: str, own: pd.DataFrame) -> str:
    """One sentence of a scene: how much of the growth with distance is work, how much number format."""
    rows = own[(own["precision"] == PRECISE) & (own["light_distance"] >= 1.0)].dropna(subset="traversal_ms")
    ends = rows[rows["r"] == rows["r"].min()].groupby(PANEL)["traversal_ms"]
    grown = (ends.last() / ends.first())[ends.count() > 1].groupby("clamp")
    known = [clamp for clamp in CLAMPS if clamp in grown.groups]
    work = " and ".join(f"{document.span(grown.get_group(clamp))} {CLAMP_TITLES[clamp]}" for clamp in known)
    text = [
        f"with the farthest light the traversal takes {work} times as long as at one radius ({PRECISE}: work)"
    ]
    text *= bool(work)
    for precision, other in own[own["precision"] != PRECISE].groupby("precision", sort=False):
        ratios = other["total_ms_over_exact"].dropna()
        lost = other.loc[other["status"].isin(REJECTED), "light_distance"]
        frames = f"{document.span(ratios)} times the frame" if len(ratios) else "no frame in time"
        refused = f", or it is rejected (from {short(lost.min())} radii on)" if len(lost) else ""
        text.append(f"the number format {precision} costs {frames}{refused}")
    return f"{title}: {'; '.join(text) or 'too little was measured to tell work from number format'}."


def titled(wide: pd.DataFrame) -> pd.DataFrame:
    """The index, rectangle and axes first, as columns of text."""
    plain = wide.rename_axis(columns=None).reset_index().rename(columns={"clamp": "rectangle"})
    return plain.assign(rectangle=plain["rectangle"].map(CLAMP_TITLES))


def line(axes: Any, own: pd.DataFrame, key: str, label: str, **look: Any) -> None:
    """A line through what was measured, and a mark at the panel's upper edge for each point that was not."""
    done = document.measured(own)
    axes.plot(done["light_distance"], done[key], alpha=0.9, label=label, **look)
    for status, lost in own[own["status"].isin(REJECTED)].groupby("status"):
        axes.plot(lost["light_distance"], [0.95] * len(lost), REJECTED[status], color=look["color"], ms=6, mew=1.6, ls="",
                  transform=axes.get_xaxis_transform(), clip_on=False,
                  label=f"{status} ({lost['precision'].iloc[0]})")  # fmt: skip


DISTANCE = "distance of the light from the middle, scene radii; "


def distance_picture(own: pd.DataFrame, path: Path) -> Path:
    """Panels: rectangles down, axes across; lines: r, and number formats. Both scales logarithmic and shared."""
    values = sorted(own.loc[own["precision"] == PRECISE, "r"].unique())
    size = (style.COLUMN_WIDTH, 1.55 * len(CLAMPS) + 1.2)
    with panels.sheet(path, size, len(CLAMPS), len(AXES), sharex=True, sharey=True) as (figure, grid):
        for place, axes in zip(itertools.product(CLAMPS, AXES.values()), grid.ravel(), strict=True):
            here = own[(own["clamp"] == place[0]) & (own["axes"] == place[1])]
            exact = here[here["precision"] == PRECISE]
            for i, r in enumerate(values):
                label = f"r = {r}{' (no balancing)' if r == int(UNBALANCED) else ''}"
                look = {"color": style.COLOURS[i], "marker": style.MARKERS[i]}
                line(axes, exact[exact["r"] == r], "traversal_ms", label, **look)
            for precision, look in LOOKS.items():
                rows = here[here["precision"] == precision]
                if len(rows):
                    line(axes, rows, "traversal_ms", f"{precision}, r = {rows['r'].iloc[0]}", **look)
            axes.set_title(f"{CLAMP_TITLES[place[0]]},\n{place[1]}", fontsize=6.5)
            axes.set(xscale="log", yscale="log", ymargin=0.14)
        figure.supxlabel(DISTANCE + own["title"].iloc[0], fontsize=6.5)
        figure.supylabel("shadow traversal, ms", fontsize=7)
    return path


def tiles_picture(own: pd.DataFrame, path: Path) -> Path:
    """A panel a rectangle: tiles of the light's grid that hold shadow rays against distance, the same for every r."""
    one = own.sort_values("r", kind="stable").drop_duplicates([*PANEL, "precision", "light_distance"])
    one = one.sort_values("light_distance", kind="stable")
    size = (style.COLUMN_WIDTH, 2.4)
    with panels.sheet(path, size, 1, len(CLAMPS), sharex=True, sharey=True) as (figure, grid):
        for clamp, axes in zip(CLAMPS, grid[0], strict=True):
            here = one[one["clamp"] == clamp]
            for (name, precision), rows in here.groupby(["axes", "precision"], sort=False):
                i = (PRECISE, *FORMATS).index(precision)
                hollow = {"mfc": "none", "ms": 6.0} if precision == CENTRED else {}
                line(axes, rows, "tiles_with_rays", f"{name}, {precision}", color=style.COLOURS[i],
                     marker=style.MARKERS[i], ls="-" if name == AXES[True] else "--", **hollow)  # fmt: skip
            axes.set_title(CLAMP_TITLES[clamp], fontsize=6.5)
            axes.set(xscale="log", yscale="log", ymargin=0.14)
        figure.supxlabel(DISTANCE + own["title"].iloc[0], fontsize=6.5)
        figure.supylabel("tiles that hold rays", fontsize=7)
    return path


def threshold_picture(done: pd.DataFrame, path: Path) -> Path:
    """Time, C_total and lane fill against r, lines: distances; columns: the two extremes of the panels above."""
    exact = done[done["precision"] == PRECISE]
    several = exact.groupby("light_distance")["r"].nunique() > 1
    distances = sorted(several.index[several] if several.any() else several.index)
    columns = [(CLAMPS[0], AXES[False]), (CLAMPS[-1], AXES[True])]
    measures = {"traversal_ms": "shadow traversal, ms", "chunks": "blocks, C_total", "lane_fill": "lane fill"}
    ticks: list[int] = []
    for r in sorted(map(int, exact["r"].unique())):  # labels that do not touch
        ticks += [r] * (not ticks or r >= 4 * ticks[-1])
    size = (style.COLUMN_WIDTH, 4.3)
    with panels.sheet(path, size, 3, 2, legend=3, sharex=True, sharey="row") as (figure, grid):
        for axes, ((key, title), (clamp, name)) in zip(
            grid.ravel(), itertools.product(measures.items(), columns), strict=True
        ):
            here = exact[(exact["clamp"] == clamp) & (exact["axes"] == name)].sort_values("r")
            for place, distance in enumerate(distances):
                rows = here[(here["light_distance"] == distance) & here[key].notna()]
                axes.plot(rows["r"], rows[key], color=style.COLOURS[place % 8], marker=style.MARKERS[place % 8],
                          label=f"{short(distance)} radi{'us' if distance == 1 else 'i'}", alpha=0.9)  # fmt: skip
            axes.set_xscale("log", base=2)
            axes.set_xticks(ticks, ticks)
            axes.minorticks_off()
            axes.set(**{"ylim": (0, 1.02)} if key == "lane_fill" else {"yscale": "log"})
            axes.set_ylabel(title if (clamp, name) == columns[0] else "")
            axes.set_title(f"{CLAMP_TITLES[clamp]}, {name}" * (key == "traversal_ms"), fontsize=6.5)
        figure.supxlabel(f"r, rays a block at most; {exact['title'].iloc[0]}", fontsize=7)
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
