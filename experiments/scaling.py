"""How the whole frame's time grows: with triangles, with pixels, and with lights; everything rebuilt every frame.

The scene holds the same surfaces at every triangle count (:mod:`.scene.standins.balls`), so that rays meet the same
things. One sweep follows the other, each from one common point: 300,000 triangles, 1024x1024, one light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..harness.report import document, panels, style
from ..harness.runner.experiment import Entry, Experiment, Preset
from ..harness.scene.overrides import Lighting
from ._paper import METHOD

if TYPE_CHECKING:
    import pandas as pd

OURS = "ray grids"
METHODS = (
    Entry("ray_grids", {}, OURS),
    Entry(METHOD, {}, "the paper's grids"),
    Entry("warp_bvh", {"update": "bvh_rebuild"}, "LBVH rebuilt in a graph"),
)


def lights(*counts: int) -> tuple[Lighting, ...]:
    """So many lights, turned evenly about the middle of the scene."""
    return tuple(Lighting(f"{n} lights", count=n) for n in counts)


def sweeps(base: Preset, scenes: tuple[str, ...], sides: tuple[int, ...], counts: tuple[int, ...]) -> Preset:
    """``base``'s one scene at other triangle counts, other sizes, and other numbers of lights."""
    sizes = tuple(replace(base, width=side, height=side) for side in sides)
    return replace(
        base, scenes=(*base.scenes, *scenes), also=(*sizes, replace(base, lightings=lights(*counts)))
    )


COLUMNS = [*document.COMMON, "pixels", "sweep", "memory_bytes"]
SWEEPS = ("triangles", "pixels", "lights")
PROPORTION = "dotted line: time in proportion, exponent 1"


@dataclass(frozen=True)
class Growth:
    """time ~ x^exponent over the upper half of a line, least squares of logarithms.

    half   half the 95 % interval of the exponent; None where two points leave nothing to judge by
    """

    exponent: float
    half: float | None
    first: float
    last: float


def along(done: pd.DataFrame, sweep: str) -> pd.DataFrame:
    """The points that differ in nothing but what is swept, in its order.

    The sweeps cross in one point; along each, more values of its own column are found there than elsewhere.
    """
    others = [column for column in SWEEPS if column != sweep]
    if done.empty:
        return done
    most = done.groupby(others, sort=False)[sweep].nunique().idxmax()
    return done[(done[others] == list(most)).all(axis=1)].sort_values(sweep, kind="stable")


