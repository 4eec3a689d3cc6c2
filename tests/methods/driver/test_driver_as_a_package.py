"""What ``driver`` does, a package of someone else can do: its files, installed under another name, are such a method.

Nothing else of the project knows of it: memory that a library holds, shaders as further sources, launches by the host on
Warp's stream outside of graphs, a reason where a machine lacks something.
"""

import importlib
import re
import sys
from pathlib import Path

import pytest
from helpers.brute_force import make_scene, soup
from helpers.experiment_records import csv_of
from helpers.recorded_slangpy import recorded
from helpers.tiny_runs import write_scene
from shadowbench.experiments import frame_time
from shadowbench.harness.commands.show import show
from shadowbench.harness.frame import registry
from shadowbench.harness.frame.session import Session
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Options, Run
from shadowbench.harness.runner.source.closure import further_sources, source_files
from shadowbench.methods import driver

OWN = Path(driver.__file__).parent
ROOT = OWN.parents[1]
THEIRS = "their_driver"


@pytest.fixture
def installed(tmp_path, monkeypatch) -> Path:
    """What pip leaves behind of the same files as a package of their own."""
    package = tmp_path / "site" / THEIRS
    package.mkdir(parents=True)
    for file in OWN.iterdir():
        if file.suffix in (".py", ".slang"):
            text = file.read_text(encoding="utf-8").replace("from ...harness", "from shadowbench.harness")
            text = re.sub(r"from \.\.(?=\w)", "from shadowbench.methods.", text)
            (package / file.name).write_text(text.replace('name = "driver"', f'name = "{THEIRS}"'), encoding="utf-8")
    about = package.parent / f"{THEIRS}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {THEIRS}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[shadowbench.methods]\n{THEIRS} = {THEIRS}:Driver\n")
    monkeypatch.syspath_prepend(str(package.parent))
    importlib.invalidate_caches()
    yield package.parent
    for name in [name for name in sys.modules if name.partition(".")[0] == THEIRS]:
        del sys.modules[name]


def test_nothing_outside_its_package_knows_of_it_but_lists():
    """The experiments say whom they compare, an environment which versions of packages it has."""
    known = re.compile(r"slangpy|methods\.driver|\.driver import|Entry\(.driver")
    files = (path for part in ("harness", "methods", "experiments") for path in (ROOT / part).rglob("*.py"))
    named = {path.name for path in files if OWN not in path.parents and known.search(path.read_text("utf-8"))}
    assert named == {"_rivals.py", "environment.py"}


def test_the_same_files_are_a_method_of_another_package(installed, monkeypatch):
    device, memory = (importlib.import_module(f"{THEIRS}.{name}") for name in ("device", "memory"))
    cls = registry.method_class(THEIRS)
    assert cls.__module__ == f"{THEIRS}.method"
    assert [Path(name).name for name in further_sources(cls, source_files(cls))] == ["rays.slang"]
    made = recorded(monkeypatch, device, memory)
    prepared = make_scene(*soup(3, 60), [(0.1, 0.2, 3.0), (2.0, 0.2, 0.1)])
    session = Session(registry.make_method(THEIRS, {"build": "update"}), prepared, 8, 6, "cpu")
    assert not session.capturable
    assert not session.replays
    held = sum(len(buffer) for buffer in made.memory) + 2 * 1000
    assert session.method.held_bytes() == held > 0
    session.load(prepared.moment(0, 8, 6))
    session.run()
    assert made.device.create_command_encoder.return_value.begin_ray_tracing_pass.call_count == 3, "eye, two lights"


def test_where_it_cannot_run_its_row_says_why(installed, tmp_path, monkeypatch):
    """On a CPU, and where the machine lacks the package: in the record, and in the table beside the others."""
    monkeypatch.setenv("PYTHONPATH", str(installed))
    methods = (
        Entry("embree", {}, "Embree"),
        Entry(THEIRS, {}, "theirs"),
        Entry(THEIRS, {"api": "vulkan"}, "by Vulkan"),
    )
    lacks = driver.device.missing("vulkan")
    preset = frame_time.EXPERIMENT.presets["quick"]
    changed = {"width": 8, "height": 8, "samples": 1, "most": 1, "rounds": 1, "stage_samples": 1}
    if lacks is None:
        methods = methods[:2]
    preset = type(preset)(
        **{**vars(preset), **changed, "scenes": (write_scene(tmp_path / "t.obj"),), "methods": methods}
    )
    records = Run(Options(frame_time.EXPERIMENT, "quick", preset, "cpu", tmp_path / "out", score=False), Silent()).go()
    assert [record.status for record in records] == ["ok", *["skipped"] * (len(methods) - 1)]
    show("frame_time", tmp_path / "out", quiet=True)
    rows = {row["label"]: row for row in csv_of("frame_time", tmp_path / "out")}
    text = (tmp_path / "out/frame_time.md").read_text()
    for label, why in {"theirs": "runs on cuda only", "by Vulkan": lacks}.items():
        if label in rows:
            assert (rows[label]["status"], rows[label]["reason"]) == ("skipped", why)
            assert f"| {label} | - | - | skipped: {why} | - | - |" in text
