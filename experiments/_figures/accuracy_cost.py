"""What each safety measure costs: a stacked bar a scene, the frame without them and what each one adds.

A measure's cost is the time of the point that has it less that of the point that lacks it and is otherwise the same.
A difference within the spread of the repeats is no cost: it is drawn at zero and said to be within the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...harness.report import points, style
from ...harness.report.sheet import title_of
from .accuracy_rows import Row, scenes, usable

Measure = tuple[str, str, str]
COLUMNS = (
    "scene scene_title device measure with without with_ms without_ms cost_ms noise_ms share within_noise "
    "wrong_with wrong_without"
).split()


ENOUGH = 4
"""Repeats below which nothing is known of the noise, and no difference of times is taken for a cost."""


def costs(made: Sequence[Row], measures: Sequence[Measure]) -> list[dict[str, Any]]:
    """One row a scene and measure of which both points were measured."""
    result = []
    for scene, own in scenes(usable(made)):
        by_label = {r["label"]: r for r in own}
        for name, with_, without in measures:
            if with_ not in by_label or without not in by_label:
                continue
            a, b = by_label[with_], by_label[without]
            noise = max(_spread(a), _spread(b)) if min(a["samples"], b["samples"]) >= ENOUGH else None
            cost = a["total_ms"] - b["total_ms"]
            result.append(
                {
                    "scene": scene,
                    "scene_title": title_of(a),
                    "device": a["device"],
                    "measure": name,
                    "with": with_,
                    "without": without,
                    "with_ms": a["total_ms"],
                    "without_ms": b["total_ms"],
                    "cost_ms": cost,
                    "noise_ms": noise,
                    "share": cost / b["total_ms"],
                    "within_noise": noise is None or abs(cost) <= noise,
                    "wrong_with": a["wrong_per_frame"],
                    "wrong_without": b["wrong_per_frame"],
                }
            )
    return result


def _spread(r: Row) -> float:
    """How well a point's time is known: the larger of its quartile range and the range between its rounds."""
    return float(max(r["iqr_ms"], r["between_ms"] or 0.0))


def draw(made: Sequence[Row], measures: Sequence[Measure], base: str, path: Path) -> list[Path]:
    """One bar a scene of the point ``base``, its frame split into the measures' costs and the rest."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    found = [c for c in costs(made, measures) if c["with"] == base]
    if not found:
        return []
    names = [name for name, _, _ in measures if any(c["measure"] == name for c in found)]
    number = {name: i + 1 for i, name in enumerate(names)}
    colour = {name: style.COLOURS[i % len(style.COLOURS)] for i, name in enumerate(names)}
    bars = list(dict.fromkeys((c["scene"], c["scene_title"]) for c in found))
    seen: set[str] = set()
    with matplotlib.rc_context(style.axes_style()):
        figure = Figure(figsize=(7.0, 0.62 * len(bars) + 1.3), layout="constrained")
        axes = figure.subplots()
        for place, (scene, _) in enumerate(bars):
            own = [c for c in found if c["scene"] == scene]
            total = own[0]["with_ms"]
            added = {c["measure"]: 0.0 if c["within_noise"] else max(0.0, c["cost_ms"]) for c in own}
            rest = max(0.0, total - sum(added.values()))
            axes.barh(
                place, 100 * rest / total, height=0.36, color="#cccccc", edgecolor="#888888", linewidth=0.4
            )
            left = rest
            for name in names:
                width = added.get(name, 0.0)
                if width > 0:
                    seen.add(name)
                    axes.barh(
                        place, 100 * width / total, left=100 * left / total, height=0.36, color=colour[name]
                    )
                left += width
            told = ";  ".join(_told(c, number[c["measure"]]) for c in own)
            axes.text(0.6, place + 0.36, f"{style.number(total)} ms.  {told}", fontsize=6.5, va="center",
                      bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6})  # fmt: skip
        axes.set_yticks(range(len(bars)), [title for _, title in bars])
        axes.set_ylim(len(bars) - 0.4, -0.35)
        axes.set_xlim(0, 100.5)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("share of the exact tree's frame, %")
        handles = [Patch(facecolor="#cccccc", edgecolor="#888888", linewidth=0.4, label="all else")]
        handles += [
            Patch(facecolor=colour[name], label=f"{number[name]}: {name}")
            if name in seen
            else Patch(
                facecolor="none", edgecolor="none", label=f"{number[name]}: {name} (no bar: adds no time)"
            )
            for name in names
        ]
        figure.legend(handles=handles, loc="outside upper center", ncols=2, frameon=False, handlelength=1.2)
        return [points.save(figure, path)]


def _told(c: dict[str, Any], number: int) -> str:
    if c["noise_ms"] is None:
        return f"{number}: too few repeats to tell"
    if c["within_noise"]:
        return f"{number}: within noise (±{style.number(c['noise_ms'])} ms)"
    return f"{number}: {c['cost_ms']:+.3g} ms ({c['share']:+.1%})"
