"""One change at a time, from the paper's configuration and back from ours: how much time the whole frame takes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.report import points, style
from ...harness.report.sheet import title_of

COLUMNS = [
    *points.COMMON,
    "ratio",
    "ratio_to_best",
    "pairs",
    "primary_tests_per_ray",
    "shadow_tests_per_ray",
    "built",
]
PARTS = (
    ("build", "build_ms"),
    ("trace", "trace_ms"),
    ("light build", "light_build_ms"),
    ("shadow", "shadow_ms"),
)


def draw(
    folder: Path | str, quiet: bool, base: str, best: str, tree: str, order: Sequence[str], left_out: Sequence[str]
) -> list[Path]:  # fmt: skip
    """CSV, two drawings and text. Labels: of the configuration that changes are made to (``base``) and of the ``best``,
    from which those ``left_out`` differ; of the ``tree`` that it is held against; and all in ``order``.
    """
    folder = Path(folder)
    rows = points.rows(folder)
    add(rows, base, best)
    files = [points.write_csv(rows, folder / "ablation.csv", COLUMNS)]
    done = points.measured(rows)
    apart = (*left_out, tree)
    changed = [r for r in done if r.get("ratio") and r["label"] not in apart]
    if changed:
        files.append(picture(changed, base, order, folder / "ablation.svg"))
    back = [r for r in done if r.get("ratio_to_best") and r["label"] in (best, *apart)]
    if any(r["label"] in apart for r in back):
        files.append(picture(back, best, order, folder / "ablation-ours.svg", "ratio_to_best"))
    said = sentences(changed, base) + against_tree(done, best, base, tree) + taken_back(back, best, left_out)
    title = f"Ablation: one change at a time from {base}, and from {best}"
    return points.report(folder, "ablation", title, said, files, rows, quiet)


def add(rows: Sequence[dict[str, Any]], base: str, best: str) -> None:
    """Add each row's time over that of ``base`` and over that of ``best`` on the same scene in the same run, and its
    work. Runs in one folder are told apart by the environments that they were made in.
    """
    for column, label in (("ratio", base), ("ratio_to_best", best)):
        known = {place(r): r["total_ms"] for r in points.measured(rows) if r["label"] == label}
        for r in rows:
            if r.get("total_ms") is not None and place(r) in known:
                r[column] = r["total_ms"] / known[place(r)]
    for r in rows:
        counted = r["counters"]
        r["pairs"] = sum(v for k, v in counted.items() if k.endswith(" pairs")) or None
        r["primary_tests_per_ray"] = _hundredth(counted.get("primary tests a hundred rays"))
        r["shadow_tests_per_ray"] = _hundredth(counted.get("shadow tests a hundred rays"))


def place(r: dict[str, Any]) -> tuple[str, str]:
    """What rows must have in common to be compared: the scene, and the environment."""
    return r["scene"], r["environment"]


def _hundredth(value: float | None) -> float | None:
    return None if value is None else value / 100


def mean_ratios(rows: Sequence[dict[str, Any]], column: str = "ratio") -> dict[str, float]:
    """Geometric mean over the scenes of each label's ratio."""
    labels = dict.fromkeys(r["label"] for r in rows)
    return {x: float(np.exp(np.mean([np.log(r[column]) for r in rows if r["label"] == x]))) for x in labels}


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


def against_tree(rows: Sequence[dict[str, Any]], best: str, base: str, tree: str) -> list[str]:
    """Our best configuration's frame time over the tree's of the same run on each scene, and that of ``base``."""
    known = {(*place(r), r["label"]): r for r in rows}
    parts, slower = [], []
    for where in dict.fromkeys(map(place, rows)):
        own, other, first = (known.get((*where, label)) for label in (best, tree, base))
        if own is None or other is None:
            continue
        ratio = own["total_ms"] / other["total_ms"]
        text = f"{title_of(own)} {ratio:.2f} ({style.number(own['total_ms'])} of {style.number(other['total_ms'])} ms"
        parts.append(text + (f"; {base} {first['total_ms'] / other['total_ms']:.2f})" if first else ")"))
        slower += [title_of(own)] * (ratio > 1)
    if not parts:
        return [f"{best} and {tree} were not both measured in one run on any scene."]
    verdict = f"slower on {', '.join(slower)}" if slower else f"no slower on any of {len(parts)} scenes"
    return [f"Frame time of {best} over that of {tree}, same run: {', '.join(parts)}: {verdict}."]


def taken_back(rows: Sequence[dict[str, Any]], best: str, left_out: Sequence[str]) -> list[str]:
    """What each change of ours is worth where all the others are made: most first, as geometric means."""
    means = {k: v for k, v in mean_ratios(rows, "ratio_to_best").items() if k in left_out}
    ranked = sorted(means, key=lambda x: -means[x])
    text = ", ".join(f"{label} {means[label]:.2f}" for label in ranked)
    return [f"Frame time over that of {best} with one of its changes taken back: {text}."] if text else []


def picture(
    rows: Sequence[dict[str, Any]], base: str, order: Sequence[str], path: Path, column: str = "ratio"
) -> Path:
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
            axes.plot([r[column] for r in own], [labels.index(r["label"]) for r in own], points.MARKERS[i % 8],
                      color=style.COLOURS[i % 8], label=title_of(own[0]) if own else scene, alpha=0.85)  # fmt: skip
        axes.set_yticks(range(len(labels)), labels)
        axes.set_ylim(len(labels) - 0.5, -0.5)
        axes.set_xscale("log")
        ticks = [t for t in (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20) if _within(t, [r[column] for r in rows])]
        axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axes.minorticks_off()
        axes.set_xlabel(f"frame time over that of {base}", loc="right")  # longer than the axes are wide
        figure.legend(
            loc="outside upper center", ncols=2, frameon=False, handletextpad=0.3, columnspacing=1.0
        )
        return points.save(figure, path)


def _within(tick: float, values: Sequence[float]) -> bool:
    return min(values) / 2.5 <= tick <= max(values) * 2.5
