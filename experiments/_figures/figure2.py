"""Figure 2: how many triangles each pixel's ray was checked against, one map a setting, all on one colour scale."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...harness.errors import UserError
from ...harness.report import points, style
from ...harness.report.sheet import title_of
from ...harness.results.pixel_maps import Counts, map_path, read_map

COLUMNS = [
    *points.COMMON, "tests_mean", "tests_median", "tests_p99", "tests_most",
    "speed_up", "most_share", "speed_up_same_tiles", "most_share_same_tiles",
]  # fmt: skip
"""``speed_up`` and ``most_share``: against direct mapping with tiles as large as indirect mapping's blocks;
``_same_tiles``: with tiles as small as its sorting tiles."""

NOTHING = "#d9d9d9"
"""Colour of pixels whose ray was checked against no triangle."""


def draw(folder: Path | str, quiet: bool, direct: tuple[str, str], indirect: str) -> list[Path]:
    """Maps, CSV and text.

    ``direct``: labels of both readings of direct mapping, tiles as large as the blocks of ``indirect`` first, then
    as small as its sorting tiles. Maps of these three are drawn; further settings stand in text and CSV.
    """
    folder = Path(folder)
    rows = points.rows(folder)
    shown = [*direct, indirect]
    files: list[Path] = []
    sentences = []
    for scene in dict.fromkeys(r["scene"] for r in rows):
        own = sorted(
            (r for r in points.measured(rows) if r["scene"] == scene),
            key=lambda r: shown.index(r["label"]) if r["label"] in shown else len(shown),
        )
        maps = [read(folder, r) for r in own]
        compare(own, maps, direct)
        known = {r["label"]: r for r in own}
        if indirect in known and known.keys() & set(direct):
            sentences.append(sentence(own, direct, indirect))
            drawn = [i for i, r in enumerate(own) if r["label"] in shown]
            path = folder / f"figure2-{scene}.png"
            files.append(picture([own[i] for i in drawn], [maps[i] for i in drawn], path))
    files.insert(0, points.write_csv(rows, folder / "figure2.csv", COLUMNS))
    title = "Figure 2: triangles checked per pixel, direct and indirect mapping"
    return points.report(folder, "figure2", title, sentences, files, rows, quiet)


def read(folder: Path, row: dict[str, Any]) -> Counts:
    """The counts [height, width] of a point's last frame. Raises :class:`UserError` where they are not kept."""
    path = map_path(folder, row["key"], row["record"]["frames"][-1]["frame"])
    if not path.exists():
        raise UserError(f"{path}: not there; run figure2 again into a new folder")
    return read_map(path)


def compare(rows: Sequence[dict[str, Any]], maps: Sequence[Counts], direct: tuple[str, str]) -> None:
    """Add the tests' statistics to the rows, and what changed against both readings of direct mapping."""
    for r, counts in zip(rows, maps, strict=True):
        seen = counts[counts > 0] if (counts > 0).any() else np.zeros(1)
        r.update(tests_mean=float(counts.mean()), tests_median=float(np.median(seen)))
        r.update(tests_p99=float(np.percentile(seen, 99)), tests_most=int(counts.max()))
    for label, ending in zip(direct, ("", "_same_tiles"), strict=True):
        base = next((r for r in rows if r["label"] == label), None)
        if base is None:
            continue
        for r in rows:
            r[f"speed_up{ending}"] = base["trace_ms"] / r["trace_ms"] - 1 if r["trace_ms"] else None
            r[f"most_share{ending}"] = r["tests_most"] / base["tests_most"] if base["tests_most"] else None


def sentence(rows: Sequence[dict[str, Any]], direct: tuple[str, str], indirect: str) -> str:
    """What indirect mapping changed against each reading of direct mapping, beside what the paper says."""
    known = {r["label"]: r for r in rows}
    ours = known[indirect]
    text = f"{title_of(ours)}: {checks(ours)}."
    for label, ending in zip(direct, ("", "_same_tiles"), strict=True):
        base = known.get(label)
        if base is None:
            continue
        speed = ours[f"speed_up{ending}"]
        faster = f"{abs(speed):.0%} {'faster' if speed >= 0 else 'slower'}"
        text += (
            f" Against {checks(base)}: {ours[f'most_share{ending}']:.0%} of the maximum, and primary rays are traced "
            f"{faster}."
        )
    for r in rows:
        if r["label"] not in (*direct, indirect):
            text += f" Beside them, {checks(r)}."
    return f"{text} The paper: less than half of the maximum, 30-50 % faster."


def checks(r: dict[str, Any]) -> str:
    """A setting, the triangles that it checks for a pixel, and its time, as a phrase."""
    return (
        f"{r['label']} (at most {r['tests_most']:,} triangles for a pixel, {r['tests_mean']:.0f} on average, "
        f"{style.number(r['trace_ms'])} ms)"
    )


def picture(rows: Sequence[dict[str, Any]], maps: Sequence[Counts], path: Path) -> Path:
    """The maps side by side, cut to where any ray was checked; one scale for all, 0 to the most of any.

    Colours follow the square root: the most is several times what is usual.
    """
    import matplotlib
    from matplotlib.colors import PowerNorm
    from matplotlib.figure import Figure

    most = max(2, *(int(counts.max()) for counts in maps))
    part = occupied(maps)
    colours = matplotlib.colormaps["viridis"].with_extremes(bad=NOTHING)
    with matplotlib.rc_context({**style.axes_style(), "axes.grid": False}):
        height = part[0].stop - part[0].start
        tall = min(2.5, height / (part[1].stop - part[1].start))
        figure = Figure(
            figsize=(style.COLUMN_WIDTH, tall * style.COLUMN_WIDTH / len(maps) + 1.05), layout="constrained", dpi=250
        )  # fmt: skip
        panels = figure.subplots(1, len(maps), squeeze=False)[0]
        for axes, r, counts in zip(panels, rows, maps, strict=True):
            seen = np.ma.masked_equal(counts[part], 0)
            shown = axes.imshow(seen, cmap=colours, norm=PowerNorm(0.5, 0, most), interpolation="nearest")
            about = f"most {r['tests_most']:,}\nmean {r['tests_mean']:.0f}"
            axes.set_title(f"{r['label'].replace(', ', chr(10))}\n{about}", fontsize=6.5)
            axes.set_xticks([])
            axes.set_yticks([])
            axes.spines[:].set_visible(False)
        bar = figure.colorbar(
            shown, ax=list(panels), orientation="horizontal", shrink=0.9, aspect=35, pad=0.02
        )
        between = [x for x in (1, 3, 10, 30, 100, 300, 1000, 3000, 10000, 30000) if 0.01 < x / most < 0.75]
        bar.set_ticks([0, *between, most], labels=[f"{x:,}" for x in (0, *between, most)])
        bar.set_label(
            f"triangles checked for the pixel's primary ray (grey: none)\n{title_of(rows[0])}", fontsize=6.5
        )
        return points.save(figure, path, colours=128)


def occupied(maps: Sequence[Counts]) -> tuple[slice, slice]:
    """Rows and columns of the pixels that any map counts something in; all where there are none."""
    counted = np.any([counts > 0 for counts in maps], axis=0)
    if not counted.any():
        return slice(0, counted.shape[0]), slice(0, counted.shape[1])
    rows, columns = np.flatnonzero(counted.any(axis=1)), np.flatnonzero(counted.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
