"""The traversal (``trace/shadow.py``): what float32 must leave, more of it than there is room for, boxes near infinity
(``scene_box.py``, ``trees/nodes.py``); planes through a light (``records/planes.py``): where their constant is lost.
"""

import dataclasses

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.method_trials import assert_exact
from helpers.small_scenes import assert_same, make_scene, soup, trace
from helpers.tuned_trees import tuned
from shadowbench.harness.frame.frame import Frame
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.eyes import touching
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Camera, Light
from shadowbench.methods.trees.builders.scene_box import BLOCK, BLOCKS, SceneBox
from shadowbench.methods.trees.constants import MOST_KEPT
from shadowbench.methods.trees.nodes import padding
from shadowbench.methods.trees.records.planes import joined_pairs

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


def check_box(points: np.ndarray, device: str) -> None:
    """Of triangles with these corners, found twice: it holds those that are finite, and no more."""
    prepared = make_scene(points, np.arange(len(points)).reshape(-1, 3), [(5.0, 4.0, 3.0)])
    frame, moment = Frame(prepared, 8, 8, 1, device), prepared.moment(0, 8, 8)
    frame.load(moment)
    extent, cleared = wp.zeros(1, dtype=wp.float32, device=device), wp.ones(1000, dtype=wp.int32, device=device)
    box = SceneBox(frame, extent, cleared)
    finite = moment.points[np.isfinite(moment.points).all(axis=1)]
    for _ in range(2):
        box.launch()
        found = box.box.numpy()
        np.testing.assert_array_equal(found[:3], finite.min(axis=0, initial=np.inf))
        np.testing.assert_array_equal(-found[3:], finite.max(axis=0, initial=-np.inf))
        assert extent.numpy()[0] == (np.abs(finite).max() if len(finite) else np.inf)
    assert not cleared.numpy().any()


@pytest.mark.parametrize("vertices", [3, BLOCK - 1, BLOCK + 2, 2 * BLOCK + 1, BLOCK * BLOCKS + 3])
def test_the_box_holds_what_triangles_use(vertices, device):
    check_box(soup(vertices, vertices // 3)[0], device)


def test_what_is_not_finite_is_left_out(device):
    points = soup(3, 400)[0]
    points[7] = np.nan
    points[8, 1] = np.inf
    check_box(points, device)
    check_box(np.full((9, 3), np.nan), device)


@wp.kernel
def padding_kernel(max_coordinate: wp.array(dtype=wp.float32), result: wp.array(dtype=wp.float32)):
    result[0] = padding(max_coordinate[0])


@pytest.mark.parametrize("size", [1e-38, 1e-30, 1e-3, 1.0, 1.1, 1e10, 1e30, 1e37, 3e38])
@pytest.mark.parametrize("eye", [(0.0, 0.5, 3.0), (0.0, 0.5, 3e6)])
def test_boxes_are_padded_by_more_than_their_bound(size, eye, device):
    """Of scenes of any size, seen from near and far: 5 units of what bounds the rays' origins and 8 of the scene's box."""
    points, faces = soup(4, 20)
    points *= size / np.abs(points).max()
    prepared = make_scene(points, faces, [(5.0, 4.0, 3.0)], tuple(min(size * x, 3e38) for x in eye))
    moment = prepared.moment(0, 8, 8)
    bound, extent = float(moment.max_coordinate[0]), float(np.abs(moment.points).max())
    ((found,),) = launched(padding_kernel, 1, [np.float32([bound])], [1], device)
    assert found > 2.0**-24 * (5.0 * bound + 8.0 * extent)
