"""Rays through the cells of one grid: what they test, and frame after frame."""

import numpy as np
from helpers.brute_force import make_scene, soup
from helpers.method_trials import assert_same, trace
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

NAME = "uniform_grid"


def test_replayed_frames_equal_fresh_ones(device):
    """Moving geometry, replayed (as one graph on CUDA): no frame may see anything of the one before."""
    vertices, faces = soup(11, 200, size=0.2)
    random = np.random.default_rng(2)
    moved = [vertices, vertices * 1.5, vertices + random.normal(size=vertices.shape) * 0.1, vertices * 0.1]
    scene = Scene(
        "moving",
        "moving",
        lambda: Geometry(faces.astype(np.int32), lambda k: moved[k], len(moved)),
        Camera((0.0, 0.0, 3.0), (0.0, 0.0, 0.0)),
        (Light((2.0, 3.0, 4.0)),),
    )
    prepared = prepare(scene)
    session = Session(make_method(NAME), prepared, 24, 16, device)
    for k in (0, 1, 2, 3, 0):
        moment = prepared.moment(k, 24, 16)
        session.load(moment)
        session.run_complete()
        session.frame.answers.poison()
        session.replay()
        fresh = Session(make_method(NAME), prepared, 24, 16, device).answers(moment)
        assert_same(session.frame.answers.to_host(), fresh, f"frame {k}")


def test_counted_tests_are_those_of_the_cells_walked():
    """One cell: every ray that enters it tests every triangle, and counting changes no answer."""
    vertices, faces = soup(5, 30, size=0.1)
    prepared = make_scene(vertices, faces, [(0.0, 0.0, 9.0)], (0.0, 0.0, 0.05), fov=120.0)
    session, _, before = trace(NAME, {"density": "0.001"}, prepared, 16, 16)
    primary, _ = session.method.tests_per_pixel()
    assert (primary == 30).all()
    counters = session.method.counters()
    assert counters["primary tests"] == 30 * 256
    assert 0 < counters["shadow tests"] < 30 * 256
    assert_same(session.frame.answers.to_host(), before)
