"""Methods by name: parameters from text, and a method that comes in someone else's package."""

import importlib
import sys
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from helpers.right_and_wrong_methods import Point
from shadowbench.harness.errors import UserError, did_you_mean
from shadowbench.harness.frame import registry
from shadowbench.harness.frame.method import SimpleMethod
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene


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
    assert method.build == Build(12, True)
    assert method.trace == Trace(2.5, "far")
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


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"cell": "3"}, ["no parameter 'cell'", "did you mean cells?"]),
        ({"zzzzzz": "3"}, ["no parameter 'zzzzzz'", "known: cells, order, padded, reach"]),
        ({"cells": "many"}, ["sample.cells='many': not a whole number"]),
        ({"cells": "2.5"}, ["not a whole number"]),
        ({"cells": "0"}, ["sample.cells='0': cells must be at least 1"]),
        ({"padded": "perhaps"}, ["not true or false"]),
        ({"reach": ""}, ["sample.reach='': not a number"]),
    ],
)
def test_wrong_settings_are_one_line(sample, settings, words):
    with pytest.raises(UserError) as caught:
        registry.make_method(sample, settings)
    assert all(word in str(caught.value) for word in words)
    assert "\n" not in str(caught.value)


def test_an_unknown_method_is_one_line_with_a_guess(sample):
    with pytest.raises(UserError, match=r"no method 'sampel'; did you mean sample\?"):
        registry.make_method("sampel")


def test_what_a_text_may_be_is_said_without_its_type():
    with pytest.raises(UserError) as caught:
        registry.make_method("warp_bvh", {"update": "refti"})
    assert str(caught.value).startswith("warp_bvh.update='refti': update must be one of ")


@pytest.mark.parametrize(
    ("word", "known", "hint"),
    [
        ("ray_grids", ["uniform_grid"], "; known: uniform_grid"),
        (".txt", [".stl", ".obj"], "; known: .obj, .stl"),
        ("unifrm_grid", ["uniform_grid", "ray_grids"], "; did you mean uniform_grid?"),
    ],
)
def test_only_a_misspelt_name_has_a_guess(word, known, hint):
    assert did_you_mean(word, known) == hint


def test_every_built_in_method_can_be_made():
    names = registry.method_names()
    assert names, "no method found in the methods package"
    for name in registry.built_in_names():
        method = registry.make_method(name)
        assert method.name == name
        assert method.title


PACKAGE = '''
import numpy as np

from shadowbench.harness.frame.method import SimpleMethod


class Brute(SimpleMethod):
    """Every ray against every triangle, on the host."""

    name = "brute"
    title = "Brute force"
    capturable = False
    devices = ("cpu",)

    def build_structure(self, frame):
        self.corners = frame.points.numpy().astype(np.float64)[frame.triangles.numpy()]

    def _closest(self, frame, origins, directions):
        a, b, c = self.corners.transpose(1, 0, 2)
        e, f = b - a, c - a
        n = np.cross(e, f)
        with np.errstate(divide="ignore", invalid="ignore"):
            det = -directions @ n.T
            ao = origins[:, None] - a[None]
            t = (ao * n).sum(-1) / det
            q = np.cross(directions[:, None], ao)
            u, v = -(q * f).sum(-1) / det, (q * e).sum(-1) / det
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (frame.valid.numpy() == 1)
        return np.where(inside, t, np.inf), u, v

    def trace_primary(self, frame):
        pixels = np.arange(frame.pixels)
        d = frame.column.numpy()[pixels % frame.width] + frame.row.numpy()[pixels // frame.width]
        self.d, self.o = d.astype(np.float64), np.broadcast_to(frame.eye.numpy(), d.shape).astype(np.float64)
        t, u, v = self._closest(frame, self.o, self.d)
        best = t.argmin(axis=1)
        rows = pixels, best
        hit = np.isfinite(t[rows])
        self.t = t[rows]
        frame.answers.triangle.assign(np.where(hit, best, -1).astype(np.int32))
        frame.answers.t.assign(t[rows].astype(np.float32))
        frame.answers.u.assign(np.where(hit, u[rows], 0).astype(np.float32))
        frame.answers.v.assign(np.where(hit, v[rows], 0).astype(np.float32))

    def trace_shadow(self, frame, light):
        hit = np.isfinite(self.t)
        where = self.o + self.d * np.where(hit, self.t, 0)[:, None]
        to_light = frame.lights.numpy()[light].astype(np.float64) - where
        t = self._closest(frame, where + 1e-6 * to_light, to_light)[0]
        frame.answers.shadowed[light].assign((hit & (t.min(axis=1) < 1)).astype(np.uint8))
'''


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """What pip leaves behind: a module, and a dist-info folder that declares the entry points."""
    (tmp_path / "someones_method.py").write_text(PACKAGE)
    info = tmp_path / "someones_method-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: someones-method\nVersion: 1.0\n")
    lines = ["brute = someones_method:Brute", "gone = someones_method:Missing"]
    (info / "entry_points.txt").write_text("[shadowbench.methods]\n" + "\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    yield
    sys.modules.pop("someones_method", None)


def room() -> Scene:
    """A floor with a square hovering over it, seen from above with the light straight over the square."""
    square = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    points = np.vstack([square * 4, square + [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    camera = Camera((0.0, 9.0, 0.1), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 60.0)
    return Scene("room", "Room", lambda: Geometry.static(points, faces), camera, (Light((0.0, 2.0, 0.0)),))


def test_a_method_of_another_package_is_found_and_runs(installed):
    assert "brute" in registry.method_names()
    method = registry.make_method("brute")
    prepared = prepare(room())
    session = Session(method, prepared, 16, 16, "cpu")
    assert [step.name for step in session.passes] == ["build", "primary rays", "light 0: shadow rays"]
    moment = prepared.moment(0, 16, 16)
    answers = session.answers(moment)
    triangle, shadowed = answers["triangle"].reshape(16, 16), answers["shadowed"][0].reshape(16, 16)
    assert triangle[8, 8] in (2, 3)
    assert triangle[2, 2] in (0, 1)
    assert triangle[0, 0] == -1
    assert shadowed[8, 8] == 0
    assert shadowed[2, 2] == 0
    assert shadowed[0, 0] == 0
    # The shadow is twice as wide as the square: floor beside it lies in the dark, and only floor does.
    dark = triangle[shadowed == 1]
    assert len(dark) > 4
    assert set(dark.tolist()) <= {0, 1}
    assert np.isinf(answers["t"][answers["triangle"] == -1]).all()
    places = moment.eye + moment.directions(np.arange(256)) * answers["t"][:, None]
    floor = np.isin(answers["triangle"], (0, 1))
    assert np.abs(places[floor, 1]).max() < 1e-5


def test_an_entry_point_that_leads_nowhere_is_one_line(installed):
    with pytest.raises(UserError, match=r"'gone': someones_method:Missing cannot be imported"):
        registry.make_method("gone")


def test_a_method_that_cannot_run_here_says_why(installed):
    assert registry.make_method("brute").applies(room(), "cuda:0") == "runs on cpu only"


def test_a_number_that_is_refused_is_told_its_range_alone():
    with pytest.raises(UserError) as caught:
        registry.make_method("uniform_grid", {"density": "1e30"})
    assert str(caught.value) == "uniform_grid.density='1e30': density must lie between 0 and 1000 cells a triangle"
