"""Figure 2 of the paper: triangles checked per pixel, direct and indirect mapping of threads to rays.

Indirect mapping traces with blocks of 16 x 16 pixels and sorts triangles to the 2 x 2 (or 4 x 4) smaller tiles inside.
Direct mapping can be read in two ways: tiles as large as those blocks, or tiles as small as the sorting tiles, which
are blocks then. The paper: 30-50 % faster on Buddha, the maximum more than halved.
"""

from pathlib import Path

import numpy as np

from ..harness.errors import UserError
from ..harness.report import compare, document, numbers, panels
from ..harness.report.dataframe import DataFrame
from ..harness.results.pixel_maps import Counts, map_path, read_map
from ..harness.runner.planning.experiment import Experiment
from ._paper import faithful, large, small

DIRECT, INDIRECT = "direct, 16x16 tiles", "indirect, 2x2 of 8x8"
DIRECT_SMALL = "direct, 8x8 tiles"

METHODS = (
    faithful(DIRECT, tile="16", k="1"),
    faithful(INDIRECT, tile="8", k="2"),
    faithful("indirect, 4x4 of 4x4", tile="4", k="4"),
    faithful(DIRECT_SMALL, tile="8", k="1"),
)

SHOWN = (DIRECT, DIRECT_SMALL, INDIRECT)  # maps of these are drawn; further settings are in the table and the CSV
BASES = {"": DIRECT, "_same_tiles": DIRECT_SMALL}
MOST = "counter.primary tests, most"
STATISTICS = ["tests_mean", "tests_median", "tests_p99", "tests_most"]
COLUMNS = [
    *document.COMMON, *STATISTICS, "speed_up", "most_share", "speed_up_same_tiles", "most_share_same_tiles",
]  # fmt: skip
"""Against direct mapping with tiles as large as indirect mapping's blocks; ``_same_tiles``: as its sorting tiles."""
BLOCKS = {DIRECT: "direct mapping in blocks of 16x16 pixels", DIRECT_SMALL: "direct mapping in blocks of 8x8"}
TOLD = "against {}: {:.0%} as many triangles checked for the costliest pixel, primary rays traced {} times as fast"


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The maps side by side, the CSV, and the finding. Raises :class:`UserError` if the maps were not saved."""
    frames = document.frames(folder)
    table = document.named(frames)
    done = document.measured(table)
    paths = {row.key: map_path(folder, row.key, row.frame_numbers[-1]) for row in done.itertuples()}
    if lost := [path for path in paths.values() if not path.exists()]:
        raise UserError(f"{lost[0]}: not there; run figure2 again into a new folder")
    maps = {key: read_map(path) for key, path in paths.items()}
    table[STATISTICS] = [statistics(maps.get(key)) for key in table.index]
    for ending, label in BASES.items():
        own, base = compare.pairs(frames, frames["label"] == label)
        half = [(x["trace_iqr_ms"] / 2).where(x["samples"] > 1) for x in (own, base)]
        ratio, around = compare.over(base["trace_ms"], half[1], own["trace_ms"], half[0])
        table[f"speed_up{ending}"], table[f"told{ending}"] = ratio - 1, numbers.carry(ratio, around)
        table[f"most_share{ending}"] = own.get(MOST, np.nan) / base.get(MOST, np.nan)
    done = table.loc[done.index]
    pictures = [
        picture(own.set_index("label"), maps, folder / f"figure2-{name}.png")
        for name, own in done[done["label"].isin(SHOWN)].groupby("file", sort=False)
        if INDIRECT in set(own["label"]) and len(own) > 1
    ]
    known = done[done["label"] == INDIRECT].dropna(subset="speed_up").head(1).to_dict("records")
    told = [TOLD.format(BLOCKS[x], r[f"most_share{n}"], r[f"told{n}"]) for n, x in BASES.items() for r in known]
    finding = (
        f"Indirect mapping (2x2 tiles of 8x8 pixels in a block of 16x16), {'; '.join(told) or 'not measured'}. "
        "The paper: less than half as many, 1.3 to 1.5 times as fast."
    )
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, {}, pictures, quiet)


def statistics(counts: Counts | None) -> list[float]:
    """Mean over all pixels; median and 99th percentile over those whose ray was checked at all; the most."""
    if counts is None:
        return [float("nan")] * len(STATISTICS)
    seen = counts[counts > 0] if counts.any() else np.zeros(1)
    return [float(x) for x in (counts.mean(), np.median(seen), np.percentile(seen, 99), counts.max())]


def picture(own: DataFrame, maps: dict[str, Counts], path: Path) -> Path:
    """The maps side by side, cut to where any ray was checked; one scale for all, 0 to the most of any."""
    import matplotlib
    from matplotlib.colors import PowerNorm

    rows = own.loc[[label for label in SHOWN if label in own.index]]
    counted = np.any([maps[key] for key in rows["key"]], axis=0)
    part = np.ix_(counted.any(axis=1), counted.any(axis=0)) if counted.any() else ...
    shown = [
        (f"{r.Index}\nmost {r.tests_most:,.0f}, mean {r.tests_mean:.0f}", np.ma.masked_equal(maps[r.key][part], 0))
        for r in rows.itertuples()
    ]
    # Colours follow the square root: the most is several times what is usual.
    norm = PowerNorm(0.5, 0, max(2.0, rows["tests_most"].max()))
    colours = matplotlib.colormaps["viridis"].with_extremes(bad="#d9d9d9")
    about = f"triangles checked for the pixel's primary ray (grey: none)\n{rows['title'].iloc[0]}"
    return panels.images(path, shown, across=len(shown), scale=(colours, norm, about), dpi=250, colours=128)


EXPERIMENT = Experiment(
    "figure2", "Figure 2: triangles checked per pixel, direct and indirect mapping",
    {
        "quick": small(256, ("buddha",), METHODS, 15.0, stage_samples=2, rounds=2, maps=True),
        "paper": large(("buddha",), METHODS, 20.0, most=30, stage_samples=5, maps=True),
    },
    draw,
)  # fmt: skip
