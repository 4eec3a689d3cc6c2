"""Planes through a light: where float32 loses their constant, too small a number, or too large a one.

Pairs of triangles with a common edge: shadow rays leave out what cannot hide their hit point, and nothing else.
"""

import numpy as np
import pytest
from helpers.answers import assert_same, trace
from helpers.method_trials import assert_exact
from helpers.small_scenes import make_scene, soup
from helpers.tuned_trees import tuned
from shadowbench.harness.scene.scene import Light
from shadowbench.methods.trees.records.planes import joined_pairs

FLOOR = np.array([[-1.0, 0.7, -1.0], [-1.0, 0.7, 1.0], [1.0, 0.7, 0.0], [0.0, -1.0, 0.0]])


def over_floor(scale: float, corners: np.ndarray, light: np.ndarray, eye: np.ndarray, target: np.ndarray, fov: float):
    """A floor, and a triangle over it that hides the light from a part of it. All in units of ``scale``."""
    vertices = np.vstack([FLOOR, corners])
    places = [tuple((np.asarray(at) * scale).tolist()) for at in (light, eye, target)]
    return make_scene(vertices * scale, [[0, 1, 2], [4, 5, 6]], [places[0]], places[1], places[2], fov, (0.0, 0.0, 1.0))


@pytest.mark.parametrize("gap", [2.0**-18, 2.0**-16, 2.0**-14])
@pytest.mark.parametrize("width", [0.8, 1.0])
def test_a_small_triangle_of_a_small_scene_hides_the_floor_under_it(width, gap, device):
    """Its normal times a coordinate is below float32's normal numbers."""
    edge, scale = width * 2.0**-7, 2.0**-41
    corners = np.array([[0, 0.7 + gap, 0], [0, 0.7 + gap, edge], [edge, 0.7 + gap, 0]])
    middle = np.array([edge / 4, 0.7, edge / 4])
    light = middle + [0.0, 1.0 / scale, 0.0]
    eye = middle + [edge / 8, -edge, edge / 8]  # from below, since from above the triangle covers what it hides
    got = assert_exact("bvh2", {}, over_floor(scale, corners, light, eye, middle, 80.0), 24, 24, device)
    assert got["shadowed"][0].any()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_triangle_close_to_a_light_of_a_large_scene_hides_the_floor(side, device):
    """Its planes' constants are beyond float32's largest number."""
    edge, scale = 2.0**-20, 2.0**58
    place = np.array([0.4 * side, 1.0, 0.3 * side])
    corners = place + np.array([[0, 0, 0], [0, 0, edge], [edge, 0, 0]])
    light = place + [edge / 4, edge, edge / 4]
    prepared = over_floor(scale, corners, light, (0.0, 2.5, 0.1), (0.0, 0.7, 0.0), 60.0)
    got = assert_exact("bvh2", {}, prepared, 24, 24, device)
    under = got["triangle"] == 0
    assert 0 < got["shadowed"][0][under].sum() < under.sum()


@pytest.mark.parametrize("scale", [1.0e-3, 1.0, 300.0])
@pytest.mark.parametrize("distance", [None, 2.0**33, 2.0**36, 2.0**50], ids=str)
def test_float32_decides_nearly_all_rays_to_a_light_however_far_away(distance, scale, device):
    """None: a directional light. Of the way to it float32 does not hold the square."""
    way = np.array([0.4, 0.8, 0.3])
    sun = Light(tuple(way), directional=True) if distance is None else Light(tuple(way * distance * scale))
    vertices, faces = soup(21, 150)
    floor = np.array([[-9.0, -1.2, -9.0], [-9.0, -1.2, 9.0], [18.0, -1.2, 0.0]])
    vertices = np.vstack([vertices, floor]) * scale
    faces = np.vstack([faces, np.arange(3) + len(vertices) - 3])
    prepared = make_scene(vertices, faces, [sun], tuple(np.array([0.3, 1.0, 3.0]) * scale))
    session, _, got = trace("bvh2", {}, prepared, 40, 30, device)
    hits = int((got["triangle"] >= 0).sum())
    assert 0 < got["shadowed"][0].sum() < hits
    assert_same(trace("uniform_grid", {}, prepared, 40, 30, device)[2], got)
    assert session.method.counters()["shadow undecided pairs"] < hits / 20


OPPOSITE = [[0, 1, 2], [1, 0, 3]]
"""Two triangles that pass their common edge in opposite directions."""

SAME = [[0, 1, 2], [0, 1, 3]]
EDGE = [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
LIGHTS = [(0.9, 0.1, 4.0), (4.0, 0.3, 0.6), (-4.0, -0.2, 0.9), (0.3, 0.2, -4.0)]


def folded(angle: float, faces: list[list[int]]):
    """Two triangles whose planes meet at this angle in degrees."""
    wing = [np.cos(np.radians(angle)), 0.1, np.sin(np.radians(angle))]
    return make_scene([*EDGE, [1.0, 0.0, 0.0], wing], faces, LIGHTS, (1.5, 0.4, 2.0), (0.2, 0.0, 0.2))


@pytest.mark.parametrize("area", [0.0, 1000.0])
@pytest.mark.parametrize("faces", [OPPOSITE, SAME], ids=["opposite", "same"])
@pytest.mark.parametrize("angle", [5, 20, 85, 100, 175, 180, 185, 230, 340, 355])
def test_folds_are_shadowed_right(angle, faces, area, device):
    """At 20 degrees the light sees the back of the upper triangle: leaving out every neighbour would find no shadow."""
    with tuned({"SHARED_AREA": area}) as settings:
        answers = assert_exact("bvh2", settings, folded(angle, faces), 40, 30, device)
    assert angle != 20 or answers["shadowed"][0][answers["triangle"] == 0].any()


def test_the_light_sees_one_side_of_a_flat_pair_and_two_of_a_fold():
    flat, sharp = (
        trace("bvh2", {}, folded(angle, OPPOSITE), 8, 8)[0].method._rays.planes[0].facing.numpy() for angle in (170, 20)
    )
    assert flat[0] == flat[1] != 0
    assert sorted(sharp) == [1, 2]


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
    last = [*OPPOSITE, [4, 5, 6], [4, 5, 7], [5, 6, 7]]
    assert joined_pairs(make_scene(points, last, [])).tolist() == [1, 0, 0]
    # Equal positions are one vertex where nothing moves.
    assert joined_pairs(make_scene(points[[0, 1, 2, 1, 0, 3]], [[0, 1, 2], [3, 4, 5]], [])).tolist() == [1]
