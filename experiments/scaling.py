"""How the whole frame's time grows: with triangles, with pixels, and with lights; everything rebuilt every frame.

The scene holds the same surfaces at every triangle count (:mod:`.scene.standins.balls`), so that rays meet the same
things. One sweep follows the other, each from one common point: 300,000 triangles, 1024x1024, one light.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..harness.report import document, panels
from ..harness.report.dataframe import DataFrame, pd
from ..harness.runner.planning.experiment import Entry, Experiment, Preset
from ._paper import METHOD, large, small
from ._rivals import lights

OURS = "ray grids"
METHODS = (
    Entry("ray_grids", {}, OURS),
    Entry(METHOD, {}, "the paper's grids"),
    Entry("warp_bvh", {"update": "bvh_rebuild"}, "LBVH rebuilt in a graph"),
)


def sweeps(base: Preset, scenes: tuple[str, ...], sides: tuple[int, ...], counts: tuple[int, ...]) -> Preset:
    """``base``'s one scene at other triangle counts, other sizes, and other numbers of lights."""
    sizes = tuple(replace(base, width=side, height=side) for side in sides)
    return replace(base, scenes=(*base.scenes, *scenes), also=(*sizes, replace(base, lightings=lights(*counts))))


COLUMNS = [*document.COMMON, "pixels", "sweep", "memory_bytes"]
SWEEPS = ("triangles", "pixels", "lights")
PROPORTION = "dotted line: time in proportion, exponent 1"


def growth(line: DataFrame, sweep: str) -> tuple[float, float]:
    """The exponent e of time ~ x^e over a line's upper half (four points at least), and half its 95 % interval."""
    from scipy import stats

    if len(line) < 2:
        return math.nan, math.nan
    x, ms = line[[sweep, "total_ms"]].astype("float64").tail(max(4, (len(line) + 2) // 2)).to_numpy().T
    found = stats.linregress(np.log(x), np.log(ms))
    return float(found.slope), float(stats.t.ppf(0.975, len(x) - 2) * found.stderr)


def along(table: DataFrame, sweep: str) -> DataFrame:
    """The points that differ in nothing but what is swept, where the sweeps cross; none if no label has two times."""
    others = [column for column in SWEEPS if column != sweep]
    most = table.groupby(others, sort=False)[sweep].nunique().idxmax()
    line = table[(table[others] == list(most)).all(axis=1)].sort_values(sweep, kind="stable")
    line = line.assign(sweep=sweep, x=line[sweep])
    return line if document.measured(line).duplicated("label").any() else line[:0]


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Three drawings side by side, growth exponents with intervals, CSV."""
    table = document.arranged(document.read(folder), "label", [OURS])
    lines = {sweep: along(table, sweep) for sweep in SWEEPS}
    table["sweep"] = [" ".join(x for x, line in lines.items() if key in line.index) for key in table.index]
    titles = document.measured(table).sort_values("triangles")["scene_title"].unique()
    scenes = ", ".join(titles) if len(titles) <= 3 else f"{titles[0]} to {titles[-1]}"
    every = pd.concat(lines.values())
    notes = [f"Scenes: {scenes}."] * bool(scenes)
    notes += [f"Not measured: time against {x}." for x in SWEEPS if len(titles) and x not in set(every["sweep"])]
    picture = panels.lines(
        folder / "scaling.svg", every, "x", "total_ms", facet="sweep", across=len(SWEEPS), whisker="spread",
        log_x=10, ticks=short, proportion=PROPORTION, wide=2, high=2.0, legend=4, below="\n".join(notes),
        left="ms per frame, everything rebuilt", sharey=True,
    )  # fmt: skip
    done = document.measured(every)
    groups = done.groupby(["label", "sweep"], sort=False)
    rows = pd.DataFrame([(*name, grown(own)) for name, own in groups], columns=["label", "sweep", "growth"])
    tables = {"Frame time and its exponent": document.cross_table(rows, {"label": "method"}, "sweep", "growth")}
    told = [
        f"{first} {sweep} and {last}"
        for sweep, own in done[done["label"] == OURS].groupby("sweep", sort=False)
        for first, last in [ends(own, "with")]
    ]
    finding = f"A frame of {OURS} takes {'; '.join(told[:2])}." if told else f"{OURS} was not measured along a sweep."
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet, notes)


def ends(own: DataFrame, at: str) -> list[str]:
    """The first and the last time along a sweep."""
    return [f"{own['ms'].iloc[i]} ms {at} {short(own['x'].iloc[i])}" for i in (0, -1)]


def grown(own: DataFrame) -> str:
    """The first and the last time along a sweep, and its exponent with the half of its interval."""
    exponent, half = growth(own, "x")
    return f"{' to '.join(ends(own, 'at'))}, exponent {exponent:.2f}" + f" ± {half:.2f}" * (half == half)


def short(value: float) -> str:
    """A count in short form: 300k, 10M."""
    for unit, letter in ((1e6, "M"), (1e3, "k")):
        if value >= unit:
            return f"{value / unit:.3g}{letter}"
    return f"{value:g}"


EXPERIMENT = Experiment(
    "scaling", "Scaling: time against triangles, pixels and lights",
    {
        "quick": sweeps(
            small(128, ("balls-10k",), METHODS, 2.0, samples=2, most=3, rounds=2),
            ("balls-1k", "balls-3k", "balls-30k", "balls-100k"), (64, 256, 512), (2, 4, 8),
        ),
        "paper": sweeps(
            large(("balls-300k",), METHODS, deviation=0.01, timeout_s=120.0, memory=24 << 30),
            ("balls-10k", "balls-30k", "balls-100k", "balls-1m", "balls-3m", "balls-10m"), (256, 512, 2048, 4096),
            (2, 4, 8, 16),
        ),
    },
    draw,
)  # fmt: skip
