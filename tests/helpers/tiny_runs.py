"""For tests of whole runs: an installed package of misbehaving methods, a tiny scene, and options for a run of them."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

from helpers import misbehaving_methods
from helpers.installed_package import declare_methods
from shadowbench.harness.results.record import Record
from shadowbench.harness.runner.planning.experiment import Entry, Experiment, Preset
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Options, Run

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"

PRESET = Preset(
    width=8, height=8, scenes=(), methods=(), frames=2, samples=3, most=3, stage_samples=2, rounds=2, budget_s=5.0,
    timeout_s=120.0,
)  # fmt: skip


def install_misbehaving(folder: Path) -> str:
    """Put the package where Python finds it as an installed one; return the PYTHONPATH that workers need."""
    package = folder / "misbehaving_package"
    package.mkdir(parents=True)
    shutil.copy(misbehaving_methods.__file__, package / "__init__.py")
    methods = {cls.name: f"misbehaving_package:{cls.__name__}" for cls in misbehaving_methods.CLASSES}
    declare_methods(folder, "misbehaving_package", methods)
    return os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)


def write_scene(path: Path) -> str:
    """A tetrahedron as an OBJ file; its path as a person types it."""
    path.write_text(TETRAHEDRON)
    return str(path)


def options(out: Path, scenes: list[str], methods: list[str | Entry], **changes) -> Options:
    """Options of a run on the CPU. ``changes``: fields of the preset, or of the options."""
    own = {name: changes.pop(name) for name in ("retry", "save_answers", "score", "seed") if name in changes}
    entries = tuple(entry if isinstance(entry, Entry) else Entry(entry) for entry in methods)
    preset = replace(PRESET, scenes=tuple(scenes), methods=entries, **changes)
    experiment = Experiment("trial", "A trial", {"quick": preset})
    return Options(experiment, "quick", preset, "cpu", out, **{"score": False, **own})


def go(chosen: Options) -> dict[str, Record]:
    """Run, and return the records by the label of their method."""
    return {record.method["label"]: record for record in Run(chosen, Silent()).go()}


class Heard(Silent):
    """Keeps the messages of a run."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)
