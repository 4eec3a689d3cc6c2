"""The two-level grid: exact against float64 brute force, whatever its densities; leaf lists that miss nothing; growth."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from helpers.method_trials import assert_exact, hard_trials, random_trial, trace
from shadowbench.harness.errors import CapacityRejected, UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.effects import Limits

NAME = "two_level_grid"
TRIALS = {name: (prepared, width, height) for name, prepared, width, height in hard_trials()}
DENSITIES = (("0.12", "2.4"), ("0.001", "100"), ("20", "0.01"), ("4", "30"))


@pytest.mark.parametrize("seed", range(8))
def test_random_scenes_equal_brute_force(seed, device):
    random = np.random.default_rng(seed + 3000)
    settings = {
        "top_density": str(np.exp(random.uniform(-5, 3))),
        "leaf_density": str(np.exp(random.uniform(-3, 4))),
        "top_capacity": str(random.integers(1, 500)),
        "leaf_capacity": str(random.integers(1, 2000)),
    }
    assert_exact(NAME, settings, *random_trial(seed), device)


@pytest.mark.parametrize("trial", TRIALS)
def test_hard_scenes_equal_brute_force(trial, device):
    for top, leaf in DENSITIES[:2]:
        assert_exact(NAME, {"top_density": top, "leaf_density": leaf}, *TRIALS[trial], device)


def test_densities_and_capacities_agree_bit_for_bit(device):
    prepared = make_scene(*soup(7, 400), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    reference = trace("uniform_grid", {}, prepared, 33, 21, device)[2]
    for settings in (
        *({"top_density": top, "leaf_density": leaf} for top, leaf in DENSITIES),
        {"top_capacity": "1", "leaf_capacity": "1"},
    ):
        got = trace(NAME, settings, prepared, 33, 21, device)[2]
        for key, value in reference.items():
            np.testing.assert_array_equal(got[key], value, f"{key} {settings}")


def test_both_levels_grow_and_give_the_same_structure():
    prepared = make_scene(*soup(7, 400), [(5.0, 4.0, 3.0)])
    session = trace(NAME, {"top_capacity": "1", "leaf_capacity": "1"}, prepared, 20, 20)[0]
    assert session.regrown == 2
    ample = trace(NAME, {"top_capacity": "90000", "leaf_capacity": "900000"}, prepared, 20, 20)[0]
    assert ample.regrown == 0
    assert session.method.counters() == ample.method.counters()


@pytest.mark.parametrize(
    ("settings", "what"),
    [({"leaf_capacity": "1"}, "leaf cell"), ({"top_density": "900"}, "cells"), ({"leaf_density": "100"}, "cells")],
)  # fmt: skip
def test_a_need_beyond_the_limits_is_rejected(settings, what):
    prepared = make_scene(*soup(7, 400), [(5.0, 4.0, 3.0)])
    limits = Limits(memory=40000)
    with pytest.raises(CapacityRejected, match=what):
        Session(make_method(NAME, settings), prepared, 8, 8, "cpu", limits=limits).answers(
            prepared.moment(0, 8, 8)
        )


@pytest.mark.parametrize("trial", ["random", "teapot in a stadium", "triangles through every cell"])
def test_every_leaf_cell_that_a_triangle_meets_lists_it(trial):
    """Points all over each triangle, and on its edges: the leaf cell of each must hold the triangle."""
    prepared, width, height = random_trial(5) if trial == "random" else TRIALS[trial]
    session, moment, _ = trace(NAME, {}, prepared, width, height)
    method = session.method
    grid = method._top.grid.numpy()[0]
    res, first = method._res.numpy(), method._first.numpy()
    begin, end, members = (getattr(method._leaf.list, name).numpy() for name in ("begin", "end", "values"))
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
        assert all(i in members[begin[c] : end[c]] for c in np.unique(k))


def test_a_teapot_in_a_stadium_is_divided_where_the_teapot_is():
    """2,000 triangles within a fiftieth of the scene's width: some cells of a uniform grid hold many of them."""
    ground = np.array([[-5.0, -5, -0.2], [5, -5, -0.2], [5, 5, -0.2], [-5, 5, -0.2]])
    dense, cluster = soup(3, 2000, size=0.02, spread=0.2)
    faces = np.concatenate([[[0, 1, 2], [0, 2, 3]], cluster + 4])
    scene = make_scene(np.concatenate([ground, dense]), faces, [(3.0, 2.0, 5.0)], (0.0, -1.6, 0.3), fov=40.0)
    plain = trace("uniform_grid", {}, scene, 24, 24)[0].method.counters()
    nested = trace(NAME, {}, scene, 24, 24)[0].method.counters()
    assert nested["longest list"] < plain["longest list"] / 5
    assert nested["primary tests"] < plain["primary tests"] / 3


@pytest.mark.parametrize(
    ("key", "value"),
    [("top_density", "0"), ("leaf_density", "101"), ("top_capacity", "-1"), ("leaf_capacity", "-1")],
)
def test_wrong_parameters_are_one_line(key, value):
    with pytest.raises(UserError, match=key) as caught:
        make_method(NAME, {key: value})
    assert "\n" not in str(caught.value)
