"""Figure 11: time against the light's distance for several r, a panel a kind of rectangle and axes; time against r.

The paper's curve may come from two things: work (a rectangle that is not clamped to what is lit gets fewer and
fewer tiles onto it) and number format (light-space coordinates in float32). They are drawn apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.report import points
from .figure11_rows import AXES, CLAMPS, FORMATS, PRECISE, REJECTED, panel, short

COUNTED = ("light 0 pairs", "light 0 tiles with rays", "light 0 most rays in a tile", "light 0 chunks",
           "light 0 lanes", "light 0 rays", "light 0 list, longest", "shadow tests a hundred rays")  # fmt: skip
COLUMNS = [
    *points.COMMON, "clamp", "axes", "precision", "r", "traversal_ms", "without_balancing", "lane_fill",
    *(name.removeprefix("light 0 ").replace(", ", "_").replace(" ", "_") for name in COUNTED),
]  # fmt: skip
"""``without_balancing``: traversal without load balancing over that at this r, with the light at the same place."""


def draw(
    folder: Path | str,
    quiet: bool,
    traversal: str,
    clamps: Sequence[str],
    unbalanced: int,
    apart: Sequence[str],
) -> list[Path]:
    """CSV, three drawings and text.

    traversal   pattern of the passes that trace
    clamps      rows of panels
    unbalanced  the r that stands for no load balancing
    apart       labels of distances at which only number formats are compared
    """
    from . import figure11_plots as plots

    folder = Path(folder)
    rows = points.rows(folder)
    for r in rows:
        add(r, traversal)
    compare(rows, unbalanced)
    files = [points.write_csv(rows, folder / "figure11.csv", COLUMNS)]
    if points.measured(rows):
        files.append(plots.picture(rows, clamps, folder / "figure11.svg", unbalanced))
        files.append(plots.threshold_picture(rows, clamps, folder / "figure11-r.svg"))
        files.append(plots.tiles_picture(rows, clamps, folder / "figure11-tiles.svg"))
    title = "Figure 11: time against the distance of the light"
    return points.report(
        folder, "figure11", title, sentences(rows, clamps, unbalanced), files, rows, quiet, apart
    )


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


def compare(rows: Sequence[dict[str, Any]], unbalanced: int) -> None:
    """Add the time without load balancing over that with it, of the same panel and distance."""
    own = [r for r in points.measured(rows) if r["precision"] == PRECISE]
    without = {(r["clamp"], r["axes"], r["light_distance"]): r for r in own if r["r"] == unbalanced}
    for r in own:
        base = without.get((r["clamp"], r["axes"], r["light_distance"]))
        if base and r["traversal_ms"] and base["traversal_ms"]:
            r["without_balancing"] = base["traversal_ms"] / r["traversal_ms"]


def truth(value: Any) -> bool:
    """A setting as a bool, be it text or not."""
    return str(value).lower() in ("true", "1")


def span(rows: Sequence[dict[str, Any]], r: int, far: float, near: float = 1.0) -> float | None:
    """Traversal time of the lights at least ``far`` radii away over that of the nearest at ``near`` or more."""
    line = [x for x in points.measured(rows) if x["r"] == r and x["light_distance"] >= near]
    out = [x["traversal_ms"] for x in line if x["light_distance"] >= far]
    return float(np.median(out)) / line[0]["traversal_ms"] if out and line[0]["traversal_ms"] else None


def along(
    own: Sequence[dict[str, Any]], title: str, value: Callable[[dict[str, Any]], Any], form: str = ",.0f"
) -> str:
    """What a panel's rows have from the nearest light to the farthest, one value a distance, as a phrase; or ""."""
    line: dict[float, Any] = {}
    for x in own:
        known = value(x)
        if known is not None and x["light_distance"] not in line:
            line[x["light_distance"]] = known
    told = ", ".join(f"{known:{form}} at {short(d)}" for d, known in line.items())
    return f"; {title}: {told}" if told else ""


def sentences(rows: Sequence[dict[str, Any]], clamps: Sequence[str], unbalanced: int) -> list[str]:
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
                fastest = sorted(
                    (x for x in own if x["r"] != unbalanced), key=lambda x: (x["light_distance"], x["traversal_ms"])
                )  # fmt: skip
                result.append(
                    f"{CLAMPS[clamp]}, {axes}, {PRECISE}: shadow traversal with the light 10 radii away or more, over "
                    f"that at about one radius: {', '.join(parts)}"
                    + along(own, "tests a shadow ray", lambda x: hundredth(x.get("shadow_tests_a_hundred_rays")))
                    + along(own, "tiles that hold rays", lambda x: x.get("tiles_with_rays"))
                    + along(fastest, f"without load balancing (r = {unbalanced}), over the fastest r",
                            lambda x: x.get("without_balancing"), ".2f")
                    + "."
                )  # fmt: skip
    result += format_sentences(rows, clamps)
    result.append(
        "The paper: time grows as the light moves away, and breaking full tiles into chunks of r rays compensates."
    )
    return [*result, conclusion(rows, clamps)]


