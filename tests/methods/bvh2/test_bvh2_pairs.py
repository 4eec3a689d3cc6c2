"""Pairs of triangles with a common edge: shadow rays leave out what cannot hide their hit point, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.brute_force import make_scene
from helpers.method_trials import assert_exact
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.methods.trees.records.planes import joined_pairs

OPPOSITE = [[0, 1, 2], [1, 0, 3]]
"""Two triangles that pass their common edge in opposite directions."""

SAME = [[0, 1, 2], [0, 1, 3]]
EDGE = [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
LIGHTS = [(0.9, 0.1, 4.0), (4.0, 0.3, 0.6), (-4.0, -0.2, 0.9), (0.3, 0.2, -4.0)]


def folded(angle: float, faces: list[list[int]]):
    """Two triangles whose planes meet at this angle in degrees."""
    wing = [np.cos(np.radians(angle)), 0.1, np.sin(np.radians(angle))]
    return make_scene([*EDGE, [1.0, 0.0, 0.0], wing], faces, LIGHTS, (1.5, 0.4, 2.0), (0.2, 0.0, 0.2))


@pytest.mark.parametrize("settings", [{"pair": "1000"}, {"pair": "0"}], ids=str)
@pytest.mark.parametrize("faces", [OPPOSITE, SAME], ids=["opposite", "same"])
@pytest.mark.parametrize("angle", [5, 20, 50, 85, 100, 140, 175, 180, 185, 230, 290, 340, 355])
def test_folds_are_shadowed_as_by_brute_force(angle, faces, settings, device):
    assert_exact("bvh2", settings, folded(angle, faces), 40, 30, device)


def test_a_fold_hides_what_lies_under_it():
    """The light sees the back of the upper triangle: leaving out every neighbour would find no shadow."""
    answers = assert_exact("bvh2", {"pair": "1000"}, folded(20, OPPOSITE), 40, 30)
    under = answers["triangle"] == 0
    assert answers["shadowed"][0][under].any()


def facing_of(angle: float) -> list[int]:
    prepared = folded(angle, OPPOSITE)
    method = make_method("bvh2", {})
    Session(method, prepared, 8, 8, "cpu").answers(prepared.moment(0, 8, 8))
    return method._rays.facing[0].numpy().tolist()


def test_the_light_sees_one_side_of_a_flat_pair_and_two_of_a_fold():
    flat, sharp = facing_of(170), facing_of(20)
    assert flat[0] == flat[1] != 0
    assert 0 not in sharp
    assert sharp[0] != sharp[1]


def test_pairs_are_joined_by_an_edge_in_opposite_directions():
    points = np.random.default_rng(3).normal(size=(8, 3))
    rows = [
        (OPPOSITE, 1),
        (SAME, 0),
        ([[0, 1, 2], [3, 1, 0]], 1),
        ([[2, 0, 1], [0, 3, 1]], 1),
        ([[0, 1, 2], [2, 3, 4]], 0),  # a corner
        ([[0, 1, 2], [3, 4, 5]], 0),
    ]
    for faces, expected in rows:
        assert joined_pairs(make_scene(points, faces, [])).tolist() == [expected]
    last = [*OPPOSITE, *SAME, [5, 6, 7]]
    assert joined_pairs(make_scene(points, last, [])).tolist() == [1, 0, 0]


def test_equal_positions_are_one_vertex_where_nothing_moves():
    points = np.random.default_rng(3).normal(size=(4, 3))
    assert joined_pairs(make_scene(points[[0, 1, 2, 1, 0, 3]], [[0, 1, 2], [3, 4, 5]], [])).tolist() == [1]
