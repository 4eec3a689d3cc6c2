"""Errors against time: every point of a scene, and the front of those that none beats in both."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import panels, style
from .dataframe import DataFrame, Series

BELOW = "the stair is the front: nothing is both faster and less wrong; its points have their names"
SIZE = 5.5  # of names, in points


def front(table: DataFrame, x: str = "total_ms", y: str = "wrong_per_frame") -> Series:
    """Which rows no other row beats: none is as good in both quantities and better in one."""
    order = table.sort_values([x, y])
    first = order[x] == order.groupby(y)[x].transform("min")
    return ((order[y] == order[y].cummin()) & first).reindex(table.index)


def draw(
    path: Path, table: DataFrame, *, name: str = "name", facet: str = "title", on_front: str = "on_frontier"
) -> Path:
    """A panel for each value of ``facet``: wrong answers a frame over ms a frame, both logarithmic, zero with a place.

    name, on_front  columns: what a point is called; true where it lies on the front
    """
    across, named = min(2, table[facet].nunique()), list[tuple[Any, list[tuple[float, float, str]]]]()

    def late() -> None:
        for axes, points in named:
            names_apart(axes, points)

    with panels.facets(path, table, facet, across, 2.3, across, legend=4, below=f"ms a frame\n{BELOW}",
                       left="wrong answers a frame", late=late) as shown:  # fmt: skip
        for axes, title, own in shown:
            for method, points in own.groupby("method", sort=False):
                look = {**style.look(str(method)), "ls": "none", "ms": 3.2}
                axes.plot(points["total_ms"], points["wrong_per_frame"], label=str(method), **look)
            best = own[own[on_front]].sort_values("total_ms")
            axes.set_yscale("symlog", linthresh=1.0)
            axes.set(ylim=(-0.5, 3.0 * max(1.0, own["wrong_per_frame"].max())), title=title)
            style.plain_log(axes, "x")
            low, high = axes.get_xlim()
            axes.set_xlim(low, high)
            axes.step([*best["total_ms"], high], [*best["wrong_per_frame"], best["wrong_per_frame"].min()], where="post",
                      c="0.3", lw=0.8, ls="--", zorder=1)  # fmt: skip
            axes.yaxis.set_major_formatter(lambda at, _: style.radii(at))
            axes.minorticks_off()
            rows = best[["total_ms", "wrong_per_frame", name]].itertuples(index=False, name=None)
            named.append((axes, list(rows)))
    return path


def names_apart(axes: Any, points: Sequence[tuple[float, float, str]]) -> None:
    """Names beside their points (x, y, name), each above the one before where they would touch, with a line to its point."""
    step, before = 1.35 * SIZE, -1e9
    scale = 72.0 / axes.figure.dpi
    for x, y, text in sorted(points, key=lambda point: (point[1], point[0])):
        across = axes.transAxes.inverted().transform(axes.transData.transform((x, y)))[0]
        at = scale * axes.transData.transform((x, y))[1]
        before = max(at, before + step)
        side = 1 if across < 0.5 else -1
        label = axes.annotate(text, (x, y), (6 * side, before - at + 5.0), textcoords="offset points", size=SIZE,
                      ha="left" if side > 0 else "right", va="center",
                      arrowprops={"arrowstyle": "-", "lw": 0.4, "color": "0.5", "shrinkA": 0, "shrinkB": 1})  # fmt: skip
        label.set_in_layout(False)
