"""What the method asks slangpy for, without a GPU: refusals, passes, arguments, memory. A recording stands for slangpy.

What it does, a package of someone else can do: its files, installed under another name, are such a method. Nothing else of
the project knows of memory that a library holds, shaders as further sources, launches by the host outside of graphs.
"""

import importlib
import re
import sys
from enum import IntFlag
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from helpers.holed_scenes import holed
from helpers.installed_package import declare_methods
from helpers.mirror_scenes import hall_of_mirrors
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame import registry
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.runner.source.closure import further_sources, source_files
from shadowbench.harness.scene.effects import Limits
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene
from shadowbench.methods import driver
from shadowbench.methods.driver import device, memory
from shadowbench.methods.rays.offset import SHADOW_END

SIZES = {"acceleration_structure_size": 1000, "scratch_size": 64, "update_scratch_size": 32}


class Flags(IntFlag):
    none, allow_update, prefer_fast_trace, prefer_fast_build = 0, 1, 4, 8


class Recording:
    """What slangpy was asked for. ``arguments``: of each root object; ``memory``: of each buffer; ``builds``: in order."""

    def __init__(self) -> None:
        self.arguments: list[dict] = []
        self.memory: list[np.ndarray] = []
        self.slangpy, self.device = MagicMock(), MagicMock()
        self.slangpy.AccelerationStructureBuildFlags = Flags
        self.slangpy.AccelerationStructureBuildDesc = lambda facts: SimpleNamespace(**facts)
        self.slangpy.ShaderCursor.side_effect = lambda root: self.arguments.append({}) or self.arguments[-1]
        self.device.get_acceleration_structure_sizes.return_value = SimpleNamespace(**SIZES)
        self.device.create_buffer.side_effect = self._buffer

    def _buffer(self, size: int, usage: object) -> SimpleNamespace:
        self.memory.append(np.zeros(size, dtype=np.uint8))
        return SimpleNamespace(device_address=self.memory[-1].ctypes.data, size=size)

    @property
    def builds(self) -> list:
        encoder = self.device.create_command_encoder.return_value
        return [call.kwargs for call in encoder.build_acceleration_structure.call_args_list]


def recorded(monkeypatch: pytest.MonkeyPatch, device: object, memory: object) -> Recording:
    """A recording in the place of slangpy and of what ``device`` and ``memory``, modules of the method, make with it."""
    made = Recording()
    monkeypatch.setitem(sys.modules, "slangpy", made.slangpy)
    monkeypatch.setattr(device, "device_of", lambda api, alias: made.device)
    monkeypatch.setattr(device, "pipeline_of", lambda api, alias, holes: ("program", "pipeline", "table"))
    monkeypatch.setattr(memory.SharedMemory, "submit", lambda self, encoder, reads=(), writes=(): encoder.finish())
    return made


SHADERS = Path(device.__file__).with_name("rays.slang").read_text(encoding="utf-8")
OWN = Path(driver.__file__).parent
THEIRS = "their_driver"
UNIFORMS = set(re.findall(r"^uniform .*?(\w+);", SHADERS, re.M))


@pytest.fixture
def recording(monkeypatch) -> Recording:
    return recorded(monkeypatch, device, memory)


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
    declare_methods(package.parent, THEIRS, {THEIRS: f"{THEIRS}:Driver"})
    monkeypatch.syspath_prepend(str(package.parent))
    importlib.invalidate_caches()
    yield package.parent
    for name in [name for name in sys.modules if name.partition(".")[0] == THEIRS]:
        del sys.modules[name]


def still(count: int = 60) -> Prepared:
    return make_scene(*soup(3, count), [(0.1, 0.2, 3.0), (2.0, 0.2, 0.1)])


def moving(frames: int = 3) -> Prepared:
    vertices, faces = soup(3, 20)
    geometry = Geometry(faces.astype(np.int32), lambda k: vertices + 0.1 * k, frames)
    return prepare(Scene("moving", "Moving", lambda: geometry, Camera((0, 0, 3), (0, 0, 0)), (Light((1.0, 2.0, 3.0)),)))


