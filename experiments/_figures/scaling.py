"""Time against triangles, pixels and lights: a panel each, a line a method; and the exponents of growth, fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.report import points, style
from ...harness.report.sheet import title_of

COLUMNS = [*points.COMMON, "pixels", "sweep", "memory_bytes"]


@dataclass(frozen=True)
class Sweep:
    """What changes along a line: the column of a row that holds it, and how an axis names it."""

    name: str
    column: str
    axis: str


SWEEPS = (
    Sweep("triangles", "triangles", "triangles"),
    Sweep("pixels", "pixels", "pixels"),
    Sweep("lights", "light_count", "lights"),
)


PROPORTION = "dotted line"
PROPORTION_MEANS = "time in proportion, exponent 1"
"""What the grey line of each panel is: a legend and a report say the same."""


@dataclass(frozen=True)
class Growth:
    """time ~ x^exponent over the upper half of a line, least squares of logarithms.

    half   half the 95 % interval of the exponent; None where two points leave nothing to judge by
    """

    exponent: float
    half: float | None
    first: float
    last: float


def draw(folder: Path | str, quiet: bool, ours: str) -> list[Path]:
    """CSV, one picture of three panels, and text."""
    folder = Path(folder)
    rows = points.rows(folder)
    for r in rows:
        r["pixels"] = int(r["width"]) * int(r["height"])
    done = points.measured(rows)
    lines = {sweep.name: along(done, sweep) for sweep in SWEEPS}
    for name, found in lines.items():
        for line in found.values():
            for r in line:
                r["sweep"] = " ".join(dict.fromkeys([*str(r.get("sweep") or "").split(), name]))
    files = [points.write_csv(rows, folder / "scaling.csv", COLUMNS)]
    if done:
        files.append(picture(lines, ours, folder / "scaling.svg", scenes_of(done)))
    said = [text for sweep in SWEEPS[:2] for text in sentences(lines[sweep.name], sweep, ours)]
    said += further_lights(lines["lights"], ours)
    if done:
        said.append(
            f"Scenes: {scenes_of(done)}. {PROPORTION[:1].upper()}{PROPORTION[1:]}: {PROPORTION_MEANS}."
        )
    said += [
        f"Not measured: time against {sweep.axis}." for sweep in SWEEPS if done and not swept(lines, sweep)
    ]
    return points.report(
        folder, "scaling", "Scaling: time against triangles, pixels and lights", said, files, rows, quiet
    )


def along(rows: Sequence[dict[str, Any]], sweep: Sweep) -> dict[str, list[dict[str, Any]]]:
    """Each method's rows that differ in nothing but what is swept, in its order: through the commonest point."""
    others = [s.column for s in SWEEPS if s.column != sweep.column]
    places = [tuple(r[c] for c in others) for r in rows]
    if not places:
        return {}
    # The sweeps cross in one point; along each, more values of its own column are found there than elsewhere.
    most = max(
        dict.fromkeys(places),
        key=lambda p: len({r[sweep.column] for r, q in zip(rows, places, strict=True) if q == p}),
    )
    own = [r for r, place in zip(rows, places, strict=True) if place == most]
    labels = dict.fromkeys(r["label"] for r in own)
    return {x: sorted((r for r in own if r["label"] == x), key=lambda r: r[sweep.column]) for x in labels}


