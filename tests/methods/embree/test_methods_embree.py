"""Embree as a method (``embree/packets.py``): embreex's bits, nearly right, shadow rays that start off their
surface (``offset.py``), settings and threads that change nothing, a library that lacks.
"""

import ctypes

import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from helpers.method_trials import assert_lit, assert_nearly, lattice, moving, random_trial
from helpers.small_scenes import assert_same, make_scene, soup, trace
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.shapes import joined, moved
from shadowbench.harness.scene.effects import Effects
from shadowbench.methods.embree import library
from shadowbench.methods.embree.packets import Arguments
from shadowbench.methods.rays.offset import SHADOW_END

NAME = "embree"


@pytest.mark.parametrize("seed", range(6))
def test_random_scenes(seed):
    # The last two lights lie on a triangle up to rounding: whether it counts is not for float32 to say.
    assert_nearly(NAME, {}, *random_trial(seed + 300), share=0.02, lights=2)


@pytest.mark.parametrize("height", [0.0, 0.1, 1000.0])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_lit_plane_does_not_shadow_itself(scale, height):
    """The offset must exceed the rounding of the query, also where the plane's own coordinate is zero or large."""
    assert_lit(NAME, {}, height, scale)


def test_a_surface_at_the_light_does_not_count():
    floor = lattice(4)
    both = joined(floor, moved(floor, (0, 0, 1)))
    lights = [(0.1, 0.2, 1.0), (0.1, 0.2, 1.001)]
    got = trace(NAME, {}, make_scene(*both, lights, (0.0, 0.0, 0.9)), 16, 16)[2]
    below = got["triangle"] < len(floor[1])
    assert below.all()
    assert (got["shadowed"][0] == 0).all()
    assert (got["shadowed"][1] == 1).all()


@pytest.mark.parametrize("rays", ["single", "packet16"])
@pytest.mark.parametrize("robust", ["true", "false"])
def test_answers_are_embreex_own_bit_for_bit(rays, robust):
    """A wrong layout of a struct, or a wrong flag, cannot pass this."""
    prepared = make_scene(*soup(7, 3000), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    session, moment, got = trace(NAME, {"rays": rays, "robust": robust}, prepared, 45, 31)
    scene = EmbreeScene(robust=robust == "true")
    TriangleMesh(scene, moment.points, prepared.faces)
    pixels = np.arange(45 * 31)
    found = scene.run(moment.origins(pixels), moment.directions(pixels), query="INTERSECT", output=1)
    hit = found["primID"] >= 0
    assert 300 < hit.sum() < len(hit)
    np.testing.assert_array_equal(got["triangle"], found["primID"])
    for name, field in (("t", "tfar"), ("u", "u"), ("v", "v")):
        np.testing.assert_array_equal(got[name][hit], found[field][hit], name)
    # The starts of the last light's rays are still there.
    starts, ends = session.method._origins.numpy()[hit], np.full(hit.sum(), SHADOW_END, dtype=np.float32)
    bits = scene.run(starts, moment.lights[1] - starts, dists=ends, query="OCCLUDED") == 0
    assert 30 < bits.sum() < len(bits)
    np.testing.assert_array_equal(got["shadowed"][1][hit], bits)


SETTINGS = (
    {"update": "refit"}, {"update": "static"}, {"quality": "low"}, {"quality": "high", "build_threads": "1"},
    {"rays": "single", "threads": "3"}, {"threads": "1"}, {"threads": "7"}, {"threads": "0"}, {},
)  # fmt: skip


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_settings_change_no_answer(settings):
    prepared = make_scene(*soup(8, 500), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    expected, got = (trace(NAME, x, prepared, 97, 61)[2] for x in ({}, settings))
    assert_same(got, expected)


def test_a_refit_makes_no_new_tree():
    """Told by what Embree allocates in a later frame: a tree built again needs its memory again."""
    prepared, allocated = moving(False), {}
    for update in ("rebuild", "refit"):
        session = Session(make_method(NAME, {"update": update}), prepared, 8, 8, "cpu")
        session.answers(prepared.moment(0, 8, 8))
        taken: list[int] = []
        watch = MONITOR(lambda _, size, __, taken=taken: taken.append(max(0, size)) or True)
        watched = session.method._embree
        monitor = watched._library.rtcSetDeviceMemoryMonitorFunction
        monitor.argtypes = [ctypes.c_void_p, MONITOR, ctypes.c_void_p]
        monitor(watched._handle, watch, None)
        session.answers(prepared.moment(1, 8, 8))
        monitor(watched._handle, MONITOR(), None)
        allocated[update] = sum(taken)
    assert allocated["rebuild"] > 300 * 16
    assert allocated["refit"] < 0.1 * allocated["rebuild"]


MONITOR = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_bool)
"""RTCMemoryMonitorFunction."""


def test_a_library_that_cannot_be_used_is_one_line(monkeypatch, tmp_path):
    assert library.library_path().is_file()
    assert ctypes.sizeof(Arguments) == 40
    monkeypatch.setattr(library.Device, "fact", lambda self, number: 30 if number == library.VERSION_MAJOR else 30_102)
    with pytest.raises(
        UserError, match=r"^embree: version 3.1.2; the layout of rays is that of Embree 4: .*'embreex>=4'$"
    ):
        library.Device()

    class Empty:
        version, files = "4.4.0", ()

    monkeypatch.setattr("importlib.metadata.distribution", lambda name: Empty())
    with pytest.raises(UserError, match=r"^embree: embreex 4.4.0 has no library libembree4 beside it; .*$"):
        library.library_path()
    monkeypatch.undo()
    damaged = tmp_path / "libembree4.so.4"
    damaged.write_text("no library")
    monkeypatch.setattr(library, "library_path", lambda: damaged)
    with pytest.raises(UserError, match=r"^embree: .*libembree4.so.4 cannot be used \(.*\); reinstall embreex$"):
        library.library.__wrapped__()


def test_a_light_without_shadows_has_no_pass_and_no_bit():
    prepared = make_scene(*soup(7, 50), [(5.0, 4.0, 3.0), (1.0, 2.0, 3.0)])
    session = Session(make_method(NAME), prepared, 16, 16, "cpu", effects=Effects(shadows=(False, True)))
    got = session.answers(prepared.moment(0, 16, 16))
    assert [step.effect for step in session.passes] == [None, None, "shadows/1"]
    assert (got["shadowed"][0] == 0).all()
    assert got["shadowed"][1].sum() > 0


def test_runs_on_cpu_only_and_says_what_it_built():
    method = make_method(NAME, {"threads": "3"})
    prepared = make_scene(*soup(7, 5), [(5.0, 4.0, 3.0)])
    assert method.applies(prepared.scene, "cpu") is None
    assert "cpu only" in method.applies(prepared.scene, "cuda:0")
    built = method.built()
    assert (built["robust"], built["threads"]) == (True, 3)
    assert built["embreex"].startswith("4.")
