"""Frame time against wrong pixels: one panel a scene, one marker a family of knobs, the frontier as a line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import points
from .accuracy_rows import Row, families, scenes, usable
from .sheet import title_of

FLOOR = 0.5
"""Where zero wrong pixels stand on the logarithmic axis: every count is raised by one half."""

BOTTOM = 0.06
"""Lower end of the band in which points without a wrong answer are spread out, a height for each family."""


def draw(made: Sequence[Row], path: Path) -> list[Path]:
    """Draw the rows that have time and error; nothing where there is none. Returns the file written."""
    import matplotlib
    from matplotlib.figure import Figure

    known = usable(made)
    if not known:
        return []
    looks = families(made)
    panels = scenes(known)
    across = min(2, len(panels))
    down = -(-len(panels) // across)
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(3.5 * across, 2.9 * down + 0.75), layout="constrained")
        axes = figure.subplots(down, across, squeeze=False).ravel()
        for place, (_, own) in zip(axes, panels, strict=False):
            _panel(place, own, looks)
        for place in axes[len(panels) :]:
            place.set_axis_off()
        figure.supxlabel("ms a frame (bars: quartiles of repeats)", fontsize=7)
        figure.supylabel("wrong answers a frame + ½", fontsize=7)
        _legend(figure, {r["family"] for r in known}, looks)
        return [points.save(figure, path)]


def _panel(axes: Any, rows: Sequence[Row], looks: dict[str, tuple[str, str]]) -> None:
    import matplotlib.ticker

    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.axhspan(BOTTOM, FLOOR * 1.2, color="#e8f2e8", zorder=0)
    axes.text(0.99, FLOOR * 1.1, "no wrong answer (one height a family)", transform=axes.get_yaxis_transform(),
              ha="right", va="top", fontsize=5.5, color="#446644")  # fmt: skip
    heights = _heights(looks)
    line = sorted((r for r in rows if r["on_frontier"]), key=lambda r: r["total_ms"])
    axes.step(
        [r["total_ms"] for r in line], [_height(r, heights) for r in line], where="post",
        color="#bbbbbb", linewidth=2.5, zorder=1, solid_joinstyle="round",
    )  # fmt: skip
    for r in rows:
        colour, marker = looks[r["family"]]
        low, high = r["quartiles"]
        ends = [[max(0.0, r["total_ms"] - low)], [max(0.0, high - r["total_ms"])]]
        axes.errorbar(
            r["total_ms"], _height(r, heights), xerr=ends, fmt=marker, color=colour, ms=4,
            mec="black" if r["on_frontier"] else colour, mew=0.7 if r["on_frontier"] else 0.3, elinewidth=0.7,
            alpha=0.9,
        )  # fmt: skip
    _names(axes, rows, line, heights)
    axes.set_title(f"{title_of(rows[0])}, {rows[0]['width']}x{rows[0]['height']}", loc="left")
    axes.set_ylim(BOTTOM, max(r["wrong_per_frame"] for r in rows) * 4 + 2)
    low = min(r["total_ms"] for r in rows)
    high = max(r["total_ms"] for r in rows)
    axes.set_xlim(low * 0.8, high * 2.2)
    axes.set_yticks([10.0**k for k in range(int(math.log10(axes.get_ylim()[1])) + 1)])
    axes.yaxis.set_minor_locator(matplotlib.ticker.NullLocator())


def _heights(looks: dict[str, tuple[str, str]]) -> dict[str, float]:
    """Where in the band each family's points without a wrong answer stand."""
    count = len(looks)
    return {
        name: BOTTOM * (FLOOR * 0.8 / BOTTOM) ** ((i + 0.7) / (count + 0.4)) for i, name in enumerate(looks)
    }


def _height(r: Row, heights: dict[str, float]) -> float:
    return r["wrong_per_frame"] + FLOOR if r["wrong_per_frame"] else heights[r["family"]]


def _names(axes: Any, rows: Sequence[Row], frontier: Sequence[Row], heights: dict[str, float]) -> None:
    """Names beside points that have room: those of the frontier and those with errors, where no name stands yet."""
    taken: list[tuple[float, float]] = []
    wanted = [*frontier, *sorted(rows, key=lambda r: -r["wrong_per_frame"])]
    for r in wanted:
        if r not in frontier and r["wrong_per_frame"] == 0:
            continue
        at = (math.log10(r["total_ms"]), math.log10(_height(r, heights)))
        if any(abs(at[1] - y) < 0.24 and -0.9 < at[0] - x < 0.9 for x, y in taken):
            continue
        taken.append(at)
        axes.annotate(
            r["level"], (r["total_ms"], _height(r, heights)), xytext=(4, 2.5), textcoords="offset points",
            fontsize=5,
        )  # fmt: skip


def _legend(figure: Any, present: set[str], looks: dict[str, tuple[str, str]]) -> None:
    from matplotlib.lines import Line2D

    handles: list[Any] = [
        Line2D([], [], color=colour, marker=marker, linestyle="", markersize=4, label=family)
        for family, (colour, marker) in looks.items()
        if family in present
    ]
    handles.append(Line2D([], [], color="#bbbbbb", linewidth=2.5, label="frontier (its points ringed)"))
    figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=5 if len(figure.axes) > 1 else 3,
        frameon=False,
        handlelength=1.2,
        columnspacing=1.0,
    )
