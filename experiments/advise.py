"""Which structure for a scene: the fastest of each kind, measured on this machine within minutes.

``shadowbench advise SCENE`` runs it. What would change the answer is read from records of :mod:`.crossover`.
"""

from __future__ import annotations

from pathlib import Path

from ..harness.files import write_atomic
from ..harness.report import document, ranking
from ..harness.runner.planning.experiment import Entry, Experiment, Preset
from . import _rivals, crossover

COLUMNS = [*document.COMMON, "times_fastest_exact", "memory_bytes", "built", "in_each_frame"]
KEPT = Path("results")
"""Where records of ``crossover`` are looked for."""
MORE = {"lights": "lights", "moving": "% of the triangles moving", "pixels": "pixels"}
"""What may change the answer for a given scene: columns of :func:`.crossover.read`, and their unit in a sentence."""


def draw(folder: Path, quiet: bool = False) -> list[Path]:
    """The methods of each scene sorted by time, two sentences, what would change the answer; also as CSV and JSON."""
    frames = document.frames(folder)
    done = ranking.ranked(frames)
    changes = what_changes(done, KEPT)
    table = document.named(frames).join(done["times"].rename("times_fastest_exact"))
    table["in_each_frame"] = table["label"].map(_rivals.REBUILDS)
    said = {"scenes": ranking.as_json(done, _rivals.REBUILDS), "what_would_change_it": changes}
    path = folder / "advise.json"
    write_atomic(path, said)
    return document.write(
        folder, EXPERIMENT, table, COLUMNS, ranking.finding(done), ranking.tables(done, _rivals.REBUILDS, frames), [path],
        quiet, [ranking.ABOUT, *changes],
    )  # fmt: skip


def what_changes(done: document.DataFrame, root: Path) -> list[str]:
    """One sentence for each of :data:`MORE`, from the records of ``crossover`` below ``root``.

    Those of the device that ``done`` was measured on count, else those of a device of its kind, which are named.
    """
    if done.empty:
        return []
    device, name = done["device"].iloc[0], done["device_name"].iloc[0]
    known = [crossover.read(place) for place in folders(root)]
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


def folders(root: Path) -> list[Path]:
    """The folders below ``root`` with records of ``crossover``, by their names."""
    return sorted(path.parent for path in root.glob("*/crossover*/records"))


EXPERIMENT = Experiment(
    name="advise",
    title="Which structure: the fastest of each kind",
    presets={
        "quick": Preset(
            256, 256, ("cloth",), (*_rivals.FEW, Entry("embree", {}, "Embree")), frames=1, samples=3, most=10,
            deviation=0.02, stage_samples=1, rounds=3, budget_s=6.0,
        ),
        "paper": Preset(
            1024, 1024, ("cloth",), _rivals.FEW, frames=1, samples=10, most=20, deviation=0.01, stage_samples=1, rounds=3,
            budget_s=0.5, timeout_s=120.0,
        ),
    },
    draw=draw,
)  # fmt: skip
