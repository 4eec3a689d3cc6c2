"""Methods as the registry finds them; cards with ray tracing units; Warp's headers, precompiled once for all processes."""

import importlib
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest
import warp as wp
from helpers.installed_package import declare_methods
from helpers.right_and_wrong_methods import Point
from shadowbench.harness.errors import UserError, did_you_mean
from shadowbench.harness.frame import registry
from shadowbench.harness.frame.cards import has_ray_tracing_units
from shadowbench.harness.frame.devices import start_warp
from shadowbench.harness.frame.method import SimpleMethod
from shadowbench.harness.scene.scene import Camera, Light, Scene


@dataclass(frozen=True)
class Build:
    """How it is built.

    cells   cells along a side; more
            are slower
    padded  whether boxes are wider

    Not a parameter.
    """

    cells: int = 8
    padded: bool = False

    def __post_init__(self):
        if self.cells < 1:
            raise ValueError("cells must be at least 1")


@dataclass(frozen=True)
class Trace:
    reach: float = 1.0
    order: str = "near"


class Sample(SimpleMethod):
    name: ClassVar[str] = "sample"
    Build = Build
    Trace = Trace


@pytest.fixture
def sample(monkeypatch):
    monkeypatch.setattr(registry, "built_in_names", list)
    monkeypatch.setattr(registry, "_entry_points", lambda: {"sample": Point(Sample)})
    return "sample"


@pytest.mark.parametrize("name", ["../a", "a.1", "a b", "", "a\n", "a" * 101])
def test_a_name_that_no_file_can_have_is_refused(monkeypatch, name):
    monkeypatch.setattr(registry, "_entry_points", lambda: {name: Point(Sample)})
    with pytest.raises(UserError, match="a name has letters, digits, - and _ alone; correct its package"):
        registry.method_class(name)


def test_settings_reach_build_and_trace(sample):
    text = {"cells": "12", "padded": "TRUE", "reach": "2.5", "order": "far"}
    method = registry.make_method(sample, text)
    assert (method.build, method.trace) == (Build(12, True), Trace(2.5, "far"))
    assert registry.make_method(sample).build == Build()


def test_parameters_have_their_meaning_and_their_rule():
    found = {p.name: (p.default, p.kind, p.meaning, p.allowed) for p in registry.parameters(Sample)}
    assert found == {
        "cells": (8, "int", "cells along a side; more are slower", "must be at least 1"),
        "padded": (False, "bool", "whether boxes are wider", "must be true or false"),
        "reach": (1.0, "float", "", ""),
        "order": ("near", "str", "", ""),
    }


@pytest.mark.parametrize("name", registry.method_names())
def test_every_parameter_of_a_built_in_method_is_explained(name):
    for parameter in registry.parameters(registry.method_class(name)):
        assert parameter.meaning, parameter.name
        assert parameter.allowed.startswith("must "), parameter.name


@pytest.mark.parametrize(("settings", "said"), [
    ({"cell": "3"}, "sample has no parameter 'cell'; did you mean cells?"),
    ({"zzzzzz": "3"}, "sample has no parameter 'zzzzzz'; known: cells, order, padded, reach"),
    ({"cells": "many"}, "sample.cells='many': not a whole number"),
    ({"cells": "2.5"}, "sample.cells='2.5': not a whole number"),
    ({"cells": "0"}, "sample.cells='0': cells must be at least 1"),
    ({"padded": "perhaps"}, "sample.padded='perhaps': not true or false"),
    ({"reach": ""}, "sample.reach='': not a number"),
])  # fmt: skip
def test_wrong_settings_are_refused(sample, settings, said):
    with pytest.raises(UserError, match=f"^{re.escape(said)}"):
        registry.make_method(sample, settings)


def test_an_unknown_method_has_a_guess(sample):
    with pytest.raises(UserError, match=r"no method 'sampel'; did you mean sample\?"):
        registry.make_method("sampel")


