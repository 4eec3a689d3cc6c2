"""Which structure for a scene: the fastest of each kind, measured on this machine within minutes.

``shadowbench advise SCENE`` runs it. What would change the answer is read from records of :mod:`.crossover`.
"""

from pathlib import Path

from ..harness.files import write_atomic
from ..harness.report import document, ranking
from ..harness.report.dataframe import DataFrame
from ..harness.runner.planning.experiment import Entry, Experiment
from . import _rivals, crossover
from ._paper import large, small

QUICK = (*_rivals.FEW, Entry("embree", {}, "Embree"))
COLUMNS = [*document.COMMON, "times_fastest_exact", "memory_bytes", "built", "in_each_frame"]
KEPT = Path("results")  # where records of `crossover` are looked for
MORE = {"lights": "lights", "moving": "% of the triangles moving", "pixels": "pixels"}
"""What may change the answer for a given scene: columns of :func:`.crossover.read`, and their unit in a sentence."""


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The methods of each scene sorted by time, two sentences, what would change the answer; also as CSV and JSON."""
    frames = document.frames(folder)
    done = ranking.ranked(frames)
    done = done.assign(in_each_frame=_rivals.in_each_frame(done))
    changes, path = what_changes(done, KEPT), folder / "advise.json"
    write_atomic(path, {"scenes": ranking.as_json(done), "what_would_change_it": changes})
    table = document.named(frames).join(done["times"].rename("times_fastest_exact"))
    table["in_each_frame"] = _rivals.in_each_frame(table)
    tables = ranking.tables(done, frames)
    notes = [ranking.ABOUT, *changes]
    return document.write(folder, EXPERIMENT, table, COLUMNS, ranking.finding(done), tables, [path], quiet, notes)


def what_changes(done: DataFrame, root: Path) -> list[str]:
    """One sentence for each of :data:`MORE`, from the records of ``crossover`` below ``root``. Those of the device that
    ``done`` was measured on count, else those of a device of its kind, which are named.
    """
    if done.empty:
        return []
    device, name = done["device"].iloc[0], done["device_name"].iloc[0]
    known = [crossover.read(records.parent) for records in sorted(root.glob("*/crossover*/records"))]
    parts = [own for table in known for _, own in document.measured(table).groupby("device_name")]
    alike = [own for own in parts if own["device"].iloc[0].split(":")[0] == device.split(":")[0]]
    alike.sort(key=lambda own: (own["device_name"].iloc[0] == name, len(own)))
    if not alike:
        kind = "CPU" if device == "cpu" else "GPU"
        return [f"What would change the answer is not known: no records of crossover on a {kind} are in {root}/; "
                "`shadowbench run crossover` measures it."]  # fmt: skip
    best = alike[-1]
    exact = best[best["exact"] & (best["room"] == "")]
    where = f"crossover on {best['device_name'].iloc[0]}, scenes of balls"
    found = [crossover.over(crossover.along(exact, axis), axis, name) for axis, name in MORE.items()]
    return [f"What would change the answer ({where}): " + "; ".join(filter(None, found)) + "."]


EXPERIMENT = Experiment(
    "advise", "Which structure: the fastest of each kind",
    {
        "quick": small(256, ("cloth",), QUICK, 6.0, most=10, deviation=0.02, rounds=3),
        "paper": large(
            ("cloth",), _rivals.FEW, 0.5, samples=10, deviation=0.01, stage_samples=1, rounds=3, timeout_s=120.0
        ),
    },
    draw,
)  # fmt: skip
