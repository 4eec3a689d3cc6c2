"""Leaf grids: their lists miss nothing, space is divided where the triangles are, and the walk through both levels
(``two_level_grid/traversal.py``) tests fewer of them.
"""

import numpy as np
import pytest
from helpers.method_trials import TRIALS, listed, random_trial
from helpers.small_scenes import assert_same, make_scene, soup, trace
from shadowbench.harness.hardcases.shapes import joined, quad

NAME = "two_level_grid"


@pytest.mark.parametrize("trial", ["random", "teapot in a stadium", "triangles through every cell"])
def test_every_leaf_cell_that_a_triangle_meets_lists_it(trial):
    """Points all over each triangle, and on its edges: the leaf cell of each must hold the triangle."""
    prepared, width, height = random_trial(5) if trial == "random" else TRIALS[trial]
    session, moment, _ = trace(NAME, {}, prepared, width, height)
    method = session.method
    grid = method._top.grid.numpy()[0]
    res, first = method._levels.res.numpy(), method._levels.first.numpy()
    found = listed(method._leaf.pairs, len(prepared.faces))
    random = np.random.default_rng(0)
    weights = np.concatenate([random.dirichlet([0.4] * 3, 200), np.eye(3)])
    for i in np.nonzero(moment.valid)[0]:
        p = weights @ moment.points[prepared.faces[i]].astype(np.float64)
        at = (p - grid["origin"]) * grid["scale"]
        cell = np.floor(at).astype(int)
        flat = (cell[:, 2] * grid["res"][1] + cell[:, 1]) * grid["res"][0] + cell[:, 0]
        assert (first[flat] >= 0).all()
        leaf_res = np.stack([(res[flat] >> shift) & 1023 for shift in (0, 10, 20)], -1) + 1
        leaf = np.minimum(np.floor((at - cell) * leaf_res).astype(int), leaf_res - 1)
        k = first[flat] + (leaf[:, 2] * leaf_res[:, 1] + leaf[:, 1]) * leaf_res[:, 0] + leaf[:, 0]
        assert np.isin(k.astype(np.int64) * len(prepared.faces) + i, found).all()


def test_a_teapot_in_a_stadium_is_divided_where_the_teapot_is():
    """2,000 triangles within a fiftieth of the scene's width: some cells of a uniform grid hold many of them."""
    ground = quad((-5, -5, -0.2), (5, -5, -0.2), (5, 5, -0.2), (-5, 5, -0.2))
    mesh = joined(ground, soup(3, 2000, size=0.02, spread=0.2))
    scene = make_scene(*mesh, [(3.0, 2.0, 5.0)], (0.0, -1.6, 0.3), fov=40.0)
    (one, _, expected), (two, _, got) = (trace(name, {}, scene, 24, 24) for name in ("uniform_grid", NAME))
    assert_same(got, expected)
    plain, nested = one.method.counters(), two.method.counters()
    assert nested["longest list"] < plain["longest list"] / 5
    assert nested["primary tests"] < plain["primary tests"] / 3
