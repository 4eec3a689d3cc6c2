"""Dot plots: a band a row of names, in it a line of its own for each marker, so that no marker hides another."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from . import panels, style

if TYPE_CHECKING:
    from pandas import DataFrame


def dots(
    path: Path, table: DataFrame, rows: str, x: str, hue: str, *, below: str, facet: str = "",
    order: Sequence[str] = (), whisker: str = "", marked: str = "", upright: float = 1.0, band: float = 0.3,
    legend: int = 2,
) -> Path:  # fmt: skip
    """Markers of the values ``x``, a band for each value of ``rows`` from the top down. Logarithmic; zero has a place.

    hue      column with a marker for each value (:func:`.report.panels.looks`)
    facet    column with a panel for each value, side by side; "": one panel
    order    of the rows; by default the table's
    whisker  column with how far a value may lie from what is shown
    marked   column that is true where a marker has a black edge
    upright  where a line stands, 0: nowhere; where there are zeros it stands at zero
    band     height of a band, inches
    """
    own = table[table[x].notna()].reset_index(drop=True)
    here = list(own[rows].unique())
    names = [name for name in order if name in here] + [name for name in here if name not in order]
    looks, (shown, _) = panels.looks(own, hue), panels.places(own, facet, 1)
    lane = {value: (i + 0.5) / len(looks) - 0.5 for i, value in enumerate(looks)}
    heights = own[rows].map(names.index) + 0.84 * own[hue].map(lane)
    size = (style.COLUMN_WIDTH * (0.45 + 0.55 * len(shown)), band * len(names) + 1.2)
    with panels.sheet(path, size, 1, len(shown), legend=legend, grid="x", sharey=True) as (figure, grid):
        for axes, (title, part) in panels.filled(grid, shown):
            for k in range(0, len(names), 2):
                axes.axhspan(k - 0.5, k + 0.5, color="#f3f3f3", zorder=0)
            zero = bool((part[x] <= 0).any())
            if zero or upright:
                axes.axvline(0.0 if zero else upright, color="#444444", lw=0.8, zorder=1)
            for value, mine in part.groupby(hue, sort=False):
                y, look = (
                    heights[mine.index],
                    {**looks[value], "ls": "none", "ms": 2.5, "mew": 0.5, "elinewidth": 0.6},
                )
                ends = mine[whisker].clip(upper=0.9 * mine[x]).fillna(0.0) if whisker else None
                axes.errorbar(mine[x], y, xerr=ends, label=str(value), **look)
                if marked:
                    mine = mine[mine[marked].to_numpy(bool)]
                    axes.plot(
                        mine[x], heights[mine.index], look["marker"], mfc="none", mec="black", mew=0.9, ms=4.2
                    )
            if zero:
                axes.set_xscale("symlog", linthresh=1.0)
                axes.xaxis.set_major_formatter(lambda at, _: style.radii(at))
            else:
                style.plain_log(axes, "x")
            axes.minorticks_off()
            axes.tick_params(axis="y", length=0)
            axes.set_title(title, loc="left")
        grid[0, 0].set_yticks(range(len(names)), names)
        grid[0, 0].set_ylim(len(names) - 0.5, -0.5)
        figure.supxlabel(below, fontsize=7)
    return path
