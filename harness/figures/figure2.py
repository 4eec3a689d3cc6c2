"""Figure 2: how many triangles each pixel's ray was checked against, one map a setting, all on one colour scale."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError
from ..maps import Counts, map_path, read_map
from . import points, style
from .sheet import title_of

COLUMNS = [*points.COMMON, "tests_mean", "tests_median", "tests_p99", "tests_most", "speed_up", "most_share"]
SHOWN = 2
"""Maps side by side; further settings stand in the CSV."""


def draw(folder: Path | str, quiet: bool, direct: str, indirect: str) -> list[Path]:
    """Maps, CSV and text. ``direct`` and ``indirect`` are the labels of the two settings that the paper shows."""
    folder = Path(folder)
    rows = points.rows(folder)
    files: list[Path] = []
    sentences = []
    for scene in dict.fromkeys(r["scene"] for r in rows):
        own = sorted(
            (r for r in points.measured(rows) if r["scene"] == scene),
            key=lambda r: [direct, indirect].index(r["label"]) if r["label"] in (direct, indirect) else SHOWN,
        )
        maps = [read(folder, r) for r in own]
        compare(own, maps, direct)
        if [r["label"] for r in own[:SHOWN]] == [direct, indirect]:
            sentences.append(sentence(own))
            files.append(picture(own[:SHOWN], maps[:SHOWN], folder / f"figure2-{scene}.png"))
    files.insert(0, points.write_csv(rows, folder / "figure2.csv", COLUMNS))
    title = "Figure 2: triangles checked per pixel, direct and indirect mapping"
    return points.report(folder, "figure2", title, sentences, files, rows, quiet)


def read(folder: Path, row: dict[str, Any]) -> Counts:
    """The counts [height, width] of a point's last frame. Raises :class:`UserError` where they are not kept."""
    path = map_path(folder, row["key"], row["record"]["frames"][-1]["frame"])
    if not path.exists():
        raise UserError(f"{path}: not there; run figure2 again into a new folder")
    return read_map(path)


def compare(rows: Sequence[dict[str, Any]], maps: Sequence[Counts], direct: str) -> None:
    """Add the tests' statistics to the rows, and what changed against direct mapping."""
    for r, counts in zip(rows, maps, strict=True):
        seen = counts[counts > 0] if (counts > 0).any() else np.zeros(1)
        r.update(tests_mean=float(counts.mean()), tests_median=float(np.median(seen)))
        r.update(tests_p99=float(np.percentile(seen, 99)), tests_most=int(counts.max()))
    base = next((r for r in rows if r["label"] == direct), None)
    if base is None:
        return
    for r in rows:
        r["speed_up"] = base["trace_ms"] / r["trace_ms"] - 1 if r["trace_ms"] else None
        r["most_share"] = r["tests_most"] / base["tests_most"] if base["tests_most"] else None


def sentence(rows: Sequence[dict[str, Any]]) -> str:
    """What indirect mapping changed, beside what the paper says of the Happy Buddha."""
    direct, indirect = rows[:SHOWN]
    speed = indirect["speed_up"]
    faster = f"{abs(speed):.0%} {'faster' if speed >= 0 else 'slower'}"
    text = (
        f"{title_of(direct)}: {indirect['label']} checks at most {indirect['tests_most']:,} triangles for a pixel "
        f"against {direct['tests_most']:,} with {direct['label']} ({indirect['most_share']:.0%} of it; the paper: "
        f"less than half), {indirect['tests_mean']:.0f} against {direct['tests_mean']:.0f} on average, and traces "
        f"primary rays in {style.number(indirect['trace_ms'])} ms against {style.number(direct['trace_ms'])} ms: "
        f"{faster} (the paper: 30-50 %)."
    )
    for r in rows[SHOWN:]:
        text += f" {r['label']}: at most {r['tests_most']:,}, {style.number(r['trace_ms'])} ms."
    return text


def picture(rows: Sequence[dict[str, Any]], maps: Sequence[Counts], path: Path) -> Path:
    """The maps side by side; one scale from 0 to the most of any of them."""
    import matplotlib
    from matplotlib.figure import Figure

    most = max(1, *(int(counts.max()) for counts in maps))
    with matplotlib.rc_context({**style.axes_style(), "axes.grid": False}):
        figure = Figure(figsize=(style.COLUMN_WIDTH, 2.5), layout="constrained", dpi=200)
        panels = figure.subplots(1, len(maps))
        for axes, r, counts in zip(panels, rows, maps, strict=True):
            shown = axes.imshow(counts, cmap="plasma", vmin=0, vmax=most, interpolation="nearest")
            axes.set_title(
                f"{r['label']}\nmost {r['tests_most']:,}, mean {r['tests_mean']:.0f}", fontsize=6.5
            )
            axes.set_xticks([])
            axes.set_yticks([])
            axes.spines[:].set_visible(False)
        bar = figure.colorbar(
            shown, ax=list(panels), orientation="horizontal", shrink=0.8, aspect=30, pad=0.02
        )
        bar.set_label(f"triangles checked for the pixel's primary ray; {title_of(rows[0])}", fontsize=6.5)
        return points.save(figure, path)