def hundredth(value: float | None) -> float | None:
    """A count a hundred rays as one a ray."""
    return None if value is None else value / 100


def beside(
    rows: Sequence[dict[str, Any]], clamp: str, axes: str, precision: str
) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Each measured row of a number format and that of the exact one at the same place and r, nearest light first."""
    exact = {(x["light_distance"], x["r"]): x for x in points.measured(panel(rows, clamp, axes))}
    coarse = points.measured(panel(rows, clamp, axes, precision))
    return [(x, exact[x["light_distance"], x["r"]]) for x in coarse if (x["light_distance"], x["r"]) in exact]


def format_sentences(rows: Sequence[dict[str, Any]], clamps: Sequence[str]) -> list[str]:
    """What other light-space coordinates cost against float64, at the farthest light where both have a time."""
    result = []
    for clamp in clamps:
        for axes in AXES.values():
            for precision in FORMATS:
                both = beside(rows, clamp, axes, precision)
                lost = [x for x in panel(rows, clamp, axes, precision) if x["status"] in REJECTED]
                if not both and not lost:
                    continue
                text = f"{CLAMPS[clamp]}, {axes}: in {precision}"
                if both:
                    slow, fine = both[-1]
                    pairs = slow["pairs"] / fine["pairs"] if slow.get("pairs") and fine.get("pairs") else None
                    text += f" {slow['total_ms'] / fine['total_ms']:.1f} times the frame time"
                    text += f" and {pairs:.1f} times the pairs" if pairs else ""
                    text += f" of {PRECISE} at {short(slow['light_distance'])} radii"
                    tiles = [x.get("tiles_with_rays") for x in (slow, fine)]
                    if None not in tiles:
                        text += f", tiles that hold rays {tiles[0]:,.0f} instead of {tiles[1]:,.0f}"
                told = [
                    f"{status} at {' and '.join(short(x['light_distance']) for x in lost if x['status'] == status)} radii"
                    for status in dict.fromkeys(x["status"] for x in lost)
                ]
                if told:
                    text += f"{';' if both else ''} {' and '.join(told)}"
                result.append(text + ".")
    return result


def conclusion(rows: Sequence[dict[str, Any]], clamps: Sequence[str]) -> str:
    """One sentence: how much of the growth with distance is workload, how much number format."""
    work = []
    for clamp in clamps:
        grown = [
            far[-1]["traversal_ms"] / far[0]["traversal_ms"]
            for axes in AXES.values()
            for far in [_line(panel(points.measured(rows), clamp, axes))]
            if len(far) > 1
        ]
        if grown:
            work.append(f"{between(grown)} {CLAMPS[clamp]}")
    text = "Conclusion: "
    if work:
        text += (
            f"in {PRECISE}, where distance rounds next to nothing away, the traversal of the farthest light over that at "
            f"about one radius is workload alone, times {' and '.join(work)}"
        )
    told = []
    for precision in FORMATS:
        ratios, lost = [], set()
        for clamp in clamps:
            for axes in AXES.values():
                ratios += [x["total_ms"] / y["total_ms"] for x, y in beside(rows, clamp, axes, precision)]
                lost |= {
                    x["light_distance"]
                    for x in panel(rows, clamp, axes, precision)
                    if x["status"] in REJECTED
                }
        if not ratios and not lost:
            continue
        frames = f"frames take {between(ratios)} times as long" if ratios else "no frame has a time"
        refused = f" or are rejected (from {short(min(lost))} radii on)" if lost else ", none is rejected"
        told.append(f"in {precision} {frames}{refused}")
    if told:
        text += f"{'; ' if work else ''}what changes at the same place and workload is number format: {'; '.join(told)}"
    return (
        f"{text}." if work or told else "Conclusion: too little was measured to tell work from number format."
    )


def _line(own: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows at the smallest r with the light about a radius away or more, nearest first."""
    smallest = min((x["r"] for x in own), default=0)
    return [x for x in own if x["r"] == smallest and x["light_distance"] >= 1.0 and x["traversal_ms"]]


def between(values: Sequence[float]) -> str:
    """The range of values, as "1.2 to 3.4"; one where they are alike."""
    low, high = (
        f"{x:,.0f}" if x >= 100 else f"{x:.1f}" if x >= 10 else f"{x:.2f}" for x in (min(values), max(values))
    )
    return low if low == high else f"{low} to {high}"
