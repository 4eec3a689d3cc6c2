"""The drawings of Figure 11: time against the light's distance, time against r, and tiles that hold rays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...harness.report import points, style
from ...harness.report.sheet import title_of
from .figure11_rows import AXES, CENTRED, CLAMPS, COARSE, FORMATS, PRECISE, REJECTED, panel, short

LINES: dict[str, dict[str, Any]] = {
    COARSE: {"color": "black", "ls": "--", "marker": "s", "mfc": "black"},
    CENTRED: {"color": "#8C564B", "ls": ":", "marker": "o", "mfc": "none", "ms": 6.0},
}
"""How the number formats are drawn: the remedy hollow, so that what it lies upon is seen."""

MARKS = dict(zip(REJECTED, ("x", "+", "1"), strict=True))
"""The mark at the upper edge of a panel for a point without a time, by its status."""


def picture(rows: Sequence[dict[str, Any]], clamps: Sequence[str], path: Path, unbalanced: int) -> Path:
    """Panels: clamps down, axes across; lines: r, and number formats. Both scales logarithmic and shared."""
    import matplotlib
    from matplotlib.figure import Figure

    values = points.in_order(x["r"] for x in rows if x["precision"] == PRECISE)
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 1.55 * len(clamps) + 1.2), layout="constrained")
        grid = figure.subplots(len(clamps), len(AXES), sharex=True, sharey=True, squeeze=False)
        for i, clamp in enumerate(clamps):
            for j, name in enumerate(AXES.values()):
                axes = grid[i][j]
                exact = panel(rows, clamp, name)
                for place, r in enumerate(values):
                    own = [x for x in exact if x["r"] == r]
                    _line(
                        axes,
                        own,
                        "traversal_ms",
                        {"color": style.COLOURS[place], "marker": points.MARKERS[place]},
                    )
                for precision in FORMATS:
                    _line(axes, panel(rows, clamp, name, precision), "traversal_ms", LINES[precision])
                axes.set_title(f"{CLAMPS[clamp]},\n{name}", fontsize=6.5)
                axes.set_xscale("log")
                axes.set_yscale("log")
                axes.margins(y=0.14)
        figure.supxlabel(
            f"distance of the light from the middle, scene radii; {title_of(rows[0])}", fontsize=6.5
        )
        figure.supylabel("shadow traversal, ms", fontsize=7)
        handles, labels = _handles(rows, values, unbalanced)
        figure.legend(handles, labels, loc="outside upper center", ncols=2, frameon=False, columnspacing=1.0)
        return points.save(figure, path)


def tiles_picture(rows: Sequence[dict[str, Any]], clamps: Sequence[str], path: Path) -> Path:
    """A panel a clamp: tiles of the light's grid that hold shadow rays against distance; what r is changes none."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    looks = {
        (axes, precision): {
            "color": style.COLOURS[(PRECISE, *FORMATS).index(precision)],
            "ls": "-" if aimed else "--",
            "marker": points.MARKERS[(PRECISE, *FORMATS).index(precision)],
            "mfc": "none" if precision == CENTRED else None,
            "ms": 6.0 if precision == CENTRED else 3.5,
        }
        for aimed, axes in AXES.items()
        for precision in (PRECISE, *FORMATS)
        if any(x["axes"] == axes and x["precision"] == precision for x in rows)
    }
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 2.4), layout="constrained")
        grid = figure.subplots(1, len(clamps), sharex=True, sharey=True, squeeze=False)[0]
        for axes, clamp in zip(grid, clamps, strict=True):
            for (name, precision), look in looks.items():
                # Of the r that are there any one: the first at each distance.
                one = {x["light_distance"]: x for x in reversed(panel(rows, clamp, name, precision))}
                _line(axes, [one[d] for d in sorted(one)], "tiles_with_rays", look)
            axes.set_title(CLAMPS[clamp], fontsize=6.5)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.margins(y=0.14)
        figure.supxlabel(
            f"distance of the light from the middle, scene radii; {title_of(rows[0])}", fontsize=6.5
        )
        figure.supylabel("tiles that hold rays", fontsize=7)
        handles = [Line2D([], [], **{"lw": 1.1, **look}) for look in looks.values()]
        labels = [f"{name}, {precision}" for name, precision in looks]
        marks, told = _marks(rows)
        figure.legend(
            [*handles, *marks], [*labels, *told], loc="outside upper center", ncols=2, frameon=False
        )
        return points.save(figure, path)


