"""The grid of errors over light distance and scene offset: kept as CSV by the run, drawn from it."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...harness.files import write_text
from ...harness.report import points

if TYPE_CHECKING:
    from ...harness.runner.experiment import Entry
    from ...harness.runner.runner import Options

NAME = "accuracy_heat.csv"
COLUMNS = (
    "scene label method distance offset size status wrong primary_wrong acne leak excused scored pixels"
).split()


def keep_grid(
    options: Options,
    entries: Sequence[Entry],
    distances: Sequence[float],
    offsets: Sequence[float],
    size: int,
) -> Path:
    """Compute the grid on the run's first scene and write it, unless it is there: its answers do not change."""
    from ...harness.scene.catalogue import resolve
    from ...harness.scene.prepared import prepare
    from .._offsets import error_grid

    path = options.out / NAME
    if path.exists():
        return path
    prepared = prepare(resolve(options.preset.scenes[0], options.scene_dir))
    return write_rows(path, error_grid(prepared, entries, distances, offsets, size, options.device), COLUMNS)


def write_rows(path: Path, rows: Iterable[dict[str, Any]], columns: Sequence[str]) -> Path:
    """Rows as CSV, whole or not at all."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: points.plain(row.get(name)) for name in columns})
    write_text(path, text.getvalue())
    return path


def read_grid(folder: Path) -> list[dict[str, Any]]:
    """The rows of the grid, numbers as numbers; [] where a folder has none."""
    path = folder / NAME
    if not path.exists():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return [
            {
                key: float(value) if key not in ("scene", "label", "method", "status") and value else value
                for key, value in row.items()
            }
            for row in csv.DictReader(file)
        ]


def draw(folder: Path) -> list[Path]:
    """One panel a method: the share of pixels that differ from the exact answer, from white (none) to dark (all)."""
    import matplotlib
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    rows = [row for row in read_grid(folder) if row["status"] == "ok"]
    if not rows:
        return []
    labels = list(dict.fromkeys(row["label"] for row in rows))
    distances = sorted({row["distance"] for row in rows})
    offsets = sorted({row["offset"] for row in rows})
    across = min(3, len(labels))
    down = -(-len(labels) // across)
    with matplotlib.rc_context({**points.sheet_style(), "axes.grid": False}):
        figure = Figure(figsize=(7.0, 0.55 + 1.6 * down), layout="constrained", dpi=200)
        panels = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True)
        shown, shade = None, LogNorm(1e-4, 1.0)
        colours = matplotlib.colormaps["magma_r"].with_extremes(bad="white")
        for axes, label in zip(panels.ravel(), labels, strict=False):
            grid, text = _cells([row for row in rows if row["label"] == label], distances, offsets)
            shown = axes.imshow(
                np.ma.masked_less_equal(grid, 0.0), norm=shade, cmap=colours, origin="lower",
                aspect="auto",
            )  # fmt: skip
            for (i, j), words in np.ndenumerate(text):
                axes.text(
                    j,
                    i,
                    words,
                    ha="center",
                    va="center",
                    fontsize=4.8,
                    color=_ink(colours, shade(grid[i, j])),
                )
            axes.set_title(label, fontsize=7)
            axes.set_xticks(range(len(distances)), [_power(x) for x in distances])
            axes.set_yticks(range(len(offsets)), [_power(x) for x in offsets])
            axes.tick_params(length=0)
        for axes in panels.ravel()[len(labels) :]:
            axes.set_axis_off()
        for axes in panels.ravel()[max(0, len(labels) - across) : len(labels)]:
            axes.tick_params(labelbottom=True)  # the lowest of its column, also where a row below is not full
        figure.supxlabel("distance of the light from the middle, in scene radii", fontsize=7)
        figure.supylabel("offset of the scene from the origin, in radii", fontsize=7)
        assert shown is not None
        bar = figure.colorbar(shown, ax=list(panels.ravel()), shrink=0.9, pad=0.01)
        bar.set_label("differing answers / pixels (white: none)", fontsize=6.5)
        figure.suptitle(
            f"Answers that differ from the exact one on {rows[0]['scene']}, {rows[0]['size']:.0f}x"
            f"{rows[0]['size']:.0f}, scene not recentred: wrong (+ excused: within rounding of an edge)",
            fontsize=7.5,
        )
        return [points.save(figure, folder / "accuracy_heat.png", colours=160)]


def _ink(colours: Any, level: Any) -> str:
    """Black or white, whichever stands out more from the colour at a level (masked or not a number: none, white)."""
    if np.ma.is_masked(level) or not np.isfinite(level):
        return "black"
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colours(float(level))[:3]]
    luminance = float(np.dot(linear, (0.2126, 0.7152, 0.0722)))
    # Where the contrast with white, 1.05 / (L + 0.05), equals that with black, (L + 0.05) / 0.05.
    return "white" if luminance < 0.179 else "black"


def _power(x: float) -> str:
    """A round number as a power of ten where it is one."""
    exponent = round(np.log10(x)) if x > 0 else 0
    plain = x == 0 or 0.01 <= x < 100 or x != 10.0**exponent
    return f"{x:g}" if plain else f"$10^{{{exponent}}}$"


def _cells(
    rows: Sequence[dict[str, Any]], distances: Sequence[float], offsets: Sequence[float]
) -> tuple[Any, Any]:
    """Shares of pixels that differ from the exact answer, and "wrong (+excused)" as text, [offset, distance]."""
    grid = np.full((len(offsets), len(distances)), np.nan)
    text = np.full(grid.shape, "", dtype=object)
    for row in rows:
        at = offsets.index(row["offset"]), distances.index(row["distance"])
        grid[at] = (row["wrong"] + row["excused"]) / row["pixels"]
        text[at] = f"{row['wrong']:,.0f}" + (f"\n(+{row['excused']:,.0f})" if row["excused"] else "")
    return grid, text