def session(prepared: Prepared, settings: dict[str, str] | None = None, limits: Limits | None = None) -> Session:
    return Session(make_method("driver", settings or {}), prepared, 8, 6, "cpu", limits=limits)


def test_values_that_are_not_known_are_refused():
    with pytest.raises(UserError, match="build must be one of fast-build, fast-trace, update, static"):
        make_method("driver", {"build": "fast"})
    with pytest.raises(UserError, match="origin must be one of exact, plain"):
        make_method("driver", {"origin": "near"})


def test_a_cpu_is_refused_and_each_thing_that_a_machine_lacks_is_named(monkeypatch, tmp_path):
    method, scene = make_method("driver", {}), still().scene

    def reason() -> str | None:
        device.missing.cache_clear()
        return method.applies(scene, "cuda:0")

    by_vulkan = make_method("driver", {"api": "vulkan"})
    assert by_vulkan.applies(scene, "cuda:0") == "by Vulkan it runs beside Warp on the CPU; give --device cpu"

    assert (method.applies(scene, "cpu") or "").startswith("by OptiX it runs on cuda only; try --set driver.api=vulkan")
    monkeypatch.setattr(
        device.importlib.metadata, "version", MagicMock(side_effect=device.importlib.metadata.PackageNotFoundError)
    )
    assert reason() == "the package slangpy is not installed; pip install 'shadowbench-rt[driver]'"
    monkeypatch.setattr(device.importlib.metadata, "version", lambda name: "0.43.1")
    for library in device.LIBRARIES.values():
        monkeypatch.setitem(library, sys.platform, str(tmp_path / "libnone.so"))
    assert re.search(r"libnone.so is missing; install the driver .*NVIDIA_DRIVER_CAPABILITIES=all", reason() or "")
    assert re.search(r"libnone.so is missing; install the loader", by_vulkan.applies(scene, "cpu") or "")
    monkeypatch.setattr(device.ctypes, "CDLL", lambda name: None)
    monkeypatch.setattr(device.sys, "platform", "linux")
    monkeypatch.setattr(device, "_toolkits", lambda: [tmp_path])
    assert re.search(r"cuda_runtime.h .* install the toolkit .* CUDA_PATH", reason() or "")
    (tmp_path / "include").mkdir()
    (tmp_path / "include/cuda_runtime.h").write_text("")
    assert reason() is None
    device.missing.cache_clear()


def test_the_shaders_have_the_constants_and_entry_points_of_the_method():
    assert SHADOW_END == 1 - 2.0**-22
    assert "SHADOW_END = 1.0f - 0x1p-22f;" in SHADERS
    fields = re.search(r"struct Hit\s*{(.*?)}", SHADERS, re.S)
    assert fields
    assert 4 * fields[1].count(";") == device.PAYLOAD
    entries = re.findall(r'\[shader\("(\w+)"\)\]\s*void (\w+)', SHADERS)
    assert [name for kind, name in entries if kind == "raygeneration"] == list(device.RAY_GENERATION)
    assert {name for kind, name in entries if kind != "raygeneration"} == {"missed", "found", "holed"}


@pytest.mark.parametrize("origin", ["exact", "plain"])
def test_every_argument_is_one_of_the_shaders_and_every_one_of_theirs_is_set(recording, origin):
    given: set[str] = set()
    for prepared in (still(), holed()[0], hall_of_mirrors(1)):
        own = session(prepared, {"origin": origin})
        own.load(prepared.moment(0, 8, 6))
        own.run()
        own.run()
        method = own.method
        rays = [(None, b) for b in range(own.effects.bounces + 1)]
        lights = [(i, b) for _, b in rays for i, wanted in enumerate(own.effects.shadows) if wanted]
        assert set(method._arguments) == {*rays, *lights}  # made once, not in every frame
        given = given.union(*recording.arguments)
        assert all(isinstance(value, int | bool | MagicMock) for one in recording.arguments for value in one.values())
    assert given == UNIFORMS


