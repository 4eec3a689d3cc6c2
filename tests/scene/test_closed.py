"""Closed parts of a mesh, their winding and what opens them; the corner order of duplicates; which frames are wide."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.hardcases.shapes import ball, box, joined, moved, plane, sheet, split, triangles
from shadowbench.harness.scene.closed import CLOSED, OPEN, TURNED, ClosedParts, closed_parts, enough
from shadowbench.harness.scene.corner_order import follow, in_order_of_duplicates
from shadowbench.harness.scene.prepared import Prepared, prepare, under
from shadowbench.harness.scene.scene import AlphaMask, Camera, Geometry, Light, Scene
from shadowbench.harness.scene.width import MANY, Sizes, is_wide

EYE, LIGHT = (0.0, 0.0, 9.0), (7.0, 1.0, 2.0)
FOUR = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
"""A tetrahedron."""
TWO_BOXES = joined(box(-1, 1), moved(box(-1, 1), (4, 0, 0)))


def scene_of(mesh, *frames, alpha=None):
    """A prepared scene of a mesh whose vertices lie elsewhere in further frames."""
    points, faces = mesh
    places = [points, *frames]
    geometry = Geometry(np.asarray(faces, dtype=np.int32), lambda k: places[k], len(places))
    return prepare(Scene("s", "S", lambda: geometry, Camera(EYE, (0, 0, 0)), (Light(LIGHT),), alpha=alpha))


def marked(prepared, frame=0, eye=EYE, light=LIGHT, shadows=(True,), opened=None):
    parts = ClosedParts(prepared)
    moment = prepared.moment(frame, 8, 8, Camera(eye, (0.5, 0.25, 0.0), (0, 1, 0.1)), (Light(light),))
    return parts.flags(moment, shadows, np.zeros(parts.count, dtype=bool) if opened is None else opened)


def kept(count, *faces):
    """A mesh of ``count`` vertices with its parts."""
    labels, number = closed_parts(np.array(faces, dtype=np.int32), np.zeros(len(faces), dtype=bool))
    return (labels != OPEN).tolist(), number


def test_a_part_is_closed_if_every_edge_is_passed_as_often_both_ways():
    assert kept(4, *FOUR) == ([True] * 4, 1)
    assert kept(4, *FOUR[:3]) == ([False] * 3, 0), "an edge is open"
    assert kept(4, *FOUR[:3], FOUR[3][::-1]) == ([False] * 4, 0), "one is wound the other way"
    assert kept(5, *FOUR, (0, 1, 4)) == ([False] * 5, 0), "a fin at an edge"
    other = tuple(tuple((0, 1, 4, 5)[v] for v in face) for face in FOUR)
    assert kept(6, *FOUR, *other) == ([True] * 8, 1), "two that share an edge"
    apart = tuple(tuple(v + 3 for v in face) for face in FOUR)
    assert kept(7, *FOUR, *apart) == ([True] * 8, 2), "two that share a corner are two parts"
    assert kept(4, *FOUR, *FOUR) == ([True] * 8, 1)


def test_triangles_wound_both_ways_cancel():
    assert kept(3, (0, 1, 2), (2, 1, 0)) == ([False] * 2, 0)
    assert kept(5, *FOUR, (0, 1, 4), (1, 0, 4)) == ([True] * 4 + [False] * 2, 1), "a fin of two sides opens nothing"
    assert kept(4, (0, 1, 2), (0, 2, 3), (1, 0, 3), (1, 3, 2)) == ([True] * 4, 1), "other diagonals: they do not cancel"


def test_triangles_with_a_corner_twice_count_with_their_edges():
    assert kept(4, *FOUR, (0, 0, 1), (1, 1, 1)) == ([True] * 5 + [False], 1)


def test_split_vertices_are_joined_where_they_lie_together_in_the_frame():
    whole = split(box(-1.0, 1.0))
    apart = whole[0].copy()
    apart[:3] += 0.5
    prepared = scene_of(joined(plane(2, -2, 4), whole), np.concatenate([plane(2, -2, 4)[0], apart]))
    assert (marked(prepared)[:2] == 1).all()
    assert (marked(prepared)[2:] == 1 | CLOSED).all()
    assert (marked(prepared, frame=1) == 1).all(), "closed by the first frame's weld only"


def test_bits_say_which_triangles_are_listed_against_the_outward_winding():
    points, faces = ball(1.0, (0, 0, 0))
    assert (marked(scene_of((points, faces))) == 1 | CLOSED).all()
    assert (marked(scene_of((points, faces[:, ::-1]))) == 1 | CLOSED | TURNED).all(), "wound inward"
    prepared = scene_of((points, faces))
    listed = prepared.faces.copy()
    listed[3] = listed[3][::-1]
    flags = marked(replace(prepared, faces=listed))
    assert np.nonzero(flags & TURNED)[0].tolist() == [3]


def test_duplicates_that_are_prepared_in_one_order_keep_their_winding():
    """A duplicate that belongs to another part is wound as that part is, not as it is listed."""
    side = triangles((0, 0, 0), (1, 0, 0), (0, 1, 0))
    tip = np.array([(0.2, 0.2, 1.0)])
    points = np.concatenate([side[0], tip])
    solid = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
    prepared = scene_of(joined(side, (points, solid)))
    assert (prepared.faces[1] - 3 != solid[0]).any()
    flags = marked(prepared)
    assert flags.tolist() == [1, 1 | CLOSED | TURNED, *[1 | CLOSED] * 3]


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.9, -0.9, 0.9), (1.0, 0.0, 0.0)])
def test_eye_and_lights_must_lie_outside_the_box(place):
    prepared = scene_of(TWO_BOXES)
    half = len(prepared.faces) // 2
    for given in ({"eye": place}, {"light": place}):
        flags = marked(prepared, **given)
        assert (flags[:half] == 1).all()
        assert (flags[half:] == 1 | CLOSED).all()
    assert (marked(prepared, light=place, shadows=(False,)) == 1 | CLOSED).all(), "a light without shadows"


def test_holes_and_infinite_vertices_open_a_part():
    points, faces = TWO_BOXES
    mask = np.zeros(24, dtype=np.uint8)
    mask[5] = 1
    holes = AlphaMask(mask, np.zeros((24, 3, 2), dtype=np.float32), np.ones((1, 1), dtype=np.uint8))
    flags = marked(scene_of((points, faces), alpha=lambda geometry: holes))
    assert flags.tolist() == [1] * 12 + [1 | CLOSED] * 12
    broken = points.copy()
    broken[15] = np.inf
    flags = marked(scene_of((points, faces), broken), frame=1)
    assert (flags[:12] == 1 | CLOSED).all()
    assert not (flags[12:] & CLOSED).any()


def test_a_triangle_without_area_closes_a_part_and_is_not_marked():
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.5, 0, 0)])
    faces = np.array([(0, 2, 1), (0, 4, 3), (4, 1, 3), (0, 1, 4), (1, 2, 3), (2, 0, 3)])
    assert marked(scene_of((points, faces))).tolist() == [3, 3, 3, 0, 3, 3]


def test_opened_parts_are_not_marked_and_few_triangles_are_not_enough():
    prepared = scene_of(TWO_BOXES)
    flags = marked(prepared, opened=np.array([True, False]))
    assert flags.tolist() == [1] * 12 + [1 | CLOSED] * 12
    assert enough(flags)
    assert not enough(np.array([1 | CLOSED] + [1] * 40, dtype=np.uint8))
    assert not enough(np.zeros(0, dtype=np.uint8))


ORDERS = list(itertools.permutations(range(3)))
WELD = np.array([0, 1, 2, 3, 0, 1, 2], dtype=np.int32)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("closed", [False, True])
def test_a_duplicate_takes_the_order_of_the_first(order, closed) -> None:
    faces = np.array([[2, 0, 1], [0, 1, 3], [0, 0, 0]], dtype=np.int32)
    faces[2] = np.array([6, 4, 5])[list(order)]
    found = in_order_of_duplicates(faces, WELD, closed)
    rotated = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    np.testing.assert_array_equal(found[:2], faces[:2])
    expected = [6, 4, 5] if rotated or not closed else faces[2]
    np.testing.assert_array_equal(found[2], expected)


def test_a_mesh_without_duplicates_stays_and_so_does_an_empty_one() -> None:
    faces = np.array([[2, 0, 1], [0, 1, 3]], dtype=np.int32)
    np.testing.assert_array_equal(in_order_of_duplicates(faces, WELD, False), faces)
    none = np.zeros((0, 3), dtype=np.int32)
    assert in_order_of_duplicates(none, none[:, 0], False).shape == (0, 3)


def test_values_follow_their_corners() -> None:
    before = np.array([[0, 1, 2], [3, 4, 5]], dtype=np.int32)
    after = np.array([[0, 1, 2], [5, 3, 4]], dtype=np.int32)
    values = np.arange(12.0).reshape(2, 3, 2)
    np.testing.assert_array_equal(follow(values, before, after), [values[0], values[1][[2, 0, 1]]])


def test_texture_coordinates_follow_on_another_scene_too() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [5, 3, 4]])
    coordinates = points[faces][..., :2].astype(np.float32)
    mask = AlphaMask(np.ones(2, dtype=np.uint8), coordinates, np.eye(2, dtype=np.uint8))
    scene = Scene("x", "X", lambda: Geometry.static(points, faces), Camera((0, 0, 2), (0, 0, 0)), ())
    masked = Scene("x", "X", scene.geometry, scene.camera, (), alpha=lambda geometry: mask)
    for prepared in (prepare(masked), under(prepare(scene), masked)):
        assert prepared.faces.tolist() == [[0, 1, 2], [3, 4, 5]]
        assert prepared.alpha is not None
        np.testing.assert_array_equal(prepared.alpha.coordinates, points[prepared.faces][..., :2])


LAMP = (1.0, 2.5, 0.5)
ROOF = np.array([(8, 1, 0), (-8, 7, 0), (-7, -9, 0)], dtype=np.float64)


def wide(prepared: Prepared) -> bool:
    moment = prepared.moment(0, 8, 8)
    return is_wide(moment, Sizes(moment.points, prepared.faces, moment.valid))


def with_triangle(corners: np.ndarray, **given) -> Prepared:
    """A triangle beside an ordinary mesh."""
    points, faces = soup(3, 40)
    mesh = np.concatenate([points, corners]), np.concatenate([faces, [[120, 121, 122]]])
    return make_scene(*mesh, given.pop("lights", [LAMP]), **given)


def test_ordinary_frames_are_not_and_neither_is_an_empty_one() -> None:
    assert not wide(make_scene(*soup(3, 400), [LAMP]))
    assert not wide(with_triangle(ROOF + (0.1, 0.2, 0.3)))
    assert not wide(make_scene(np.zeros((0, 3)), np.zeros((0, 3)), [LAMP]))
    assert not wide(make_scene(*soup(3, 400), [LAMP], (0.0, 0.0, 0.0), (0.0, 0.0, -1.0))), "for an eye at the origin"


@pytest.mark.parametrize(("size", "expected"), [(2.0**8, False), (2.0**14, True), (2.0**40, True)])
def test_a_triangle_far_larger_than_the_eyes_distance_is_wide(size, expected) -> None:
    assert wide(with_triangle(ROOF * size + (0, 0, 0.37))) is expected


def test_a_sliver_is_wide_only_if_it_is_very_thin() -> None:
    thin = np.array([(1, 0, 0.3), (-1, 0.2, 0.1), (-1, 0.2, 0.1)])
    for width, expected in ((2.0**-12, False), (2.0**-26, True)):
        corners = thin.copy()
        corners[2, 1] += width
        assert wide(with_triangle(corners)) is expected


@pytest.mark.parametrize(("power", "expected"), [(0, False), (-8, False), (-20, True), (-40, True)])
def test_an_axis_of_its_own_scale_is_wide(power, expected) -> None:
    x = np.linspace(-3, 3, 5)
    points, faces = sheet(x, x, np.arange(5))
    points[:, :2] = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)  # no triangle is steep
    assert wide(make_scene(points * (1, 1, 2.0**power), faces, [(1.0, 2.5, 2.0**power)])) is expected


@pytest.mark.parametrize(("light", "expected"), [
    ((0, 0, 0), False),
    ((0, 0, 1e-17), True),
    ((0, 0, 1e-44), True),
    ((0, 0, 1e-9), False),
    ((0, 1, 1), False),
    ((1e-30, 1, 1), True),  # float64 takes it for a point of the plane
])  # fmt: skip
def test_a_light_beside_a_plane_by_less_than_float64_knows_is_wide(light, expected) -> None:
    tilted = np.array([(8, 1, 9), (-8, 7, -1), (-7, -9, -16)], dtype=np.float64)  # z = x + y
    assert wide(with_triangle(tilted, lights=[light])) is expected


def test_planes_of_two_axes_that_hold_the_eye_are_not_wide_however_many_they_are() -> None:
    x = np.linspace(-3, 3, 40)
    points, faces = sheet(x, x, 1.0)
    assert len(faces) > 2 * MANY
    assert not wide(make_scene(points, faces, [(0.1, 0.2, -3.0)], (0.3, 0.2, -1.0), (0.3, 0.2, -2.0)))


def test_a_sun_lies_beside_all_planes_along_it_and_makes_no_frame_wide() -> None:
    wall = np.array([(2, -1, -1), (2, 5, -1), (2, 0, 4)], dtype=np.float64)
    assert not wide(with_triangle(wall, lights=[Light((0.0, 1.0, 0.0), directional=True)]))
