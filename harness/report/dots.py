"""Dot plots: a band a row of names, in it a line of its own for each marker, so that no marker hides another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from . import panels, style

if TYPE_CHECKING:
    from pandas import DataFrame


def dots(
    path: Path, table: DataFrame, rows: str, x: str, hue: str, *, below: str, facet: str = "",
    order: Sequence[str] = (), whisker: str = "", marked: str = "",
    zeros: Mapping[str, float] | None = None, band: float = 0.3, legend: int = 2,
) -> Path:  # fmt: skip
    """Markers of the values ``x``, a band for each value of ``rows`` from the top down. Logarithmic; a line stands at 1.

    hue      column with a marker for each value (:func:`.report.panels.looks`)
    facet    column with a panel for each value, side by side; "": one panel
    below    what stands below the axes
    order    of the rows; by default the table's
    whisker  column with how far a value may lie from what is shown
    marked   column that is true where a marker has a black edge
    zeros    where zero stands in a panel, by value of facet; no line stands at 1 then
    band     height of a band, inches
    """
    own = table[table[x].notna()]
    here = list(own[rows].unique())
    names = [name for name in order if name in here] + [name for name in here if name not in order]
    looks, places = panels.looks(own, hue), list(own.groupby(facet, sort=False)) if facet else [("", own)]
    lane = {value: (i + 0.5) / len(looks) - 0.5 for i, value in enumerate(looks)}
    size = (style.COLUMN_WIDTH * (0.45 + 0.55 * len(places)), band * len(names) + 1.2)
    with panels.sheet(path, size, 1, len(places), legend=legend, grid="x", sharey=True) as (figure, grid):
        for axes, (title, part) in zip(grid[0], places, strict=True):
            for k in range(0, len(names), 2):
                axes.axhspan(k - 0.5, k + 0.5, color="#f3f3f3", zorder=0)
            zero = (zeros or {}).get(title, 0.0)
            if zero or not zeros:
                axes.axvline(zero or 1.0, color="#009E73" if zero else "#444444", lw=0.8, zorder=1)
            for value, mine in part.groupby(hue, sort=False):
                heights = [names.index(name) + 0.84 * lane[value] for name in mine[rows]]
                ends = mine[whisker].clip(upper=0.9 * mine[x]).fillna(0.0) if whisker else None
                look = {**looks[value], "ls": "none", "ms": 2.5, "mew": 0.5, "elinewidth": 0.6}
                axes.errorbar(mine[x], heights, xerr=ends, label=str(value), **look)
                if marked:
                    edge = mine[marked].to_numpy(bool)
                    axes.plot(mine[x][edge], [h for h, e in zip(heights, edge, strict=True) if e], look["marker"],
                              mfc="none", mec="black", mew=0.9, ms=4.2)  # fmt: skip
            style.plain_log(axes, "x")
            axes.minorticks_off()
            if zero:
                axes.set_xticks([at for at in axes.get_xticks() if 5 * zero < at < axes.get_xlim()[1]])
                axes.set_xticks([zero], ["none"], minor=True)
                axes.tick_params(axis="x", which="minor", length=3.5)
            axes.set_title(title if facet else "", loc="left")
        grid[0, 0].set_yticks(range(len(names)), names)
        grid[0, 0].set_ylim(len(names) - 0.5, -0.5)
        for axes in grid[0]:
            axes.tick_params(axis="y", length=0)
        figure.supxlabel(below, fontsize=7)
    return path
