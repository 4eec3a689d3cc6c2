"""A moving light: time of each frame along its path, a panel a scene, a line a method."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import points, style
from .sheet import title_of

COLUMNS = [*points.COMMON, "frame", "turn", "frame_ms", "frame_iqr_ms"]


def draw(folder: Path | str, quiet: bool = False) -> list[Path]:
    """CSV (one row a frame), a drawing, and text."""
    folder = Path(folder)
    rows = points.rows(folder)
    table = [step for r in points.measured(rows) for step in steps(r)]
    files = [points.write_csv(table, folder / "moving.csv", COLUMNS)]
    if table:
        files.append(picture(points.measured(rows), folder / "moving.svg"))
    sentences = [sentence(r) for r in points.measured(rows)]
    sentences.append(
        "The paper moves its lights too, and says that everything is rebuilt each frame; it shows no path."
    )
    return points.report(
        folder, "moving", "A moving light: time along its path", sentences, files, rows, quiet
    )


def steps(r: dict[str, Any]) -> list[dict[str, Any]]:
    """A row a frame: where the light is on its path, in turns, and the frame's median time."""
    last = max(1, (r["record"]["scene"].get("frame_count") or 1) - 1)
    made = []
    for frame in r["record"]["frames"]:
        if frame["total_ms"]:
            low, middle, high = np.percentile(frame["total_ms"], [25, 50, 75])
            turn = frame["frame"] / last * (r["light_turns"] or 0.0)
            made.append({**r, "frame": frame["frame"], "turn": turn, "frame_ms": float(middle)})
            made[-1]["frame_iqr_ms"] = float(high - low)
    return made


def sentence(r: dict[str, Any]) -> str:
    """Range of the times along the path."""
    times = [step["frame_ms"] for step in steps(r)]
    share = max(times) / min(times) - 1
    planned = len(r["record"]["scene"].get("frames") or ())
    left_out = f", of {planned}: the others were beyond the budget" if planned > len(times) else ""
    return (
        f"{title_of(r)}, {r['label']}: {style.number(min(times))} to {style.number(max(times))} ms over "
        f"{len(times)} places of the light (slowest {share:+.0%} over fastest{left_out})."
    )


def picture(rows: Sequence[dict[str, Any]], path: Path) -> Path:
    """One panel a scene; whiskers are the interquartile range of repeats."""
    import matplotlib
    from matplotlib.figure import Figure

    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    labels = list(dict.fromkeys(r["label"] for r in rows))
    colours = style.colours(r["method"] for r in rows)
    down = -(-len(scenes) // 2)
    across = min(2, len(scenes))
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 1.25 * down + 0.9), layout="constrained")
        grid = figure.subplots(down, across, squeeze=False, sharex=True).ravel()
        for axes, scene in zip(grid, scenes, strict=False):
            for r in (r for r in rows if r["scene"] == scene):
                line, place = steps(r), labels.index(r["label"])
                axes.errorbar(
                    [s["turn"] for s in line], [s["frame_ms"] for s in line],
                    yerr=[s["frame_iqr_ms"] / 2 for s in line], color=colours[r["method"]],
                    marker=points.MARKERS[place % 8], ms=2.5, elinewidth=0.6,
                )  # fmt: skip
                axes.set_title(title_of(r), fontsize=6.5)
            axes.set_ylim(bottom=0)
        for axes in grid[len(scenes) :]:
            axes.set_visible(False)
        figure.supxlabel("turns of the light about the scene", fontsize=7)
        figure.supylabel("ms a frame, everything rebuilt", fontsize=7)
        figure.legend(
            _handles(rows, labels, colours), labels, loc="outside upper center", ncols=2, frameon=False
        )
        return points.save(figure, path)


def _handles(rows: Sequence[dict[str, Any]], labels: Sequence[str], colours: dict[str, str]) -> list[Any]:
    from matplotlib.lines import Line2D

    method = {r["label"]: r["method"] for r in rows}
    return [
        Line2D([], [], color=colours[method[x]], marker=points.MARKERS[i % 8], ms=3, lw=1.1)
        for i, x in enumerate(labels)
    ]
