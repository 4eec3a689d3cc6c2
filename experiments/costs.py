"""What a frame costs besides its time: energy, memory, work a ray, and what a second frame in flight adds.

Energy and frames in flight are measured in replays apart from the timed ones, after them, on a GPU
(:mod:`.harness.runner.measuring.costs`); the other costs are counted.
"""

from pathlib import Path

from ..harness.report import document, numbers, panels
from ..harness.report.dataframe import DataFrame
from ..harness.results.costs import LATENCIES, MISSING, NUMBERS
from ..harness.runner.planning.experiment import Entry, Experiment
from . import _rivals
from ._paper import SCENES, large, small

METHODS = (
    *_rivals.FEW, _rivals.REFITTED[0], *_rivals.REBUILT[3:], Entry("warp_bvh", {}, "mesh rebuilt"), _rivals.DRIVER[0],
)  # fmt: skip
COLUMNS = [*document.COMMON, *NUMBERS, *MISSING, *LATENCIES, "watts", "in_flight_gain", "memory_bytes"]
SHOWN = {  # the columns of the table, and their headings
    "title": "scene", "label": "method", "ms": "ms", "error": "answers", "energy_mj": "energy, mJ", "watts": "power, W",
    "memory_mb": "memory, MB", "bytes_per_ray": "bytes a ray", "fps": "frames/s", "fps_pair": "two in flight",
    "primary_tests": "tests, primary", "shadow_tests": "tests, shadow", "sah_cost": "SAH cost",
    "expected_tests": "expected tests",
}  # fmt: skip
ABOUT = (
    "Energy of a frame: what the card used above its idle power, {}, over replays of the frame; power: of the card while it "
    "replays them. Two in flight: frames of both together in a second. Memory: the most that the method held. "
    "Bytes a ray: memory over primary and shadow rays. Tests: of triangles, by a ray, where they are counted. SAH cost and "
    "expected tests: of a ray through the scene's box, in a tree, by the areas of its boxes; a node counts 1.2 tests."
)
MOST_IDLE = 0.75  # share of the power while frames are replayed that an idle card draws at most
NOT_IDLE = "something else used the card while it should have been idle"
LACKING = {"energy_missing": "No energy", "flight_missing": "No second frame in flight"}


def read(folder: Path) -> DataFrame:
    """The points, with power while frames are replayed, frames a second, and what a second one in flight adds. Energy
    above that of a card that was not idle says nothing: there is none.
    """
    table = document.read(folder)
    watts = table["idle_w"] + table["energy_mj"] / table["alone_ms"].fillna(table["total_ms"])
    busy = table["idle_w"] > MOST_IDLE * watts
    return table.assign(
        energy_mj=table["energy_mj"].mask(busy), energy_missing=table["energy_missing"].mask(busy, NOT_IDLE),
        idle_w=table["idle_w"].mask(busy), watts=watts.mask(busy),
        memory_mb=table["memory_bytes"].astype("float64") / 1e6,
        fps=1e3 / table["alone_ms"], fps_pair=1e3 / table["pair_ms"],
        in_flight_gain=table["alone_ms"] / table["pair_ms"],
    )  # fmt: skip


def lacking(table: DataFrame) -> list[str]:
    """One line per cost and reason that it is missing, with the methods; and those of which tests are not counted."""
    said = [f"{what} of {'; '.join(own['label'].unique())}: {reason}." for column, what in LACKING.items()
            for reason, own in table[table[column] != ""].groupby(column, sort=False)]  # fmt: skip
    kinds = {kind: table[table[f"{kind}_tests"].isna()]["label"].unique() for kind in ("primary", "shadow")}
    return said + [f"No triangle tests of {k} rays counted: {'; '.join(own)}." for k, own in kinds.items() if len(own)]


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """One table of all costs; the energy of each method; CSV."""
    table = read(folder)
    done = document.measured(table)
    texts = {c: numbers.carry(done[c], done[c] * 0.0) for c in SHOWN if done[c].dtype.kind == "f"}
    texts |= {c: done[c].map("{:,.0f}".format, na_action="ignore") for c in ("fps", "fps_pair", "bytes_per_ray")}
    tables = {"What a frame costs": done.assign(**texts)[[*SHOWN]].rename(columns=SHOWN)}
    known = done[done["energy_mj"].notna()]
    finding = numbers.ends(
        known, "energy_mj", "label", "A frame of {} takes the least energy, {} mJ above idle",
        ", and one of {} the most, {} mJ", "No energy was measured",
    ) + f"{numbers.over(known)}." + numbers.ends(
        done, "in_flight_gain", "label", " A second frame in flight helps {} the least: {} times as many frames a second",
        "; and {} the most: {} times", "",
    ) + "." * int(done["in_flight_gain"].notna().any())  # fmt: skip
    watts = [f"{own.median():.0f} W on {name}" for name, own in known.groupby("device_name")["idle_w"]]
    least = known.groupby("title", sort=False)["energy_mj"].transform("min")
    picture = panels.dots(
        folder / "costs.svg", known.assign(times=known["energy_mj"] / least), "label", "times", "title",
        below="energy of a frame over that of the method that takes the least on the scene",
    )  # fmt: skip
    notes = [ABOUT.format(numbers.listed(watts) or "which was not measured"), *lacking(done)]
    return document.write(folder, EXPERIMENT, table, COLUMNS, finding, tables, [picture], quiet, notes)


EXPERIMENT = Experiment(
    "costs", "What a frame costs besides its time",
    {
        "quick": small(64, ("cloth",), METHODS, 5.0, samples=1, costs_s=0.5),
        "paper": large(SCENES, METHODS, 30.0, samples=10, stage_samples=1, rounds=3, timeout_s=300.0, costs_s=1.0),
    },
    draw,
)  # fmt: skip
