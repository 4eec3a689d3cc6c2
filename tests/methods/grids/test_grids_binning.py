"""Which cells a triangle is listed in (``grids/pairs.py``, ``grids/binning.py``); rays through the cells of one grid
(``grids/walk.py``, ``grids/cells.py``); and where a grid lies (``grids/build.py``, ``grids/grid.py``).
"""

import numpy as np
import pytest
from helpers.method_trials import TRIALS, assert_exact, lattice, listed, random_trial
from helpers.small_scenes import answers_in, assert_same, make_scene, soup, trace
from shadowbench.harness.hardcases.shapes import joined, moved

NAME = "uniform_grid"


@pytest.mark.parametrize("density", ["0.3", "4", "60"])
@pytest.mark.parametrize("trial", ["random", "teapot in a stadium", "triangles through every cell", "eye in a box"])
def test_every_cell_that_a_triangle_meets_lists_it(trial, density):
    """Points all over each triangle, and on its edges: the cell of each must hold the triangle."""
    prepared, width, height = random_trial(5) if trial == "random" else TRIALS[trial]
    session, moment, _ = trace(NAME, {"density": density}, prepared, width, height)
    method = session.method
    grid = method._grid.grid.numpy()[0]
    found = listed(method._grid.pairs, len(prepared.faces))
    random = np.random.default_rng(0)
    weights = np.concatenate(
        [random.dirichlet([0.4] * 3, 400), np.eye(3), random.dirichlet([1.0] * 2, 50) @ np.eye(3)[:2]]
    )
    for i in np.nonzero(moment.valid)[0]:
        p = weights @ moment.points[prepared.faces[i]].astype(np.float64)
        cell = np.floor((p - grid["origin"]) * grid["scale"]).astype(int)
        assert (cell >= 0).all()
        assert (cell < grid["res"]).all()
        flat = (cell[:, 2] * grid["res"][1] + cell[:, 1]) * grid["res"][0] + cell[:, 0]
        assert np.isin(flat * len(prepared.faces) + i, found).all()


def test_a_slanted_triangle_is_not_binned_by_its_box():
    """One triangle across the diagonal of a grid: its cells go with its area, far fewer than its box has."""
    vertices, faces = np.array([[-1.0, -1, -1], [1, 1, -1], [-1, 1, 1]]), [[0, 1, 2]]
    session, _, _ = trace(NAME, {"density": "1000"}, make_scene(vertices, faces, [(0.0, 0.0, 5.0)]), 8, 8)
    counters = session.method.counters()
    assert 700 <= counters["cells"] <= 1000
    assert counters["pairs"] == counters["occupied cells"]
    assert 60 <= counters["pairs"] <= 250


def test_large_triangles_take_the_queue_and_change_nothing():
    mesh = joined(soup(5, 300, size=0.02), moved(lattice(1, 3.0), (0, 0, -1)))
    prepared = make_scene(*mesh, [(0.0, 0.0, 4.0)])
    session, _, _ = trace(NAME, {"density": "60"}, prepared, 16, 16)
    assert session.method.counters()["large triangles"] >= 2
    assert_exact(NAME, {"density": "60"}, prepared, 16, 16)


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
    assert_same(answers_in(session), before)


def test_walks_through_many_cells_find_what_one_cell_holds():
    """From within the grid; the middle pixel's ray runs along an axis."""
    prepared = make_scene(*soup(5, 600, size=0.05), [(0.0, 0.0, 9.0), (0.1, 0.2, 0.3)], (0.0, 0.0, 0.05), fov=120.0)
    (one, _, expected), (many, _, got) = (
        trace(NAME, {"density": density}, prepared, 17, 17) for density in ("0.001", "100")
    )
    assert_same(got, expected)
    assert many.method.counters()["primary tests"] < one.method.counters()["primary tests"] / 4


@pytest.mark.parametrize("extent", [(1, 1, 1), (1, 1, 0), (1, 0, 0), (1000, 1, 1), (1, 1000, 1e-3), (1e-6, 1e-6, 1)])
def test_cells_never_exceed_what_was_made_room_for(extent):
    vertices, faces = soup(9, 200, size=0.1)
    flat = vertices * np.asarray(extent) + np.eye(3)[np.arange(len(vertices)) % 3] * 1e-4
    session, _, _ = trace(NAME, {"density": "5"}, make_scene(flat, faces, [(0.0, 0.0, 5.0)]), 4, 4)
    counters = session.method.counters()
    assert 100 <= counters["cells"] <= 1000
