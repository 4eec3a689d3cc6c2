"""Stacked bars: the parts of a frame by method, one panel a scene. Read at the width of a paper column."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..frame.passes import PARTS
from . import style
from .sheet import column_name, error_text, title_of

FIELDS = dict(zip(PARTS, ("build_ms", "trace_ms", "light_build_ms", "shadow_ms"), strict=True))

CUT = 4.0
"""A bar more than this many times longer than the next is cut off, with a mark; its number stands beside it."""


def draw(rows: Sequence[dict[str, Any]], path: Path) -> list[Path]:
    """Draw the rows as SVG (or whatever ``path`` ends in). Writes nothing where nothing was measured.

    Times are linear, with a scale of its own for each scene; the number at a bar's end is the whole frame's
    median, measured apart from its parts, with the error of its answers.
    """
    import matplotlib

    if not any(row.get("total_ms") for row in rows):
        return []
    with matplotlib.rc_context(style.axes_style()):
        figure = _figure(rows)
        # No date in the file: the same records give the same bytes.
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
    return [path]


def _figure(rows: Sequence[dict[str, Any]]) -> Any:
    from matplotlib.figure import Figure

    scenes: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        scenes.setdefault((row["scene"], row["scene_title"]), []).append(row)
    counts = [len(own) for own in scenes.values()]
    bar, frame = 0.15, 0.50
    height = sum(n * bar + frame for n in counts) + 0.55
    figure = Figure(figsize=(style.COLUMN_WIDTH, height), layout="constrained")
    panels = figure.subplots(len(scenes), 1, squeeze=False, height_ratios=counts)[:, 0]
    colours = style.colours(row["method"] for row in rows)
    for axes, own in zip(panels, scenes.values(), strict=True):
        _panel(axes, own, [column_name(row, rows) for row in own], colours)
    figure.supxlabel(
        "ms a frame. Bar: its parts, measured one by one, added up.\n"
        "Black tick and number: the whole frame, measured apart;\nwhisker: interquartile range of repeats",
        fontsize=6.5,
    )
    _legend(figure)
    return figure


def _panel(axes: Any, rows: Sequence[dict[str, Any]], labels: Sequence[str], colours: dict[str, str]) -> None:
    longest = _reach(rows)
    for place, row in enumerate(rows):
        if not row.get("total_ms"):
            axes.text(0.02 * longest, place, row["status"], va="center", fontsize=6, style="italic")
            continue
        left = 0.0
        for part in PARTS:
            width = min(row[FIELDS[part]] or 0.0, longest - left)
            face = style.lightened(colours[row["method"]], style.PART_SHARE[part])
            axes.barh(
                place, width, left=left, height=0.74, color=face,
                edgecolor=style.lightened(colours[row["method"]], 0.0), linewidth=0.4,
            )  # fmt: skip
            left += width
        if _end(row) > longest:
            axes.text(longest, place, "//", ha="center", va="center", fontsize=9)
        else:
            spread = row["iqr_ms"] / 2
            axes.errorbar(
                row["total_ms"], place, xerr=spread, fmt="|", color="black", ms=6, mew=0.8, elinewidth=0.6
            )
        axes.text(
            min(_end(row), longest) + 0.03 * longest,
            place,
            f"{style.number(row['total_ms'])} {error_text(row)}",
            va="center",
            fontsize=6,
        )
    axes.set_title(title_of(rows[0]), loc="left", pad=2)
    axes.set_yticks(range(len(rows)), labels)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(0, longest * 1.38)


def _reach(rows: Sequence[dict[str, Any]]) -> float:
    """Up to where a panel's bars go, in ms: the longest, unless it dwarfs all others."""
    ends = sorted(end for end in map(_end, rows) if end)
    if len(ends) > 1 and ends[-1] > CUT * ends[-2]:
        return 1.5 * ends[-2]
    return ends[-1] if ends else 1.0


def _end(row: dict[str, Any]) -> float:
    """Where a row's bar and whisker end, in ms; 0 where nothing was measured."""
    if not row.get("total_ms"):
        return 0.0
    return max(sum(row[name] or 0.0 for name in FIELDS.values()), row["total_ms"] + row["iqr_ms"] / 2)


def _legend(figure: Any) -> None:
    from matplotlib.patches import Patch

    grey = "#555555"
    patches = [
        Patch(facecolor=style.lightened(grey, style.PART_SHARE[part]), edgecolor=grey, linewidth=0.4, label=part)
        for part in PARTS
    ]  # fmt: skip
    figure.legend(handles=patches, loc="outside upper center", ncols=4, frameon=False, handlelength=1.4,
                  columnspacing=1.0)  # fmt: skip
