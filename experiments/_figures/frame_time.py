"""How many times faster one method's whole frame is than the fastest of its peers, scene by scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.report import points, style
from ...harness.report import roofline as floor
from ...harness.report.sheet import error_text, title_of

PARTS = (
    ("build", "build_ms"),
    ("trace", "trace_ms"),
    ("light build", "light_build_ms"),
    ("shadow", "shadow_ms"),
)

COLUMNS = [*points.COMMON, "times_slower", "low", "high", "memory_bytes", "built"]


def draw(
    folder: Path | str,
    quiet: bool,
    ours: str,
    rebuild: Sequence[str],
    refit: Sequence[str],
    work_of: floor.WorkOf | None = None,
) -> list[Path]:
    """CSV, ratios, bars and text. ``ours``: label of the method; the others: labels of the two kinds of peers.

    ``work_of``: what our stages cannot do without; with it the floor is drawn, and told stage by stage.
    """
    folder = Path(folder)
    rows = points.rows(folder)
    add(rows, ours)
    files = [points.write_csv(rows, folder / "frame_time.csv", COLUMNS)]
    done = points.measured(rows)
    found = floor.stages(rows, ours, work_of) if work_of is not None else []
    if found:
        files.append(floor.write(found, folder / "frame_time-stages.csv"))
    if any(r["label"] == ours for r in done):
        files.append(picture(done, ours, folder / "frame_time.svg", floor.of_frames(found)))
    said = sentences(done, ours, {"rebuild": rebuild, "refit": refit}) + floor.sentence(rows, found, ours)
    return points.report(folder, "frame_time", "Frame time against every peer", said, files, rows, quiet)


def add(rows: Sequence[dict[str, Any]], ours: str) -> None:
    """Add each row's time over that of ``ours`` on the same scene, and its range by the range between rounds."""
    known = {r["scene"]: r for r in points.measured(rows) if r["label"] == ours}
    for r in rows:
        own = known.get(r["scene"])
        if own is None or r.get("total_ms") is None:
            continue
        r["times_slower"] = r["total_ms"] / own["total_ms"]
        half, own_half = (r.get("between_ms") or 0.0) / 2, (own.get("between_ms") or 0.0) / 2
        r["low"] = (r["total_ms"] - half) / (own["total_ms"] + own_half)
        r["high"] = (r["total_ms"] + half) / max(own["total_ms"] - own_half, 1e-9)


def fastest(rows: Sequence[dict[str, Any]], scene: str, labels: Sequence[str]) -> dict[str, Any] | None:
    """The fastest of some labels on a scene."""
    peers = [r for r in rows if r["scene"] == scene and r["label"] in labels and r.get("times_slower")]
    return min(peers, key=lambda r: r["total_ms"]) if peers else None


def sentences(rows: Sequence[dict[str, Any]], ours: str, kinds: dict[str, Sequence[str]]) -> list[str]:
    """A sentence a kind of peer: the ratio on every scene, with its range, and the least."""
    scenes = list(dict.fromkeys(r["scene"] for r in rows if r["label"] == ours))
    if not scenes:
        return [f"{ours} was not measured."]
    times = ", ".join(
        f"{title_of(r)} {r['total_ms']:.3g} ms" for r in rows if r["label"] == ours and r["scene"] in scenes
    )
    result = [f"Whole frame of {ours}, everything rebuilt: {times}."]
    for kind, labels in kinds.items():
        found = [(s, fastest(rows, s, labels)) for s in scenes]
        peers = [(s, r) for s, r in found if r is not None]
        if not peers:
            continue
        text = ", ".join(
            f"{title_of(r)} {r['times_slower']:.2f} ({r['low']:.2f} to {r['high']:.2f}; {r['label']})"
            for _, r in peers
        )
        least = min(r["times_slower"] for _, r in peers)
        mean = float(np.exp(np.mean([np.log(r["times_slower"]) for _, r in peers])))
        result.append(
            f"Times faster than the fastest {kind} peer: {text}. Least {least:.2f}, geometric mean {mean:.2f}."
        )
    return result