def growth(x: Sequence[float], ms: Sequence[float]) -> Growth | None:
    """The exponent over the upper half of the points, where fixed costs count least; four points at least."""
    count = max(4, (len(x) + 2) // 2)
    if len(x) < 2:
        return None
    u, v = np.log(np.asarray(x[-count:], float)), np.log(np.asarray(ms[-count:], float))
    slope, start = np.polyfit(u, v, 1)
    half = None
    if len(u) > 2:
        from scipy.stats import t

        left = v - (slope * u + start)
        error = np.sqrt(np.sum(left**2) / (len(u) - 2) / np.sum((u - u.mean()) ** 2))
        half = float(t.ppf(0.975, len(u) - 2) * error)
    return Growth(float(slope), half, float(x[-len(u)]), float(x[-1]))


def sentences(lines: dict[str, list[dict[str, Any]]], sweep: Sweep, ours: str) -> list[str]:
    """One sentence a sweep: the exponent of every method, ours first."""
    parts = []
    for label, line in sorted(lines.items(), key=lambda item: item[0] != ours):
        found = growth([r[sweep.column] for r in line], [r["total_ms"] for r in line])
        if found is None:
            continue
        interval = "" if found.half is None else f" ± {found.half:.2f}"
        parts.append(
            f"{label} {style.number(line[0]['total_ms'])} to {style.number(line[-1]['total_ms'])} ms, "
            f"exponent {found.exponent:.2f}{interval} from {short(found.first)} {sweep.axis}"
        )
    if not parts:
        return []
    values = [r[sweep.column] for line in lines.values() for r in line]
    return [f"{short(min(values))} to {short(max(values))} {sweep.axis}: {'; '.join(parts)}."]


def further_lights(lines: dict[str, list[dict[str, Any]]], ours: str) -> list[str]:
    """What a further light costs, as a share of a frame with one."""
    parts = []
    for label, line in lines.items():
        counts = [r["light_count"] for r in line]
        if len(set(counts)) < 2 or counts[0] != 1:
            continue
        slope = float(np.polyfit(counts, [r["total_ms"] for r in line], 1)[0])
        parts.append(
            f"{label} {style.number(slope)} ms, {slope / line[0]['total_ms']:.0%} of the first frame"
        )
    parts.sort(key=lambda text: not text.startswith(ours))
    return [f"A further light costs: {'; '.join(parts)}."] if parts else []


def short(value: float) -> str:
    """A count for people: 300k, 10M."""
    for unit, letter in ((1e6, "M"), (1e3, "k")):
        if value >= unit:
            return f"{value / unit:.3g}{letter}"
    return f"{value:g}"


def swept(lines: dict[str, dict[str, list[dict[str, Any]]]], sweep: Sweep) -> bool:
    """Whether any method was measured at more than one value of what is swept."""
    return any(len(line) > 1 for line in lines[sweep.name].values())


def scenes_of(rows: Sequence[dict[str, Any]]) -> str:
    """The scenes of rows by title, fewest triangles first; of many the first and the last."""
    titles = list(dict.fromkeys(title_of(r) for r in sorted(rows, key=lambda r: r["triangles"] or 0)))
    return (
        titles[0]
        if len(titles) == 1
        else f"{titles[0]} to {titles[-1]}"
        if len(titles) > 3
        else ", ".join(titles)
    )


def picture(lines: dict[str, dict[str, list[dict[str, Any]]]], ours: str, path: Path, scenes: str) -> Path:
    """A panel a sweep on logarithmic axes, one that was not measured said to be so; a dotted line shows proportion."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullLocator

    drawn = [sweep for sweep in SWEEPS if swept(lines, sweep)] or [SWEEPS[0]]
    missing = [sweep.axis for sweep in SWEEPS if not swept(lines, sweep)]
    labels = list(dict.fromkeys(label for sweep in drawn for label in lines[sweep.name]))
    labels.sort(key=lambda label: label != ours)
    colours = style.colours(labels)
    every = [r["total_ms"] for sweep in drawn for line in lines[sweep.name].values() for r in line]
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(2 * style.COLUMN_WIDTH, 2.9), layout="constrained")
        panels = figure.subplots(1, len(drawn), sharey=True, squeeze=False)[0]
        for axes, sweep in zip(panels, drawn, strict=True):
            for place, label in enumerate(labels):
                line = lines[sweep.name].get(label, [])
                axes.errorbar(
                    [r[sweep.column] for r in line], [r["total_ms"] for r in line],
                    yerr=[(r["iqr_ms"] or 0.0) / 2 for r in line], color=colours[label],
                    marker=points.MARKERS[place % 8], label=label, elinewidth=0.7,
                )  # fmt: skip
            values = points.in_order(r[sweep.column] for line in lines[sweep.name].values() for r in line)
            if len(values) > 1:
                start = 0.8 * min(every)
                axes.plot(
                    [values[0], values[-1]],
                    [start, start * values[-1] / values[0]],
                    color="0.7",
                    lw=0.9,
                    ls=":",
                    label=f"{PROPORTION}: {PROPORTION_MEANS}",
                )
            axes.set_xscale("log")
            axes.set_xticks(
                values, [short(v) for v in values], rotation=45, ha="right", rotation_mode="anchor"
            )
            axes.xaxis.set_minor_locator(NullLocator())
            if min(every) > 0.0:
                axes.set_ylim(0.7 * min(every), 1.4 * max(every))
            style.plain_log(axes)
            axes.set_xlabel(sweep.axis)
        panels[0].set_ylabel("ms a frame, everything rebuilt")
        handles, names = panels[0].get_legend_handles_labels()
        named = dict(
            sorted(zip(names, handles, strict=True), key=lambda entry: entry[0].startswith(PROPORTION))
        )
        figure.legend(
            list(named.values()), list(named), loc="outside upper center", ncols=len(named), frameon=False
        )
        absent = f"; against {' and '.join(missing)}: not measured" if missing else ""
        figure.supxlabel(f"{scenes}{absent}", fontsize=7)
        return points.save(figure, path)