@pytest.mark.parametrize(
    ("build", "passes", "flags"),
    [("fast-build", "build", 8), ("fast-trace", "build", 4), ("update", "update", 5), ("static", None, 4)],
)
def test_what_is_built_when(recording, build, passes, flags):
    prepared = still()
    own = session(prepared, {"build": build})
    assert [p.name for p in own.passes if p.part == "build"] == ([passes] if passes else [])
    first, top = recording.builds
    assert (first["desc"].flags, first["src"]) == (flags, None)
    assert first["desc"].mode == recording.slangpy.AccelerationStructureBuildMode.build
    own.load(prepared.moment(0, 8, 6))
    own.run()
    later = recording.builds[2:]
    assert len(later) == (2 if passes else 0)
    if passes:
        updated = build == "update"
        modes = recording.slangpy.AccelerationStructureBuildMode
        assert later[0]["desc"].mode == (modes.update if updated else modes.build)
        assert later[0]["src"] is (first["dst"] if updated else None)
        assert later[1]["dst"] is top["dst"] is own.method._structure.top


def test_builds_read_the_points_of_the_frame(recording):
    prepared = moving()
    own = session(prepared)
    count = prepared.vertex_count
    for frame in (0, 2):
        moment = prepared.moment(frame, 8, 6)
        own.load(moment)
        own.run()
        np.testing.assert_array_equal(recording.memory[0].view(np.float32).reshape(count, 3), moment.points)
    np.testing.assert_array_equal(recording.memory[1].view(np.int32).reshape(-1, 3), prepared.faces)


def test_static_is_refused_for_a_mesh_that_moves(recording):
    with pytest.raises(UserError, match=r"driver\.build=static: moving moves over 3 frames; choose fast-build"):
        session(moving(), {"build": "static"})


def test_memory_of_the_driver_counts_and_is_limited(recording):
    prepared = still()
    own = session(prepared)
    vertices, indices = 12 * prepared.vertex_count, 12 * prepared.triangle_count
    assert own.method.held_bytes() == vertices + indices + 2 * (1000 + 64)
    with pytest.raises(CapacityRejected, match=r"the limit is 2,000"):
        session(prepared, limits=Limits(memory=2000))


def test_a_mesh_that_no_ray_can_hit_asks_the_driver_for_nothing(recording):
    odd = make_scene([[np.nan] * 3, [0, 0, 1], [0, 1, 0]], [[0, 1, 2]], [(0.0, 0.0, 2.0)])
    own = session(odd)
    assert not recording.builds
    assert own.method.held_bytes() == 0
    assert (own.answers(odd.moment(0, 8, 6))["triangle"] == -1).all()


def test_nothing_outside_its_package_knows_of_it_but_lists():
    """The experiments say whom they compare, an environment which versions of packages it has."""
    known = re.compile(r"slangpy|methods\.driver|\.driver import|Entry\(.driver")
    files = (path for part in ("harness", "methods", "experiments") for path in (OWN.parents[1] / part).rglob("*.py"))
    named = {path.name for path in files if OWN not in path.parents and known.search(path.read_text("utf-8"))}
    assert named == {"_rivals.py", "environment.py"}


def test_the_same_files_are_a_method_of_another_package(installed, monkeypatch):
    theirs, memory_of_theirs = (importlib.import_module(f"{THEIRS}.{name}") for name in ("device", "memory"))
    cls = registry.method_class(THEIRS)
    assert cls.__module__ == THEIRS
    assert [Path(name).name for name in further_sources(cls, source_files(cls))] == ["rays.slang"]
    made = recorded(monkeypatch, theirs, memory_of_theirs)
    prepared = still()
    own = Session(registry.make_method(THEIRS, {"build": "update"}), prepared, 8, 6, "cpu")
    assert not own.capturable
    assert not own.replays
    held = sum(len(buffer) for buffer in made.memory) + 2 * 1000
    assert own.method.held_bytes() == held > 0
    own.load(prepared.moment(0, 8, 6))
    own.run()
    assert made.device.create_command_encoder.return_value.begin_ray_tracing_pass.call_count == 3, "eye, two lights"