def picture(rows: Sequence[dict[str, Any]], ours: str, path: Path, floors: dict[str, float]) -> Path:
    """A group of stacked bars a scene, by part of the frame, beside each its time, its time over ours, and its wrong
    answers; a floor is a black tick.
    """
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    labels = list(dict.fromkeys(r["label"] for r in rows))
    labels = [ours, *(x for x in labels if x != ours)]
    tints = style.colours(labels)
    across = 1 if len(scenes) <= 3 else 2
    down = -(-len(scenes) // across)
    height = (0.125 * len(labels) + 0.28) * down + 0.75 + 0.12 * (across == 1)
    with matplotlib.rc_context({**points.sheet_style(), "axes.grid.axis": "x"}):
        figure = Figure(figsize=(style.COLUMN_WIDTH * (0.35 + 0.65 * across), height), layout="constrained")
        panels = figure.subplots(down, across, squeeze=False).flatten()
        for axes in panels[len(scenes) :]:
            axes.set_axis_off()
        named: list[str] = []
        cut = False
        for place, (axes, scene) in enumerate(zip(panels, scenes, strict=False)):
            own = sorted((r for r in rows if r["scene"] == scene), key=lambda r: labels.index(r["label"]))
            # A method many times slower than the rest would leave them no room: its bar is cut and says its time.
            limit = 4.0 * float(np.median([r["total_ms"] for r in own]))
            for k, r in enumerate(own):
                start = 0.0
                for n, (_, column) in enumerate(PARTS):
                    width = min(r[column] or 0.0, limit - start)
                    tint = style.lightened(tints[r["label"]], 0.24 * n)
                    axes.barh(k, width, left=start, color=tint, edgecolor=tints[r["label"]], lw=0.3)
                    start += width
                if r["label"] == ours and scene in floors:
                    axes.plot([floors[scene]] * 2, [k - 0.45, k + 0.45], color="black", lw=1.2)
                if r["total_ms"] > limit:
                    cut = True
                    axes.text(limit, k, "//", ha="center", va="center", fontsize=9)
                    start += 0.04 * limit
                end = min(max(start, r["total_ms"]), 1.04 * limit)
                axes.annotate(beside(r, ours), (end, k), (2, 0), color="#B00000" if r.get("true_errors") else "black",
                              textcoords="offset points", va="center", fontsize=5.5)  # fmt: skip
            names = [r["label"] for r in own]
            shown = place % across == 0 or names != named
            axes.set_yticks(range(len(own)), names if shown else [""] * len(own))
            named = names
            axes.set_ylim(len(own) - 0.4, -0.6)
            axes.set_xlim(0, 1.5 * min(limit, max(r["total_ms"] for r in own)))
            axes.set_title(title_of(own[0]), loc="left", fontsize=7)
        grey = "#333333"
        keys: list[Any] = [
            Patch(facecolor=style.lightened(grey, 0.24 * n), edgecolor=grey, lw=0.3, label=part)
            for n, (part, _) in enumerate(PARTS)
        ]
        if floors:
            keys.append(
                Line2D([], [], color="black", lw=1.2, marker="|", ls="", ms=6, label=f"floor of {ours}")
            )
        figure.legend(handles=keys, loc="outside upper center", ncols=5 if across == 2 else 3, frameon=False,
                      handlelength=1.2, columnspacing=1.0)  # fmt: skip
        wrong = (
            f"{style.WRONG} n: n wrong pixels and shadow bits"
            if any(r.get("true_errors") for r in rows)
            else ""
        )
        said = [f"ms a frame; 2.0x: twice the time of {ours}", wrong, "//: cut off" if cut else ""]
        figure.supxlabel(("\n" if across == 1 else "; ").join(text for text in said if text), fontsize=7)
        return points.save(figure, path)


def beside(r: dict[str, Any], ours: str) -> str:
    """What stands at a bar's end: three digits of its time, how often ours fits into it, what is wrong of its answers."""
    text = f"{digits(r['total_ms'])} ms"
    if r["label"] != ours and r.get("times_slower"):
        text += f", {digits(r['times_slower'])}x"
    told = error_text(r)
    return text if told == style.OK else f"{text}  {told.removesuffix(' wrong')}"


def digits(value: float) -> str:
    """A number with three digits, whatever its size: 0.312, 5.00, 61.3, 1,234."""
    places = max(0, 2 - math.floor(math.log10(abs(value)))) if value else 2
    return f"{value:,.{places}f}"
