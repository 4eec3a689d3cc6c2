"""Frame time against wrong pixels: one panel a scene, one marker a family of knobs, the frontier as a line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...harness.report import points
from ...harness.report.sheet import title_of
from .accuracy_rows import Row, families, scenes, usable

FLOOR = 0.5
"""Where zero wrong pixels stand on the logarithmic axis: every count is raised by one half."""

MARKER, NAME_SIZE = 4, 6.5
"""Points: of a marker's side, and of the type of names."""

SIDES = (
    ((4, 0), "left", "center"), ((4, 2), "left", "bottom"), ((4, -2), "left", "top"), ((-4, 0), "right", "center"),
    ((-4, 2), "right", "bottom"), ((-4, -2), "right", "top"),
)  # fmt: skip
"""Where a name may stand beside its point, in points, the best place first: its offset, and which side of it is there."""
ABOVE_BELOW = (((0, 4), "center", "bottom"), ((0, -4), "center", "top"))
"""And where one of the frontier may stand besides."""

BOTTOM = 0.015
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
        figure = Figure(figsize=(3.6 * across, 2.2 * down + 0.75), layout="constrained")
        axes = figure.subplots(down, across, squeeze=False).ravel()
        for place, (_, own) in zip(axes, panels, strict=False):
            _panel(place, own, looks)
        for place in axes[len(panels) :]:
            place.set_axis_off()
        figure.supxlabel("ms a frame (bars: quartiles of repeats)", fontsize=7)
        figure.supylabel("wrong answers a frame + ½", fontsize=7)
        _legend(figure, {r["family"] for r in known}, looks)
        figure.draw_without_rendering()  # the layout, from which the room for names follows
        figure.set_layout_engine("none")
        for place, (_, own) in zip(axes, panels, strict=False):
            _names(place, own, _heights(looks))
        return [points.save(figure, path)]


def _panel(axes: Any, rows: Sequence[Row], looks: dict[str, tuple[str, str]]) -> None:
    import matplotlib.ticker

    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.axhspan(BOTTOM, FLOOR * 1.2, color="#e8f2e8", zorder=0)
    axes.text(0.99, FLOOR * 1.1, "no wrong answer (one height a family)", transform=axes.get_yaxis_transform(),
              ha="right", va="top", fontsize=NAME_SIZE, color="#446644")  # fmt: skip
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
            r["total_ms"], _height(r, heights), xerr=ends, fmt=marker, color=colour, ms=MARKER,
            mec="black" if r["on_frontier"] else colour, mew=0.7 if r["on_frontier"] else 0.3, elinewidth=0.7,
            alpha=0.9,
        )  # fmt: skip
    axes.set_title(f"{title_of(rows[0])}, {rows[0]['width']}x{rows[0]['height']}", loc="left")
    axes.set_ylim(BOTTOM, max(r["wrong_per_frame"] for r in rows) * 4 + 2)
    low = min(r["total_ms"] for r in rows)
    high = max(r["total_ms"] for r in rows)
    axes.set_xlim(low * 0.5, high * 2.2)
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


def _names(axes: Any, rows: Sequence[Row], heights: dict[str, float]) -> None:
    """Names beside points, where one has room that neither a marker nor another name takes.

    First those of the frontier, then those with errors, the most wrong first; a name without room is left out. To be
    called once the layout stands: room is measured in what is drawn.
    """
    figure = axes.figure
    unit = figure.dpi / 72
    half = 0.5 * MARKER * unit
    at = [axes.transData.transform((r["total_ms"], _height(r, heights))) for r in rows]
    taken = [(x - half, y - half, x + half, y + half) for x, y in at]
    taken += [_box(text) for text in axes.texts]
    frame = axes.get_window_extent()
    order = sorted(range(len(rows)), key=lambda k: (not rows[k]["on_frontier"], -rows[k]["wrong_per_frame"]))
    for k in order:
        r = rows[k]
        if not r["on_frontier"] and r["wrong_per_frame"] == 0:
            continue
        for (right, up), across, along in (*SIDES, *(ABOVE_BELOW if r["on_frontier"] else ())):
            name = axes.annotate(
                r["level"], (r["total_ms"], _height(r, heights)), xytext=(right, up), textcoords="offset points",
                fontsize=NAME_SIZE, ha=across, va=along,
            )  # fmt: skip
            box = _box(name)
            inside = box[0] >= frame.x0 and box[2] <= frame.x1 and box[1] >= frame.y0 and box[3] <= frame.y1
            if inside and not any(_meet(box, other) for other in taken):
                taken.append(box)
                break
            name.remove()


def _box(text: Any) -> tuple[float, float, float, float]:
    """Left, bottom, right and top of a text as it is drawn, in pixels."""
    found = text.get_window_extent()
    return (found.x0, found.y0, found.x1, found.y1)


def _meet(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


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
