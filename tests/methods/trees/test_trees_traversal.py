"""The traversal by rays of the eye and of shadows (``trace/shadow.py``): what float32 must leave, more of it than a
ray keeps or than there is room for, and boxes near infinity.
"""

import dataclasses

import numpy as np
import pytest
from helpers.answers import assert_same, trace
from helpers.method_trials import assert_exact
from helpers.small_scenes import make_scene
from helpers.tuned_trees import tuned
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.eyes import touching
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Camera
from shadowbench.methods.trees.constants import MOST_KEPT

NAME = "bvh2"


@pytest.mark.parametrize(
    "settings", [{"SHARED_AREA": 0.0}, {"SHARED_AREA": 1e3}, {"SHARED_AREA": 1e3, "primary": "packet"}], ids=str
)
def test_a_wall_one_step_from_the_eye_is_not_hidden_by_a_sure_hit(settings, device):
    """float32 knows no depth of it; in a leaf of four it is tested after the wall behind it."""
    trial = touching()
    with tuned(settings) as given:
        answers = Session(make_method(NAME, given), trial.prepared, 16, 16, device).answers(trial.moment)
    assert set(answers["triangle"]) == {0, 1}


@pytest.mark.parametrize("settings", [{}, {"SHARED_AREA": 0.0}, {"primary": "packet"}], ids=str)
def test_a_ray_that_leaves_more_than_it_keeps_enters_all(settings, device):
    """Ten walls of four triangles each, whose common corners lie on one line, from the eye to the light behind them."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 0]], dtype=float)
    fan = np.array([[k, (k + 1) % 4, 4] for k in range(4)])
    walls = [corners * [1, 1, 0] + [0, 0, -0.25 * k] for k in range(10)]
    faces = [fan + 5 * k for k in range(10)]
    prepared = make_scene(np.concatenate(walls), np.concatenate(faces), [(0.0, 0.0, -6.0)], (0.0, 0.0, 4.0))
    with tuned(settings) as given:
        assert_exact(NAME, given, prepared, 1, 1, device)
        method = make_method(NAME, given)
        Session(method, prepared, 1, 1, device).answers(prepared.moment(0, 1, 1))
    found = method.counters()
    assert found["primary undecided pairs"] == len(faces) * len(fan) > MOST_KEPT + 2
    assert found["shadow undecided pairs"] > MOST_KEPT + 2


@pytest.mark.parametrize("settings", [{}, {"update": "refit"}], ids=str)
@pytest.mark.parametrize("effect", ["plain", "mirrors", "parallel"])
def test_a_box_is_met_where_its_middle_over_the_direction_is_infinite(settings, effect, device):
    """A ray along x that meets, at y = 0.15, boxes whose middle is 0.5 off it and whose extent is 0.4: of 7e26 units, and
    2^-40 for a direction of 0, only the middle's quotient is beyond float32.
    """
    corners = np.array([[1.0, 0.1, 0.1], [1.0, 0.9, 0.1], [1.0, 0.1, 0.9]])
    walls = np.concatenate([corners * [x, 1, 1] for x in (1.0, 0.9, -1.0, -0.9)]) * 7e26
    at, to = (0.0, 1.05e26, 1.05e26), (7e26, 1.05e26, 1.05e26)
    camera = Camera(at, to, fov=1e-5, height=1e20 if effect == "parallel" else None)
    prepared = make_scene(walls, np.arange(12).reshape(4, 3), [at], at, to, 1e-5)
    scene = dataclasses.replace(prepared.scene, camera=camera)
    if effect == "mirrors":
        scene = dataclasses.replace(scene, mirror=lambda geometry: np.ones(4, dtype=np.uint8), bounces=2)
    prepared = prepare(scene)
    _, _, got = trace(NAME, settings, prepared, 3, 3, device)
    _, _, wanted = trace("warp_bvh", {"update": "bvh_rebuild"}, prepared, 3, 3, device)
    assert (wanted["triangle"] >= 0).all()
    assert_same(got, wanted)
