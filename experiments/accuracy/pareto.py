"""Frame time against wrong answers: one panel a scene, every point numbered, the frontier as a line."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...harness.report import panels, style
from .tables import TITLES, usable

if TYPE_CHECKING:
    import pandas as pd

FLOOR = 0.5
"""Where zero wrong answers would stand on the logarithmic axis: every count is raised by one half."""
BOTTOM = 0.008
"""Lower end of the band in which points without a wrong answer are spread out, a height for each family."""
MARKER, NUMBER_SIZE, KEY_SIZE = 4, 5.0, 5.6
"""Points: of a marker's side, and of the type of numbers and of their key."""


def draw(table: pd.DataFrame, path: Path) -> list[Path]:
    """Draw the points that have time and error; nothing where there is none. Returns the file written."""
    known = usable(table)
    if known.empty:
        return []
    rank = {family: i for i, family in enumerate(known["family"].unique())}
    labels = known.drop_duplicates("label").sort_values("family", key=lambda s: s.map(rank), kind="stable")
    numbers = {label: i + 1 for i, label in enumerate(labels["label"])}
    known = known.assign(number=known["label"].map(numbers))
    looks = families(known)
    scenes = known["title"].nunique()
    across, down = min(2, scenes), -(-scenes // 2)
    rows = math.ceil(len(labels) / (2 * across))
    key = 0.105 * rows
    size = (3.6 * across, 2.7 * down + key + 1.1)
    ratios = [2.7] * down + [key]
    heights = {
        family: BOTTOM * (FLOOR / BOTTOM) ** ((i + 0.3) / len(looks)) for i, family in enumerate(looks)
    }
    with panels.sheet(path, size, down + 1, across, legend=0, height_ratios=ratios) as (figure, grid):
        for axes, (title, own) in zip(grid[:down].ravel(), known.groupby("title", sort=False), strict=False):
            panel(axes, title, own, looks, heights)
        for axes in grid.ravel()[max(0, scenes - across) : scenes]:
            axes.set_xlabel("ms per frame (bars: quartiles of repeats)")
        for axes in grid.ravel()[scenes:]:
            axes.set_axis_off()
        for i, r in enumerate(labels.itertuples()):
            axes = grid[down, i // rows // 2]
            axes.text(0.5 * (i // rows % 2), 1 - (i % rows + 0.5) / rows, f"{i + 1}  {r.level}", fontsize=KEY_SIZE,
                      color=looks[r.family]["color"], va="center", transform=axes.transAxes)  # fmt: skip
        figure.supylabel("wrong answers a frame + ½", fontsize=7)
        panels.add_legend(figure, across)
        figure.draw_without_rendering()  # the layout, from which the room for numbers follows
        figure.set_layout_engine("none")
        for axes, (_, own) in zip(grid[:down].ravel(), known.groupby("title", sort=False), strict=False):
            number(axes, own.assign(height=height(own, heights)), looks)
    return [path]


def families(table: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Colour and marker of each family, in the order of the rows."""
    kinds = enumerate(table["family"].unique())
    return {family: {"color": style.COLOURS[i % 8], "marker": style.MARKERS[i % 8]} for i, family in kinds}


def height(own: pd.DataFrame, heights: dict[str, float]) -> pd.Series:
    """Where the points of a panel stand: those without a wrong answer at the height of their family."""
    return (own["wrong_per_frame"] + FLOOR).where(own["wrong_per_frame"] > 0, own["family"].map(heights))


def panel(
    axes: Any, title: str, own: pd.DataFrame, looks: dict[str, dict[str, Any]], heights: dict[str, float]
) -> None:
    """One scene. Points on another device than most are hollow."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    own = own.assign(height=height(own, heights))
    here = own["device"].mode()[0]
    line = own[own["on_frontier"]].sort_values("total_ms")
    axes.axhspan(BOTTOM / 2, FLOOR * 1.2, color="#e8f2e8", zorder=0)
    axes.text(0.99, FLOOR * 1.05, "no wrong answer", transform=axes.get_yaxis_transform(), ha="right", va="top",
              fontsize=NUMBER_SIZE, color="#446644")  # fmt: skip
    axes.step(line["total_ms"], line["height"], where="post", color="#bbbbbb", linewidth=2.5, zorder=1,
              solid_joinstyle="round", label="frontier: no other point is both faster and less wrong")  # fmt: skip
    for (family, device), mine in own.groupby(["family", "device"], sort=False):
        face = None if device == here else "white"
        elsewhere = "" if device == here else f" (hollow: on {mine['device_name'].iloc[0]}, another device)"
        ends = [
            (mine["total_ms"] - mine["q1_ms"]).clip(lower=0),
            (mine["q3_ms"] - mine["total_ms"]).clip(lower=0),
        ]
        axes.errorbar(mine["total_ms"], mine["height"], xerr=ends, elinewidth=0.7, alpha=0.9, ls="none", ms=MARKER, mew=0.6,
                      mfc=face, label=TITLES.get(family, family) + elsewhere, **looks[family])  # fmt: skip
    axes.set(xscale="log", yscale="log", ylim=(BOTTOM / 2, own["wrong_per_frame"].max() * 6 + 2))
    axes.set_xlim(own["total_ms"].min() * 0.5, own["total_ms"].max() * 2.2)
    top = int(math.log10(axes.get_ylim()[1]))
    axes.set_yticks(10.0 ** np.arange(0, top + 1, 1 if top < 5 else 2))
    axes.xaxis.set_major_locator(LogLocator(numticks=9))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axes.set_title(f"{title}, on {own.loc[own['device'] == here, 'device_name'].iloc[0]}", loc="left")


def number(axes: Any, own: pd.DataFrame, looks: dict[str, dict[str, Any]]) -> None:
    """Every point's number: beside it, farther away with a line to it, or, where none is wrong, in the family's row.

    To be called once the layout stands: room is measured in what is drawn.
    """
    unit = axes.figure.dpi / 72
    places = axes.transData.transform(own[["total_ms", "height"]])
    taken = [box(x, y, MARKER * unit, MARKER * unit) for x, y in places]
    frame = axes.get_window_extent()
    right = own[own["wrong_per_frame"] == 0].sort_values("total_ms")
    for family, mine in right.groupby("family"):
        across = axes.transData.transform(mine[["total_ms", "height"]])[:, 0]
        # Markers with room between them have numbers of their own.
        for _, near in mine.groupby(np.cumsum(np.diff(across, prepend=across[0]) > 12 * unit)):
            last = near.iloc[-1]
            axes.annotate(runs(sorted(near["number"])), (last["total_ms"], last["height"]), xytext=(MARKER, 0),
                          textcoords="offset points", fontsize=NUMBER_SIZE, va="center",
                          color=looks[family]["color"])  # fmt: skip
    for r in own[own["wrong_per_frame"] > 0].sort_values("wrong_per_frame", ascending=False).itertuples():
        x, y = axes.transData.transform((r.total_ms, r.height))
        # A digit of the typeface is 0.64 of its size wide and 0.73 high; half as much again keeps numbers apart.
        width, high = (0.64 * len(str(r.number)) + 0.2) * NUMBER_SIZE * unit, NUMBER_SIZE * unit
        for radius, turn in itertools.product((5.5, 9, 13, 18, 24, 31, 40), np.arange(16) / 16):
            right, up = radius * np.cos(2 * np.pi * turn), radius * np.sin(2 * np.pi * turn)
            here = box(x + right * unit, y + up * unit, width, high)
            if (
                frame.contains(*here[:2])
                and frame.contains(*here[2:])
                and not any(meet(here, other) for other in taken)
            ):
                arrow = {"arrowstyle": "-", "lw": 0.3, "color": "#888888", "shrinkA": 0, "shrinkB": 2}
                axes.annotate(str(r.number), (r.total_ms, r.height), xytext=(right, up), textcoords="offset points",
                              fontsize=NUMBER_SIZE, ha="center", va="center", color=looks[r.family]["color"],
                              arrowprops=arrow if radius > 6 else None)  # fmt: skip
                taken.append(here)
                break


def runs(numbers: list[int]) -> str:
    """Numbers in order, runs of them shortened: "1, 4-7, 9"."""
    groups: list[list[int]] = []
    for n in numbers:
        if groups and n == groups[-1][-1] + 1:
            groups[-1].append(n)
        else:
            groups.append([n])
    return ", ".join(f"{g[0]}-{g[-1]}" if len(g) > 2 else ", ".join(map(str, g)) for g in groups)


Box = tuple[float, float, float, float]
"""Left, bottom, right and top, in pixels."""


def box(x: float, y: float, width: float, height: float) -> Box:
    """The box around a middle."""
    return (x - width / 2, y - height / 2, x + width / 2, y + height / 2)


def meet(a: Box, b: Box) -> bool:
    """Whether two boxes overlap."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
