"""One change at a time from one configuration: how much of its time the whole frame then takes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import points, style
from .sheet import title_of

COLUMNS = [*points.COMMON, "ratio", "pairs", "primary_tests_per_ray", "shadow_tests_per_ray", "built"]
PARTS = (
    ("build", "build_ms"),
    ("trace", "trace_ms"),
    ("light build", "light_build_ms"),
    ("shadow", "shadow_ms"),
)


def draw(folder: Path | str, quiet: bool, base: str, order: Sequence[str]) -> list[Path]:
    """CSV, a drawing and text. ``base``: label of the configuration; ``order``: labels, as they are drawn."""
    folder = Path(folder)
    rows = points.rows(folder)
    add(rows, base)
    files = [points.write_csv(rows, folder / "ablation.csv", COLUMNS)]
    done = [r for r in points.measured(rows) if r.get("ratio")]
    if done:
        files.append(picture(done, base, order, folder / "ablation.svg"))
    title = f"Ablation: one change at a time from {base}"
    return points.report(folder, "ablation", title, sentences(done, base), files, rows, quiet)


def add(rows: Sequence[dict[str, Any]], base: str) -> None:
    """Add each row's time over that of ``base`` on the same scene, and its work."""
    known = {r["scene"]: r["total_ms"] for r in points.measured(rows) if r["label"] == base}
    for r in rows:
        if r.get("total_ms") is not None and r["scene"] in known:
            r["ratio"] = r["total_ms"] / known[r["scene"]]
        counted = r["counters"]
        r["pairs"] = sum(v for k, v in counted.items() if k.endswith(" pairs")) or None
        r["primary_tests_per_ray"] = _hundredth(counted.get("primary tests a hundred rays"))
        r["shadow_tests_per_ray"] = _hundredth(counted.get("shadow tests a hundred rays"))


def _hundredth(value: float | None) -> float | None:
    return None if value is None else value / 100


def mean_ratios(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Geometric mean over the scenes of each label's ratio."""
    labels = dict.fromkeys(r["label"] for r in rows)
    return {x: float(np.exp(np.mean([np.log(r["ratio"]) for r in rows if r["label"] == x]))) for x in labels}


def sentences(rows: Sequence[dict[str, Any]], base: str) -> list[str]:
    """The changes that help most and those that cost most, as geometric means over the scenes."""
    means = {k: v for k, v in mean_ratios(rows).items() if k != base}
    if not means:
        return ["Nothing to compare was measured."]
    scenes = {r["label"]: len({x["scene"] for x in rows if x["label"] == r["label"]}) for r in rows}

    def text(label: str) -> str:
        return f"{label} {means[label]:.2f} ({scenes[label]} scene{'s' if scenes[label] != 1 else ''})"

    ranked = sorted(means, key=lambda x: means[x])
    helps, costs = [x for x in ranked if means[x] < 0.97], [x for x in ranked[::-1] if means[x] > 1.03]
    result = [f"Frame time over that of {base}, geometric mean over the scenes."]
    result.append("Faster: " + (", ".join(map(text, helps)) or "none") + ".")
    result.append("Slower: " + (", ".join(map(text, costs)) or "none") + ".")
    same = [x for x in ranked if x not in helps and x not in costs]
    if same:
        result.append("Within 3 %: " + ", ".join(map(text, same)) + ".")
    return result


def picture(rows: Sequence[dict[str, Any]], base: str, order: Sequence[str], path: Path) -> Path:
    """A line of marks a change, one mark a scene; logarithmic, 1 is the unchanged configuration."""
    import matplotlib
    from matplotlib.figure import Figure

    labels = [x for x in order if any(r["label"] == x for r in rows)]
    labels += [x for x in dict.fromkeys(r["label"] for r in rows) if x not in labels]
    labels = [x for x in labels if x != base]
    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    with matplotlib.rc_context({**points.sheet_style(), "axes.grid.axis": "both"}):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 0.165 * len(labels) + 1.15), layout="constrained")
        axes = figure.subplots()
        axes.axvline(1.0, color="black", lw=0.8)
        for i, scene in enumerate(scenes):
            own = [r for r in rows if r["scene"] == scene and r["label"] in labels]
            axes.plot([r["ratio"] for r in own], [labels.index(r["label"]) for r in own], points.MARKERS[i % 8],
                      color=style.COLOURS[i % 8], label=title_of(own[0]) if own else scene, alpha=0.85)  # fmt: skip
        axes.set_yticks(range(len(labels)), labels)
        axes.set_ylim(len(labels) - 0.5, -0.5)
        axes.set_xscale("log")
        ticks = [t for t in (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20) if _within(t, [r["ratio"] for r in rows])]
        axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axes.minorticks_off()
        axes.set_xlabel(f"frame time over that of {base}")
        figure.legend(
            loc="outside upper center", ncols=2, frameon=False, handletextpad=0.3, columnspacing=1.0
        )
        return points.save(figure, path)


def _within(tick: float, values: Sequence[float]) -> bool:
    return min(values) / 2.5 <= tick <= max(values) * 2.5