def growth(x: Sequence[float], ms: Sequence[float]) -> Growth | None:
    """The exponent over the upper half of the points, where fixed costs count least; four points at least."""
    from scipy import stats

    count = max(4, (len(x) + 2) // 2)
    if len(x) < 2:
        return None
    u, v = np.log(np.asarray(x[-count:], float)), np.log(np.asarray(ms[-count:], float))
    found = stats.linregress(u, v)
    half = float(stats.t.ppf(0.975, len(u) - 2) * found.stderr) if len(u) > 2 else None
    return Growth(float(found.slope), half, float(x[-len(u)]), float(x[-1]))


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Three drawings side by side, growth exponents with intervals, CSV."""
    table = document.read(folder)
    done = document.measured(table)
    lines = {sweep: along(done, sweep) for sweep in SWEEPS}
    on = [table["key"].isin(line["key"]) if len(done) else table["key"] == "" for line in lines.values()]
    table["sweep"] = [" ".join(compress(SWEEPS, flags)) for flags in zip(*on, strict=True)]
    files = [document.write_csv(table, folder / "scaling.csv", COLUMNS)]
    drawn = [sweep for sweep in SWEEPS if lines[sweep].duplicated("label").any()]
    titles = done.sort_values("triangles")["scene_title"].unique()
    scenes = ", ".join(titles) if len(titles) <= 3 else f"{titles[0]} to {titles[-1]}"
    if len(done):
        files.append(picture({s: lines[s] for s in drawn or SWEEPS[:1]}, scenes, folder / "scaling.svg"))
    tables = {f"Against {sweep}": exponents(lines[sweep], sweep) for sweep in drawn}
    notes = [f"Scenes: {scenes}. {PROPORTION[:1].upper()}{PROPORTION[1:]}."] * bool(len(done))
    notes += [f"Not measured: time against {sweep}." for sweep in SWEEPS if len(done) and sweep not in drawn]
    return document.write(
        folder, "scaling", EXPERIMENT.title, finding(lines), tables, files, table, quiet, notes
    )


def exponents(line: pd.DataFrame, sweep: str) -> pd.DataFrame:
    """A row a method, ours first: its first and last time; how it grows, or what a further light costs."""
    import pandas as pd

    rows = []
    for label, own in sorted(line.groupby("label", sort=False), key=lambda item: item[0] != OURS):
        x, ms = own[sweep].tolist(), own["total_ms"].tolist()
        row = {
            "method": label,
            f"{short(x[0])} {sweep}, ms": style.number(ms[0]),
            f"{short(x[-1])}, ms": style.number(ms[-1]),
        }
        found = growth(x, ms)
        if sweep == "lights":
            slope = float(np.polyfit(x, ms, 1)[0])
            row |= {"a further light, ms": style.number(slope), "of the first frame": f"{slope / ms[0]:.0%}"}
        elif found is not None:
            row["exponent"] = f"{found.exponent:.2f}" + ("" if found.half is None else f" ± {found.half:.2f}")
            row["from"] = short(found.first)
        rows.append(row)
    return pd.DataFrame(rows)


def finding(lines: dict[str, pd.DataFrame]) -> str:
    """How our time grows with triangles and with pixels."""
    told = []
    for sweep in SWEEPS[:2]:
        own = lines[sweep][lines[sweep]["label"] == OURS]
        found = growth(own[sweep].tolist(), own["total_ms"].tolist())
        if found:
            half = "" if found.half is None else f" ± {found.half:.2f}"
            told.append(f"{sweep} to the power of {found.exponent:.2f}{half} (from {short(found.first)})")
    return (
        f"The frame time of {OURS} grows with {' and with '.join(told)}."
        if told
        else "No growth was measured."
    )


def short(value: float) -> str:
    """A count for people: 300k, 10M."""
    for unit, letter in ((1e6, "M"), (1e3, "k")):
        if value >= unit:
            return f"{value / unit:.3g}{letter}"
    return f"{value:g}"


def picture(lines: dict[str, pd.DataFrame], scenes: str, path: Path) -> Path:
    """A panel a sweep on logarithmic axes, one that was not measured said to be so; a dotted line shows proportion."""
    import pandas as pd
    from matplotlib.ticker import NullLocator

    missing = [sweep for sweep in SWEEPS if sweep not in lines]
    every = pd.concat(lines.values())
    low, high = every["total_ms"].min(), every["total_ms"].max()
    labels = sorted(every["label"].unique(), key=lambda label: label != OURS)
    colours = style.colours(labels)
    size = (2 * style.COLUMN_WIDTH, 2.9)
    with panels.sheet(path, size, 1, len(lines), legend=len(labels) + 1, sharey=True) as (figure, grid):
        for axes, (sweep, line) in zip(grid[0], lines.items(), strict=True):
            for place, label in enumerate(labels):
                own = line[line["label"] == label]
                axes.errorbar(own[sweep], own["total_ms"], yerr=own["iqr_ms"] / 2, color=colours[label],
                              marker=style.MARKERS[place % 8], label=label, elinewidth=0.7)  # fmt: skip
            values = sorted(line[sweep].unique())
            if len(values) > 1:
                axes.plot([values[0], values[-1]], [0.8 * low, 0.8 * low * values[-1] / values[0]], color="0.7",
                          lw=0.9, ls=":", label=PROPORTION)  # fmt: skip
            axes.set_xscale("log")
            axes.set_xticks(values, map(short, values), rotation=45, ha="right", rotation_mode="anchor")
            axes.xaxis.set_minor_locator(NullLocator())
            if low > 0.0:
                axes.set_ylim(0.7 * low, 1.4 * high)
            style.plain_log(axes)
            axes.set_xlabel(sweep)
        grid[0, 0].set_ylabel("ms per frame, everything rebuilt")
        absent = f"; against {' and '.join(missing)}: not measured" if missing else ""
        figure.supxlabel(f"{scenes}{absent}", fontsize=7)
    return path


EXPERIMENT = Experiment(
    name="scaling",
    title="Scaling: time against triangles, pixels and lights",
    presets={
        "quick": sweeps(
            Preset(
                128, 128, ("balls-10k",), METHODS, frames=1, samples=2, most=3, stage_samples=1, rounds=2, budget_s=2.0,
            ),
            ("balls-1k", "balls-3k", "balls-30k", "balls-100k"), (64, 256, 512), (2, 4, 8),
        ),
        "paper": sweeps(
            Preset(
                1024, 1024, ("balls-300k",), METHODS, frames=1, samples=10, most=20, deviation=0.01, stage_samples=2,
                rounds=2, budget_s=1.5, timeout_s=120.0, memory=24 << 30,
            ),
            ("balls-10k", "balls-30k", "balls-100k", "balls-1m", "balls-3m", "balls-10m"), (256, 512, 2048, 4096),
            (2, 4, 8, 16),
        ),
    },
    draw=draw,
)  # fmt: skip
