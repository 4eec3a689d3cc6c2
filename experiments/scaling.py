"""How the whole frame's time grows: with triangles, with pixels, and with lights; everything rebuilt every frame.

The scene holds the same surfaces at every triangle count (:mod:`.scene.standins.balls`), so that rays meet the same
things. One sweep follows the other, each from one common point: 300,000 triangles, 1024x1024, one light.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

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
    """The given numbers of lights, turned evenly about the middle of the scene."""
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


class Growth(NamedTuple):
    """time ~ x^exponent from ``first`` on; ``half`` the 95 % interval of the exponent, None for two points."""

    exponent: float
    half: float | None
    first: float

    def __str__(self) -> str:
        return f"{self.exponent:.2f}" + ("" if self.half is None else f" ± {self.half:.2f}")


def growth(line: pd.DataFrame, sweep: str) -> Growth | None:
    """The exponent over the upper half of a line's points, where fixed costs count least; four points at least.

    Least squares of logarithms. None for a single point.
    """
    from scipy import stats

    if len(line) < 2:
        return None
    x, ms = line[[sweep, "total_ms"]].astype("float64").tail(max(4, (len(line) + 2) // 2)).to_numpy().T
    found = stats.linregress(np.log(x), np.log(ms))
    half = float(stats.t.ppf(0.975, len(x) - 2) * found.stderr) if len(x) > 2 else None
    return Growth(float(found.slope), half, float(x[0]))


def along(table: pd.DataFrame, sweep: str) -> pd.DataFrame:
    """The points that differ in nothing but what is swept, in its order; none where no label has several times.

    The sweeps cross in one point; along each, more values of its own column are found there than elsewhere.
    """
    others = [column for column in SWEEPS if column != sweep]
    most = table.groupby(others, sort=False)[sweep].nunique().idxmax()
    line = table[(table[others] == list(most)).all(axis=1)].sort_values(sweep, kind="stable")
    return line if document.measured(line).duplicated("label").any() else line[:0]


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """Three drawings side by side, growth exponents with intervals, CSV."""
    import pandas as pd

    table = document.arranged(document.read(folder), "label", [OURS])
    lines = {sweep: along(table, sweep) for sweep in SWEEPS}
    table["sweep"] = [
        " ".join(name for name, line in lines.items() if key in line.index) for key in table.index
    ]
    titles = document.measured(table).sort_values("triangles")["scene_title"].unique()
    scenes = ", ".join(titles) if len(titles) <= 3 else f"{titles[0]} to {titles[-1]}"
    pictures, notes = [], [f"Scenes: {scenes}."] * bool(len(titles))
    gone = [sweep for sweep in SWEEPS if len(titles) and lines[sweep].empty]
    notes += [f"Not measured: time against {sweep}." for sweep in gone]
    every = pd.concat([line.assign(sweep=sweep, x=line[sweep]) for sweep, line in lines.items()])
    if len(every):
        pictures = [panels.lines(
            folder / "scaling.svg", every, "x", "total_ms", facet="sweep", across=every["sweep"].nunique(), whisker="spread",
            log_x=10, ticks=short, proportion=PROPORTION, wide=2, high=2.0, legend=4, below=notes,
            left="ms per frame, everything rebuilt", sharey=True,
        )]  # fmt: skip
    lines = {sweep: document.measured(line) for sweep, line in lines.items()}
    tables = {f"Against {sweep}": exponents(line, sweep) for sweep, line in lines.items()}
    ours = {sweep: growth(lines[sweep][lines[sweep]["label"] == OURS], sweep) for sweep in SWEEPS[:2]}
    told = [f"{sweep} to the power of {g} (from {short(g.first)})" for sweep, g in ours.items() if g]
    known = f"The frame time of {OURS} grows with {' and with '.join(told)}."
    finding = known if told else "No growth was measured."
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, pictures, quiet, notes)


def exponents(line: pd.DataFrame, sweep: str) -> pd.DataFrame:
    """A row a method, ours first: its first and last time; how it grows, or what a further light costs."""
    import pandas as pd

    rows = []
    for label, own in line.groupby("label", sort=False):
        x, ms = own[sweep].tolist(), own["total_ms"].tolist()
        ends = {f"{short(x[0])} {sweep}, ms": own["ms"].iloc[0], f"{short(x[-1])}, ms": own["ms"].iloc[-1]}
        rows.append({"method": label, **ends})
        if sweep == "lights":
            slope = float(np.polyfit(x, ms, 1)[0])
            rows[-1] |= {
                "a further light, ms": style.number(slope),
                "of the first frame": f"{slope / ms[0]:.0%}",
            }
        elif found := growth(own, sweep):
            rows[-1] |= {"exponent": str(found), "from": short(found.first)}
    return pd.DataFrame(rows)


def short(value: float) -> str:
    """A count for people: 300k, 10M."""
    for unit, letter in ((1e6, "M"), (1e3, "k")):
        if value >= unit:
            return f"{value / unit:.3g}{letter}"
    return f"{value:g}"


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