@pytest.mark.parametrize(("method", "settings", "said"), [
    ("warp_bvh", {"update": "refti"}, "warp_bvh.update='refti': update must be one of .*"),
    ("uniform_grid", {"density": "1e30"}, "uniform_grid.density='1e30': density must lie between 0 and 1000 .*"),
])  # fmt: skip
def test_what_a_value_may_be_is_said_without_its_type(method, settings, said):
    with pytest.raises(UserError, match=f"^{said}$"):
        registry.make_method(method, settings)


@pytest.mark.parametrize(("word", "known", "hint"), [
    ("ray_grids", ["uniform_grid"], "; known: uniform_grid"),
    (".txt", [".stl", ".obj"], "; known: .obj, .stl"),
    ("unifrm_grid", ["uniform_grid", "ray_grids"], "; did you mean uniform_grid?"),
])  # fmt: skip
def test_only_a_misspelt_name_has_a_guess(word, known, hint):
    assert did_you_mean(word, known) == hint


def test_every_built_in_method_can_be_made():
    names = registry.method_names()
    assert names, "no method found in the methods package"
    for name in registry.built_in_names():
        method = registry.make_method(name)
        assert method.name == name
        assert method.title


PACKAGE = """
from shadowbench.harness.frame.method import SimpleMethod

class Brute(SimpleMethod):
    devices = ("cpu",)
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    (tmp_path / "someones_method.py").write_text(PACKAGE)
    declare_methods(tmp_path, "someones_method", {"brute": "someones_method:Brute", "gone": "someones_method:Missing"})
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    yield
    sys.modules.pop("someones_method", None)


def test_a_method_of_another_package_is_found_and_says_where_it_runs(installed):
    assert "brute" in registry.method_names()
    scene = Scene("room", "Room", lambda: 1 / 0, Camera((0.0, 9.0, 0.1), (0.0, 0.0, 0.0)), (Light((0.0, 2.0, 0.0)),))
    assert registry.make_method("brute").applies(scene, "cpu") is None
    assert registry.make_method("brute").applies(scene, "cuda:0") == "runs on cpu only"


def test_an_entry_point_that_leads_nowhere_is_one_line(installed):
    with pytest.raises(UserError, match=r"'gone': someones_method:Missing cannot be imported"):
        registry.make_method("gone")


@pytest.mark.parametrize(("capability", "name", "has"), [
    (61, "NVIDIA GeForce GTX 1080", False), (70, "Tesla V100-SXM2-16GB", False),
    (75, "NVIDIA GeForce RTX 2080 Ti", True), (75, "Quadro RTX 6000", True), (75, "TITAN RTX", True),
    (75, "Tesla T4", True), (75, "NVIDIA GeForce GTX 1660 Ti", False), (75, "NVIDIA T1000", False),
    (80, "NVIDIA A100-SXM4-80GB", False), (86, "NVIDIA A10", True), (86, "NVIDIA GeForce RTX 3090", True),
    (89, "NVIDIA L40S", True), (90, "NVIDIA H100 80GB HBM3", False), (90, "NVIDIA H200", False),
    (100, "NVIDIA B200", False), (120, "NVIDIA GeForce RTX 5090", True), (87, "Orin", None),
])  # fmt: skip
def test_ray_tracing_units(capability, name, has):
    assert has_ray_tracing_units(capability, name) is has


@pytest.fixture
def kernels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder of compiled kernels."""
    with monkeypatch.context() as changed:
        changed.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
        start_warp()
        yield tmp_path
    start_warp()


def compiled(number: int) -> int:
    """What a kernel that has to be compiled writes: the number."""

    @wp.kernel(enable_backward=False, module="unique")
    def write_kernel(result: wp.array(dtype=wp.int32)):
        result[0] = wp.static(number)

    result = wp.zeros(1, dtype=wp.int32, device="cpu")
    wp.launch(write_kernel, dim=1, outputs=[result], device="cpu")
    return int(result.numpy()[0])


def test_the_copy_lies_beside_the_kernels_and_serves_the_next_one(kernels, capfd):
    assert compiled(41) == 41
    (copy,) = kernels.glob("wp_headers_*/*.pch")
    made = copy.stat().st_mtime_ns
    assert (compiled(42), copy.stat().st_mtime_ns) == (42, made)
    assert "PCH" not in capfd.readouterr().err
