"""The ladder's top is exact, and each step down (``accuracy_ladder/kernels.py``, ``accuracy_ladder/tests.py``,
``origins.py``) fails as it is known to.
"""

import numpy as np
import pytest
from helpers.method_trials import expected, lattice
from helpers.small_scenes import make_scene, soup, trace
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.hardcases.shapes import joined, moved

NAME = "accuracy_ladder"


@pytest.mark.slow
@pytest.mark.parametrize("test", ["moller_trumbore", "moller_trumbore_epsilon", "woop", "woop_float64", "edge_planes"])
def test_float32_tests_are_right_on_an_ordinary_scene_and_say_that_they_need_not_be(test):
    vertices, faces = soup(21, 150, size=0.2)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0)], (0.0, 0.5, 3.0))
    got, exact = trace(NAME, {"test": test}, prepared, 41, 29)[2], expected(prepared, 41, 29)
    assert (got["triangle"] != exact["triangle"]).sum() <= 2
    assert (got["shadowed"] != exact["shadowed"]).sum() <= 5
    assert "float32" in make_method(NAME, {"test": test}).known_inexact


def test_a_fixed_determinant_loses_a_small_scene_and_the_others_do_not():
    vertices, faces = soup(21, 150, size=0.2)
    small = make_scene(vertices * 1e-6, faces, [(2e-6, 3e-6, 4e-6)], (0.0, 0.5e-6, 3e-6))
    found = {
        test: int((trace(NAME, {"test": test}, small, 24, 24)[2]["triangle"] >= 0).sum())
        for test in ("moller_trumbore_epsilon", "moller_trumbore", "exact")
    }
    assert found["moller_trumbore_epsilon"] == 0
    assert found["moller_trumbore"] > 0.9 * found["exact"] > 50


@pytest.mark.parametrize(
    ("origin", "acne", "leak"),
    [("hit_point", False, False), ("ray", True, False), ("barycentric", True, False), ("epsilon_1e-2", False, True)],
)
def test_origins_fail_as_they_are_known_to(origin, acne, leak):
    # A tilted floor and a thin roof just above a part of it, nearer than 1e-2 radii.
    floor = lattice(4, 2.0)
    points, faces = joined(floor, moved(lattice(2, 0.7), (0, 0, 0.01)))
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
    prepared = make_scene(points @ turn.T, faces, [(0.3, -3.0, 4.0)], (1.9, 1.5, 1.5))
    settings = {"origin": origin}
    got, exact = trace(NAME, settings, prepared, 48, 48)[2], expected(prepared, 48, 48)
    bits, wanted = (answers["shadowed"][0].astype(bool) for answers in (got, exact))
    assert bool((bits & ~wanted).any()) == acne
    below = exact["triangle"] < len(floor[1])
    assert bool((~bits & wanted & below).any()) == leak
    assert (make_method(NAME, settings).known_inexact is None) == (origin == "hit_point")


@pytest.mark.slow
@pytest.mark.parametrize("key", ["padding", "fast_math"])
def test_ways_of_building_change_little_and_are_declared(key):
    value = {"padding": "none", "fast_math": "true"}[key]
    vertices, faces = soup(21, 150, size=0.2)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0)], (0.0, 0.5, 3.0))
    got = trace(NAME, {key: value}, prepared, 41, 29)[2]
    expected = trace(NAME, {}, prepared, 41, 29)[2]
    assert (got["triangle"] != expected["triangle"]).mean() < 0.01
    assert make_method(NAME, {key: value}).known_inexact
