"""Figure 11: time against the light's distance for several r, a panel a kind of rectangle and axes; time against r.

The paper's curve may come from two things: work (a rectangle that is not clamped to what is lit gets fewer and
fewer tiles onto it) and number format (light-space coordinates in float32). They are drawn apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import points, style
from .sheet import title_of

CLAMPS = {"none": "unclamped", "view": "clamped to the view", "hits": "clamped to the hits"}
AXES = {False: "world axes", True: "aimed"}
PRECISE, COARSE = "float64", "float32"
COUNTED = ("light 0 pairs", "light 0 tiles with rays", "light 0 chunks", "light 0 lanes", "light 0 rays",
           "light 0 list, longest", "shadow tests a hundred rays")  # fmt: skip
COLUMNS = [
    *points.COMMON, "clamp", "axes", "precision", "r", "traversal_ms", "lane_fill",
    *(name.removeprefix("light 0 ").replace(", ", "_").replace(" ", "_") for name in COUNTED),
]  # fmt: skip
REJECTED = ("rejected", "timeout", "failed")


def draw(folder: Path | str, quiet: bool, traversal: str, clamps: Sequence[str]) -> list[Path]:
    """CSV, two drawings and text. ``traversal``: pattern of the passes that trace; ``clamps``: rows of panels."""
    folder = Path(folder)
    rows = points.rows(folder)
    for r in rows:
        add(r, traversal)
    files = [points.write_csv(rows, folder / "figure11.csv", COLUMNS)]
    if points.measured(rows):
        files.append(picture(rows, clamps, folder / "figure11.svg"))
        files.append(threshold_picture(rows, clamps, folder / "figure11-r.svg"))
    title = "Figure 11: time against the distance of the light"
    return points.report(folder, "figure11", title, sentences(rows, clamps), files, rows, quiet)


def add(r: dict[str, Any], traversal: str) -> None:
    """Add what the panels are chosen by, the time of the traversal alone, and the work that was counted."""
    known = r["set"]
    r.update(
        clamp=known["clamp"],
        axes=AXES[truth(known["aimed"])],
        precision=known["precision"],
        r=int(known["r"]),
    )
    r["traversal_ms"] = points.pass_ms(r["record"], "shadow", traversal) if r.get("total_ms") else None
    for name in COUNTED:
        column = name.removeprefix("light 0 ").replace(", ", "_").replace(" ", "_")
        r[column] = r["counters"].get(name)
    r["lane_fill"] = r["rays"] / r["lanes"] if r.get("lanes") else None


def truth(value: Any) -> bool:
    """A setting as a bool, be it text or not."""
    return str(value).lower() in ("true", "1")


def panel(
    rows: Sequence[dict[str, Any]], clamp: str, axes: str, precision: str = PRECISE
) -> list[dict[str, Any]]:
    """The rows of a panel, nearest light first."""
    own = [r for r in rows if (r["clamp"], r["axes"], r["precision"]) == (clamp, axes, precision)]
    return sorted(own, key=lambda r: r["light_distance"])


def span(rows: Sequence[dict[str, Any]], r: int, far: float, near: float = 1.0) -> float | None:
    """Traversal time of the lights at least ``far`` radii away over that of the nearest at ``near`` or more."""
    line = [x for x in points.measured(rows) if x["r"] == r and x["light_distance"] >= near]
    out = [x["traversal_ms"] for x in line if x["light_distance"] >= far]
    return float(np.median(out)) / line[0]["traversal_ms"] if out and line[0]["traversal_ms"] else None


def short(distance: float) -> str:
    """A distance as a person writes it: 0.1, 10, 1e7."""
    return f"{distance:g}".replace("e+0", "e")


def tests(own: Sequence[dict[str, Any]]) -> str:
    """Counted triangle tests a shadow ray, from the nearest light to the farthest; the same for every r."""
    line = {x["light_distance"]: x.get("shadow_tests_a_hundred_rays") for x in own}
    known = [(d, t) for d, t in line.items() if t is not None]
    if not known:
        return ""
    return "; tests a shadow ray: " + ", ".join(f"{t / 100:,.0f} at {short(d)}" for d, t in known)


def sentences(rows: Sequence[dict[str, Any]], clamps: Sequence[str]) -> list[str]:
    """Which part of the growth with distance is work, which number format, and what r does about it."""
    done = points.measured(rows)
    if not done:
        return ["Nothing was measured."]
    result = []
    for clamp in clamps:
        for axes in AXES.values():
            own = panel(done, clamp, axes)
            parts = []
            for r in points.in_order(x["r"] for x in own):
                grown = span(own, r, 10.0)
                if grown is not None:
                    parts.append(f"{grown:.2f} (r = {r})")
            if parts:
                result.append(
                    f"{CLAMPS[clamp]}, {axes}, {PRECISE}: shadow traversal with the light 10 radii away or more, over "
                    f"that at about one radius: {', '.join(parts)}{tests(own)}."
                )
    result += format_sentences(rows, clamps)
    result.append(
        "The paper: time grows as the light moves away, and breaking full tiles into chunks of r rays compensates."
    )
    return result


def format_sentences(rows: Sequence[dict[str, Any]], clamps: Sequence[str]) -> list[str]:
    """What float32 light-space coordinates cost against float64, at the farthest light where both have a time."""
    result = []
    for clamp in clamps:
        for axes in AXES.values():
            coarse = panel(rows, clamp, axes, COARSE)
            precise = {(x["light_distance"], x["r"]): x for x in points.measured(panel(rows, clamp, axes))}
            both = [
                (x, precise[x["light_distance"], x["r"]])
                for x in points.measured(coarse)
                if (x["light_distance"], x["r"]) in precise
            ]
            lost = [x for x in coarse if x["status"] in REJECTED]
            if not both and not lost:
                continue
            text = f"{CLAMPS[clamp]}, {axes}: in {COARSE}"
            if both:
                slow, fine = both[-1]
                pairs = slow["pairs"] / fine["pairs"] if slow.get("pairs") and fine.get("pairs") else None
                text += f" {slow['total_ms'] / fine['total_ms']:.1f} times the frame time"
                text += f" and {pairs:.1f} times the pairs" if pairs else ""
                text += f" of {PRECISE} at {short(slow['light_distance'])} radii"
            if lost:
                text += f"{',' if both else ''} {lost[0]['status']} from {short(lost[0]['light_distance'])} radii on"
            result.append(text + ".")
    return result


def picture(rows: Sequence[dict[str, Any]], clamps: Sequence[str], path: Path) -> Path:
    """Panels: clamps down, axes across; lines: r; dashes: float32. Both scales logarithmic and shared."""
    import matplotlib
    from matplotlib.figure import Figure

    values = points.in_order(x["r"] for x in rows)
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 1.5 * len(clamps) + 0.9), layout="constrained")
        grid = figure.subplots(len(clamps), len(AXES), sharex=True, sharey=True, squeeze=False)
        for i, clamp in enumerate(clamps):
            for j, name in enumerate(AXES.values()):
                axes = grid[i][j]
                for place, r in enumerate(values):
                    _line(axes, panel(rows, clamp, name), r, style.COLOURS[place], points.MARKERS[place], "-")
                    _line(axes, panel(rows, clamp, name, COARSE), r, "black", points.MARKERS[place], "--")
                axes.set_title(f"{CLAMPS[clamp]},\n{name}", fontsize=6.5)
                axes.set_xscale("log")
                axes.set_yscale("log")
        figure.supxlabel(
            f"distance of the light from the middle, scene radii; {title_of(rows[0])}", fontsize=6.5
        )
        figure.supylabel("shadow traversal, ms", fontsize=7)
        handles, labels = _handles(rows, values)
        figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False, columnspacing=1.0)
        return points.save(figure, path)


def _line(axes: Any, rows: Sequence[dict[str, Any]], r: int, colour: str, marker: str, dashes: str) -> None:
    own = [x for x in rows if x["r"] == r]
    done = points.measured(own)
    axes.plot([x["light_distance"] for x in done], [x["traversal_ms"] for x in done], dashes, color=colour,
              marker=marker, alpha=0.9)  # fmt: skip
    for x in own:
        if x["status"] in REJECTED:
            axes.plot(
                [x["light_distance"]], [0.94], "x", color=colour, ms=5, transform=axes.get_xaxis_transform()
            )


def _handles(rows: Sequence[dict[str, Any]], values: Sequence[int]) -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=style.COLOURS[i], marker=points.MARKERS[i], ms=3.5, lw=1.1)
        for i in range(len(values))
    ]
    labels = [f"r = {r}" for r in values]
    if any(x["precision"] == COARSE for x in rows):
        handles.append(Line2D([], [], color="black", ls="--", lw=1.1))
        labels.append(COARSE)
    if any(x["status"] in REJECTED for x in rows):
        handles.append(Line2D([], [], color="black", marker="x", ls="", ms=5))
        labels.append("not measured")
    return handles, labels


def threshold_picture(rows: Sequence[dict[str, Any]], clamps: Sequence[str], path: Path) -> Path:
    """Time, C_total and lane fill against r, lines: distances; columns: the two extremes of the panels above."""
    import matplotlib
    from matplotlib.figure import Figure

    done = points.measured(rows)
    columns = [(clamps[0], AXES[False]), (clamps[-1], AXES[True])]
    measures = (("traversal_ms", "shadow traversal, ms", "log"), ("chunks", "blocks, C_total", "log"),
                ("lane_fill", "lane fill", "linear"))  # fmt: skip
    distances = points.in_order(x["light_distance"] for x in done)
    values = points.in_order(x["r"] for x in done)
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 4.3), layout="constrained")
        grid = figure.subplots(len(measures), len(columns), sharex=True, sharey="row", squeeze=False)
        for j, (clamp, name) in enumerate(columns):
            own = panel(done, clamp, name)
            for i, (key, title, scale) in enumerate(measures):
                axes = grid[i][j]
                for place, distance in enumerate(distances):
                    line = sorted((x for x in own if x["light_distance"] == distance), key=lambda x: x["r"])
                    line = [x for x in line if x.get(key) is not None]
                    label = f"{short(distance)} radii" if i == j == 0 else None
                    axes.plot([x["r"] for x in line], [x[key] for x in line], color=style.COLOURS[place % 8],
                              marker=points.MARKERS[place % 8], label=label, alpha=0.9)  # fmt: skip
                axes.set_xscale("log", base=2)
                axes.set_xticks(values, [str(r) for r in values])
                axes.set_yscale(scale)
                if scale == "linear":
                    axes.set_ylim(0, 1.02)
                if j == 0:
                    axes.set_ylabel(title)
            grid[0][j].set_title(f"{CLAMPS[clamp]}, {name}", fontsize=6.5)
        figure.supxlabel(f"r, rays a block at most; {title_of(done[0])}", fontsize=7)
        figure.legend(loc="outside upper center", ncols=3, frameon=False, columnspacing=1.0)
        return points.save(figure, path)