def _line(axes: Any, own: Sequence[dict[str, Any]], key: str, look: dict[str, Any]) -> None:
    """A line through what was measured, and a mark at the panel's upper edge for each point that was not."""
    done = [x for x in points.measured(own) if x.get(key)]
    axes.plot([x["light_distance"] for x in done], [x[key] for x in done], alpha=0.9, **look)
    for x in own:
        if x["status"] in MARKS:
            axes.plot(
                [x["light_distance"]], [0.95], MARKS[x["status"]], color=look["color"], ms=6, mew=1.6,
                transform=axes.get_xaxis_transform(), clip_on=False,
            )  # fmt: skip


def _marks(rows: Sequence[dict[str, Any]]) -> tuple[list[Any], list[str]]:
    """Legend of the marks that are drawn: each says its status."""
    from matplotlib.lines import Line2D

    there = [status for status in MARKS if any(x["status"] == status for x in rows)]
    of = {status: sorted({x["precision"] for x in rows if x["status"] == status}) for status in there}
    handles = [Line2D([], [], color="black", marker=MARKS[s], ls="", ms=6, mew=1.6) for s in there]
    return handles, [f"{status} ({', '.join(of[status])})" for status in there]


def _handles(
    rows: Sequence[dict[str, Any]], values: Sequence[int], unbalanced: int
) -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=style.COLOURS[i], marker=points.MARKERS[i], ms=3.5, lw=1.1)
        for i in range(len(values))
    ]
    labels = [f"r = {r}{' (no balancing)' if r == unbalanced else ''}" for r in values]
    for precision in FORMATS:
        own = [x for x in rows if x["precision"] == precision]
        if own:
            handles.append(Line2D([], [], **{"ms": 3.5, "lw": 1.1, **LINES[precision]}))
            labels.append(f"{precision}, r = {own[0]['r']}")
    marks, told = _marks(rows)
    return [*handles, *marks], [*labels, *told]


def threshold_picture(rows: Sequence[dict[str, Any]], clamps: Sequence[str], path: Path) -> Path:
    """Time, C_total and lane fill against r, lines: distances; columns: the two extremes of the panels above."""
    import matplotlib
    from matplotlib.figure import Figure

    exact = [x for x in points.measured(rows) if x["precision"] == PRECISE]
    columns = [(clamps[0], AXES[False]), (clamps[-1], AXES[True])]
    measures = (("traversal_ms", "shadow traversal, ms", "log"), ("chunks", "blocks, C_total", "log"),
                ("lane_fill", "lane fill", "linear"))  # fmt: skip
    values = points.in_order(x["r"] for x in exact)
    everywhere = points.in_order(x["light_distance"] for x in exact)
    # A distance at which one r was measured makes no line beside those that do.
    several = [d for d in everywhere if len({x["r"] for x in exact if x["light_distance"] == d}) > 1]
    distances = several or everywhere
    with matplotlib.rc_context(points.sheet_style()):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 4.3), layout="constrained")
        grid = figure.subplots(len(measures), len(columns), sharex=True, sharey="row", squeeze=False)
        for j, (clamp, name) in enumerate(columns):
            own = panel(exact, clamp, name)
            for i, (key, title, scale) in enumerate(measures):
                axes = grid[i][j]
                for place, distance in enumerate(distances):
                    line = sorted((x for x in own if x["light_distance"] == distance), key=lambda x: x["r"])
                    line = [x for x in line if x.get(key) is not None]
                    label = f"{short(distance)} radii" if i == j == 0 else None
                    axes.plot([x["r"] for x in line], [x[key] for x in line], color=style.COLOURS[place % 8],
                              marker=points.MARKERS[place % 8], label=label, alpha=0.9)  # fmt: skip
                axes.set_xscale("log", base=2)
                axes.set_xticks(spaced(values), [str(r) for r in spaced(values)])
                axes.minorticks_off()
                axes.set_yscale(scale)
                if scale == "linear":
                    axes.set_ylim(0, 1.02)
                if j == 0:
                    axes.set_ylabel(title)
            grid[0][j].set_title(f"{CLAMPS[clamp]}, {name}", fontsize=6.5)
        figure.supxlabel(f"r, rays a block at most; {title_of(rows[0])}", fontsize=7)
        figure.legend(loc="outside upper center", ncols=3, frameon=False, columnspacing=1.0)
        return points.save(figure, path)


def spaced(values: Sequence[int]) -> list[int]:
    """Those of rising values whose labels do not touch: each at least four times the one before."""
    result: list[int] = []
    for value in values:
        if not result or value >= 4 * result[-1]:
            result.append(value)
    return result
