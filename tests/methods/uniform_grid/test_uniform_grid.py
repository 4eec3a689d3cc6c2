"""The uniform grid: exact against float64 brute force, whatever its knobs; bins that miss nothing; growth."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from helpers.method_trials import assert_exact, hard_trials, lattice, random_trial, trace
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Limits
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

NAME = "uniform_grid"
TRIALS = {name: (prepared, width, height) for name, prepared, width, height in hard_trials()}


@pytest.mark.parametrize("seed", range(24))
def test_random_scenes_equal_brute_force(seed, device):
    random = np.random.default_rng(seed + 1000)
    settings = {
        "density": str(np.exp(random.uniform(-3, 6))),
        "capacity": str(random.integers(1, 2000)),
    }
    assert_exact(NAME, settings, *random_trial(seed), device)


@pytest.mark.parametrize("density", ["0.01", "4", "900"])
@pytest.mark.parametrize("trial", TRIALS)
def test_hard_scenes_equal_brute_force(trial, density, device):
    assert_exact(NAME, {"density": density}, *TRIALS[trial], device)


def test_runs_and_knobs_agree_bit_for_bit(device):
    prepared = make_scene(*soup(7, 400), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    reference = None
    for settings in ({}, {}, {"density": "0.5"}, {"density": "40"}, {"capacity": "3"}):
        got = trace(NAME, settings, prepared, 33, 21, device)[2]
        reference = reference or got
        for key, value in reference.items():
            np.testing.assert_array_equal(got[key], value, f"{key} {settings}")


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
        for key, value in session.frame.answers.to_host().items():
            np.testing.assert_array_equal(value, fresh[key], f"{key} frame {k}")


def test_a_capacity_that_does_not_suffice_grows():
    prepared = make_scene(*soup(7, 400), [(5.0, 4.0, 3.0)])
    session, _, got = trace(NAME, {"capacity": "1"}, prepared, 20, 20)
    assert session.regrown == 1
    ample, _, wanted = trace(NAME, {"capacity": "1000000"}, prepared, 20, 20)
    assert ample.regrown == 0
    assert session.method.counters() == ample.method.counters()
    for key, value in wanted.items():
        np.testing.assert_array_equal(got[key], value, key)


def test_a_need_beyond_the_limits_is_rejected():
    prepared = make_scene(*soup(7, 400), [(5.0, 4.0, 3.0)])
    moment = prepared.moment(0, 8, 8)
    session = Session(
        make_method(NAME, {"capacity": "1"}), prepared, 8, 8, "cpu", limits=Limits(memory=16000)
    )
    with pytest.raises(CapacityRejected, match="pairs"):
        session.answers(moment)
    with pytest.raises(CapacityRejected, match="cells"):
        Session(make_method(NAME, {"density": "100"}), prepared, 8, 8, "cpu", limits=Limits(memory=16000))


@pytest.mark.parametrize("density", ["0.3", "4", "60"])
@pytest.mark.parametrize(
    "trial", ["random", "teapot in a stadium", "triangles through every cell", "eye in a box"]
)
def test_every_cell_that_a_triangle_meets_lists_it(trial, density):
    """Points all over each triangle, and on its edges: the cell of each must hold the triangle."""
    prepared, width, height = random_trial(5) if trial == "random" else TRIALS[trial]
    session, moment, _ = trace(NAME, {"density": density}, prepared, width, height)
    method = session.method
    grid = method._grid.grid.numpy()[0]
    begin, end, members = (
        getattr(method._grid.binned.list, name).numpy() for name in ("begin", "end", "values")
    )
    random = np.random.default_rng(0)
    weights = np.concatenate(
        [random.dirichlet([0.4] * 3, 400), np.eye(3), random.dirichlet([1.0] * 2, 50) @ np.eye(3)[:2]]
    )
    lists = [set(members[b:e]) for b, e in zip(begin, end, strict=True)]
    for i in np.nonzero(moment.valid)[0]:
        p = weights @ moment.points[prepared.faces[i]].astype(np.float64)
        cell = np.floor((p - grid["origin"]) * grid["scale"]).astype(int)
        assert (cell >= 0).all()
        assert (cell < grid["res"]).all()
        flat = (cell[:, 2] * grid["res"][1] + cell[:, 1]) * grid["res"][0] + cell[:, 0]
        assert all(i in lists[k] for k in flat)


def test_a_slanted_triangle_is_not_binned_by_its_box():
    """One triangle across the diagonal of a grid: its cells go with its area, far fewer than its box has."""
    vertices, faces = np.array([[-1.0, -1, -1], [1, 1, -1], [-1, 1, 1]]), [[0, 1, 2]]
    session, _, _ = trace(NAME, {"density": "1000"}, make_scene(vertices, faces, [(0.0, 0.0, 5.0)]), 8, 8)
    counters = session.method.counters()
    assert 700 <= counters["cells"] <= 1000
    assert counters["pairs"] == counters["occupied cells"]
    assert 60 <= counters["pairs"] <= 250


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
    for key, value in session.frame.answers.to_host().items():
        np.testing.assert_array_equal(value, before[key], key)


def test_large_triangles_take_the_queue_and_change_nothing():
    vertices, faces = soup(5, 300, size=0.02)
    wide, sheet = lattice(1, 3.0)
    prepared = make_scene(
        np.concatenate([vertices, wide + [0.0, 0.0, -1.0]]),
        np.concatenate([faces, sheet + len(vertices)]),
        [(0.0, 0.0, 4.0)],
    )
    session, _, _ = trace(NAME, {"density": "60"}, prepared, 16, 16)
    assert session.method.counters()["large triangles"] >= 2
    assert_exact(NAME, {"density": "60"}, prepared, 16, 16)


@pytest.mark.parametrize(
    "extent", [(1, 1, 1), (1, 1, 0), (1, 0, 0), (1000, 1, 1), (1, 1000, 1e-3), (1e-6, 1e-6, 1)]
)
def test_cells_never_exceed_what_was_made_room_for(extent):
    vertices, faces = soup(9, 200, size=0.1)
    flat = vertices * np.asarray(extent) + np.eye(3)[np.arange(len(vertices)) % 3] * 1e-4
    session, _, _ = trace(NAME, {"density": "5"}, make_scene(flat, faces, [(0.0, 0.0, 5.0)]), 4, 4)
    counters = session.method.counters()
    assert 100 <= counters["cells"] <= 1000


@pytest.mark.parametrize(
    ("key", "value"), [("density", "0"), ("density", "nan"), ("capacity", "-1"), ("cells", "3")]
)
def test_wrong_parameters_are_one_line(key, value):
    with pytest.raises(UserError, match=key) as caught:
        make_method(NAME, {key: value})
    assert "\n" not in str(caught.value)
