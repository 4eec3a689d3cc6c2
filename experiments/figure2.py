"""Figure 2 of the paper: triangles checked per pixel, direct and indirect mapping of threads to rays.

Indirect mapping traces with blocks of 16 x 16 pixels and sorts triangles to the 2 x 2 (or 4 x 4) smaller tiles inside.
Direct mapping can be read in two ways: tiles as large as those blocks, or tiles as small as the sorting tiles, which
are blocks then. The paper: 30-50 % faster on Buddha, the maximum more than halved.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..harness.errors import UserError
from ..harness.report import compare, document, panels, style
from ..harness.results.pixel_maps import Counts, map_path, read_map
from ..harness.results.table import samples
from ..harness.runner.experiment import Experiment, Preset
from ._paper import faithful

if TYPE_CHECKING:
    import pandas as pd

DIRECT, INDIRECT = "direct, 16x16 tiles", "indirect, 2x2 of 8x8"
DIRECT_SMALL = "direct, 8x8 tiles"

METHODS = (
    faithful(DIRECT, tile="16", k="1"),
    faithful(INDIRECT, tile="8", k="2"),
    faithful("indirect, 4x4 of 4x4", tile="4", k="4"),
    faithful(DIRECT_SMALL, tile="8", k="1"),
)


SHOWN = (DIRECT, DIRECT_SMALL, INDIRECT)
"""Maps of these are drawn; further settings stand in table and CSV."""
BASES = {"": DIRECT, "_same_tiles": DIRECT_SMALL}
STATISTICS = ["tests_mean", "tests_median", "tests_p99", "tests_most"]
COLUMNS = [
    *document.COMMON, *STATISTICS, "speed_up", "most_share", "speed_up_same_tiles", "most_share_same_tiles",
]  # fmt: skip
"""``speed_up`` and ``most_share``: against direct mapping with tiles as large as indirect mapping's blocks;
``_same_tiles``: with tiles as small as its sorting tiles."""

HEADINGS: document.Columns = {
    "scene": ("title", "{}"), "mapping": ("label", "{}"), "most": ("tests_most", "{:,.0f}"),
    "mean": ("tests_mean", "{:.0f}"), "primary rays, ms": ("trace", "{}"),
}  # fmt: skip
for _ending, _label in BASES.items():
    HEADINGS[f"most, of {_label}"] = (f"most_share{_ending}", "{:.0%}")
    HEADINGS[f"faster than {_label}"] = (f"speed_up{_ending}", "{:+.0%}")

NOTHING = "#d9d9d9"
"""Colour of pixels whose ray was checked against no triangle."""


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The maps side by side, the CSV, and what they show."""
    frames = document.frames(folder)
    table = document.named(frames)
    done = document.measured(table)
    maps = {r.key: read(folder, r.key, r.frame_numbers[-1]) for r in done.itertuples()}
    for key, counts in maps.items():
        table.loc[table["key"] == key, STATISTICS] = statistics(counts)
    for ending, label in BASES.items():
        own, base = compare.pairs(frames, frames["label"] == label)
        most = table[table["label"] == label].groupby(["title", "run"])["tests_most"].first().rename("most")
        table[f"speed_up{ending}"] = table["key"].map(base["trace_ms"] / own["trace_ms"] - 1)
        table[f"most_share{ending}"] = table["tests_most"] / table.join(most, on=["title", "run"])["most"]
    spread = table["key"].map(compare.pass_spread(samples(folder), "trace"))
    table["trace"] = document.carry(table["trace_ms"], spread)
    files = [document.write_csv(table, folder / "figure2.csv", COLUMNS)]
    done = document.measured(table)
    for name, own in done[done["label"].isin(SHOWN)].groupby("file", sort=False):
        if INDIRECT in set(own["label"]) and len(own) > 1:
            own = own.sort_values("label", key=lambda labels: labels.map(SHOWN.index))
            files.append(picture(own, [maps[key] for key in own["key"]], folder / f"figure2-{name}.png"))
    tables = {"Triangles checked for a pixel, and time of primary rays": document.texts(done, HEADINGS)}
    return document.write(folder, "figure2", EXPERIMENT.title, finding(done), tables, files, table, quiet)


def read(folder: Path, key: str, frame: int) -> Counts:
    """The counts [height, width] of a point's last frame. Raises :class:`UserError` where they are not kept."""
    path = map_path(folder, key, frame)
    if not path.exists():
        raise UserError(f"{path}: not there; run figure2 again into a new folder")
    return read_map(path)


def statistics(counts: Counts) -> list[float]:
    """Mean over all pixels; median and 99th percentile over those whose ray was checked at all; the most."""
    seen = counts[counts > 0] if (counts > 0).any() else np.zeros(1)
    return [float(x) for x in (counts.mean(), np.median(seen), np.percentile(seen, 99), counts.max())]


def finding(done: pd.DataFrame) -> str:
    """What indirect mapping changed against each reading of direct mapping, beside what the paper says."""
    told = []
    ours = done[done["label"] == INDIRECT]
    for ending, label in BASES.items():
        for r in ours[ours[f"speed_up{ending}"].notna()].head(1).to_dict("records"):
            faster = r[f"speed_up{ending}"]
            told.append(
                f"against {label} {r[f'most_share{ending}']:.0%} of the most triangles for a pixel and primary rays "
                f"{abs(faster):.0%} {'faster' if faster >= 0 else 'slower'}"
            )
    if not told:
        return f"{INDIRECT} and direct mapping were not both measured."
    return f"{ours['title'].iloc[0]}, {INDIRECT}: {'; '.join(told)} (the paper: less than half, and 30-50 % faster)."


def picture(own: pd.DataFrame, maps: Sequence[Counts], path: Path) -> Path:
    """The maps side by side, cut to where any ray was checked; one scale for all, 0 to the most of any.

    Colours follow the square root: the most is several times what is usual.
    """
    import matplotlib
    from matplotlib.colors import PowerNorm

    most = max(2, *(int(counts.max()) for counts in maps))
    down, across = occupied(maps)
    colours = matplotlib.colormaps["viridis"].with_extremes(bad=NOTHING)
    tall = min(2.5, (down.stop - down.start) / (across.stop - across.start))
    size = (style.COLUMN_WIDTH, tall * style.COLUMN_WIDTH / len(maps) + 1.05)
    with panels.sheet(path, size, 1, len(maps), grid="", dpi=250, colours=128) as (figure, grid):
        for axes, r, counts in zip(grid[0], own.itertuples(), maps, strict=True):
            seen = np.ma.masked_equal(counts[down, across], 0)
            image = axes.imshow(seen, cmap=colours, norm=PowerNorm(0.5, 0, most), interpolation="nearest")
            about = f"most {r.tests_most:,.0f}\nmean {r.tests_mean:.0f}"
            axes.set_title(f"{r.label.replace(', ', chr(10))}\n{about}", fontsize=6.5)
            axes.set(xticks=[], yticks=[])
            axes.spines[:].set_visible(False)
        bar = figure.colorbar(
            image, ax=list(grid[0]), orientation="horizontal", shrink=0.9, aspect=35, pad=0.02
        )
        between = [x for x in (1, 3, 10, 30, 100, 300, 1000, 3000, 10000, 30000) if 0.01 < x / most < 0.75]
        bar.set_ticks([0, *between, most], labels=[f"{x:,}" for x in (0, *between, most)])
        about = "triangles checked for the pixel's primary ray (grey: none)"
        bar.set_label(f"{about}\n{own['title'].iloc[0]}", fontsize=6.5)
    return path


def occupied(maps: Sequence[Counts]) -> tuple[slice, slice]:
    """Rows and columns of the pixels that any map counts something in; all where there are none."""
    counted = np.any([counts > 0 for counts in maps], axis=0)
    if not counted.any():
        counted = ~counted
    rows, columns = np.flatnonzero(counted.any(axis=1)), np.flatnonzero(counted.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


EXPERIMENT = Experiment(
    name="figure2",
    title="Figure 2: triangles checked per pixel, direct and indirect mapping",
    presets={
        "quick": Preset(
            256, 256, ("buddha",), METHODS, frames=1, samples=3, most=3, rounds=2, budget_s=15.0, maps=True
        ),
        "paper": Preset(
            1024, 1024, ("buddha",), METHODS, frames=1, samples=10, most=40, deviation=0.005, stage_samples=10,
            rounds=3, budget_s=30.0, timeout_s=600.0, maps=True,
        ),
    },
    draw=draw,
)  # fmt: skip
