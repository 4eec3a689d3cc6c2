"""The conventions fixed once: recentring, weld, zero-area flags, ray tables."""

import numpy as np
import pytest
from helpers.second_judge import Flat
from hypothesis import given, settings
from hypothesis import strategies as st
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.light_paths import Orbit
from shadowbench.harness.scene.moment import ray_tables
from shadowbench.harness.scene.prepared import prepare, valid_triangles, weld
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene

CAMERA = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


def scene_of(vertices, faces, lights=((0.0, 4.0, 0.0),), **changes) -> Scene:
    made = Geometry.static(np.asarray(vertices), np.asarray(faces))
    values = {"camera": CAMERA, "lights": tuple(Light(p) for p in lights), **changes}
    return Scene("test", "Test", lambda: made, **values)


def test_rays_of_an_orthographic_camera_are_parallel_and_a_pixel_apart():
    camera = Camera((1.0, 2.0, 5.0), (1.0, 2.0, 0.0), height=4.0)
    moment = prepare(scene_of(TRIANGLE, [[0, 1, 2]], camera=camera)).moment(0, 6, 4)
    pixels = np.arange(24)
    np.testing.assert_array_equal(moment.directions(pixels), np.tile([0, 0, -1], (24, 1)))
    x, y = np.meshgrid(np.arange(6) - 2.5, 1.5 - np.arange(4))  # pixels of size 1, row 0 at the top
    starts = np.stack([1 + x.ravel(), 2 + y.ravel(), np.full(24, 5.0)], axis=1)
    np.testing.assert_array_equal(moment.origins(pixels), starts)
    assert moment.max_coordinate[0] >= 8


def test_a_mesh_near_the_origin_stays_as_it_is():
    points = TRIANGLE + [0.4, 0.0, -0.9]
    assert np.array_equal(prepare(scene_of(points, [[0, 1, 2]])).points(0)[0], points.astype(np.float32))


def test_a_far_mesh_keeps_its_detail_with_camera_and_lights():
    far = np.array([1.0e8, -2.0e8, 3.0e8])
    points = TRIANGLE * 0.001 + far
    camera = Camera(tuple(far + [0, 0, 2.0]), tuple(far))
    prepared = prepare(scene_of(points, [[0, 1, 2]], lights=[tuple(far + [0, 4.0, 0])], camera=camera))
    moment = prepared.moment(0, 8, 8)
    assert np.allclose(np.ptp(moment.points, axis=0), [0.001, 0.001, 0], rtol=1e-4)
    assert (moment.valid.tolist(), prepared.weld.tolist()) == ([1], [0, 1, 2])
    assert np.allclose(moment.eye, [0, 0, 2], atol=0.002)
    assert np.allclose(moment.lights, [[0, 4, 0]], atol=0.002)
    # Float32 alone would have put all three corners on one point.
    assert not np.ptp(points.astype(np.float32), axis=0).any()


def test_one_centre_serves_every_frame():
    frames = [TRIANGLE + 100.0, TRIANGLE + 300.0]
    geometry = Geometry(np.array([[0, 1, 2]], np.int32), lambda k: frames[k], 2)
    prepared = prepare(Scene("m", "M", lambda: geometry, CAMERA, ()))
    assert np.array_equal(prepared.points(1)[0] - prepared.points(0)[0], np.full((3, 3), 200, np.float32))


def test_huge_and_missing_coordinates_neither_move_the_centre_nor_warn():
    points = np.vstack([TRIANGLE, [[1e300, 0, 0], [np.nan, 1, 1], [np.inf, 0, 0], [-3e39, 0, 0]]])
    faces = [[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 1, 5], [0, 1, 6]]
    prepared = prepare(scene_of(points, faces))
    moment = prepared.moment(0, 4, 4)
    assert (prepared.centre == 0).all()
    assert moment.valid.tolist() == [1, 0, 0, 0, 0]
    assert prepared.radius == pytest.approx(np.sqrt(2) / 2)


@given(st.lists(st.tuples(*[st.sampled_from([-1.0, -0.0, 0.0, 1e-45, 1.0, np.inf])] * 3), min_size=1, max_size=40))
@settings(derandomize=True, max_examples=100, deadline=None)
def test_weld_is_brute_force(rows):
    points = np.array(rows)
    single = points.astype(np.float32)
    expected = [min(j for j in range(len(rows)) if (single[j] == single[i]).all()) for i in range(len(rows))]
    assert weld(points).tolist() == expected
    assert weld(np.array([[np.nan, 0, 0]] * 2)).tolist() == [0, 1]
    assert weld(np.zeros((0, 3))).tolist() == []


COORDINATES = {
    "lattice": st.integers(-3, 3).map(float),
    "slivers": st.builds(
        lambda base, steps: float(np.float32(base) + np.float32(steps) * np.spacing(np.float32(base))),
        st.sampled_from([1.0, 1000.0, 16777216.0]),
        st.integers(-2, 2),
    ),
    "tiny": st.integers(-3, 3).map(lambda n: float(np.float32(n * 1.4e-45))),
    "mixed": st.sampled_from([0.0, -0.0, 1.0, 1e30, -1e30, 3e38, 1e-38, 1.4e-45, 0.1, np.nan, np.inf]),
}


@pytest.mark.parametrize("kind", COORDINATES)
def test_zero_area_is_decided_as_in_rational_arithmetic(kind):
    seen = set()

    @given(st.lists(COORDINATES[kind], min_size=9, max_size=9))
    @settings(derandomize=True, max_examples=150, deadline=None)
    def check(values):
        corners = np.array(values, dtype=np.float32).reshape(3, 3)
        expected = Flat.of(corners) is not None
        seen.add(expected)
        assert valid_triangles(corners, np.array([[0, 1, 2]], np.int32)).tolist() == [int(expected)]

    check()
    assert seen == {True, False}, "the examples never met one of the two answers"


def test_points_on_a_line_that_float32_cannot_tell():
    a, d = np.float32([0.1, 0.2, 0.3]), np.float32([0.5, 0.25, 0.125])
    on_line = np.stack([a * 0, d, d * 3])
    off_line = on_line.copy()
    off_line[2, 1] = np.nextafter(off_line[2, 1], np.float32(9))
    points = np.vstack([on_line, off_line])
    assert valid_triangles(points, np.array([[0, 1, 2], [3, 4, 5]], np.int32)).tolist() == [0, 1]


def test_pixel_centres_and_the_top_row():
    eye, axes, tangents, column, row = ray_tables(Camera((0, 0, 0), (0, 0, -1), fov=90.0), 4, 2, np.zeros(3))
    assert tangents.tolist() == [2.0, 1.0]
    assert np.allclose(axes, [[1, 0, 0], [0, 1, 0], [0, 0, -1]])
    assert np.allclose(column, [(x, 0, -1) for x in (-1.5, -0.5, 0.5, 1.5)])
    assert np.allclose(row[:, 1], [0.5, -0.5])
    assert not eye.any()
    _, axes, _, column, row = ray_tables(CAMERA, 1, 1, np.zeros(3))
    assert np.array_equal(column[0] + row[0], axes[2]), "one pixel looks along the view"


def test_directions_are_one_float32_addition_and_axes_right_handed():
    camera = Camera((3.0, 1.0, 2.0), (0.1, 0.2, 0.3), (0.1, 1.0, 0.0), 37.0)
    moment = prepare(scene_of(TRIANGLE, [[0, 1, 2]], camera=camera)).moment(0, 7, 5)
    directions = moment.directions(np.arange(35))
    assert directions.tobytes() == (moment.column[None] + moment.row[:, None]).tobytes()
    forward = directions.astype(np.float64) @ moment.axes[2].astype(np.float64)
    assert np.abs(forward - 1).max() < 1e-6
    for axes in (moment.axes, ray_tables(Camera((1e6, 2, 3), (4, -5e5, 6), (0.3, 1, 0.2)), 3, 3, np.zeros(3))[1]):
        assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-6)
        assert np.allclose(np.cross(axes[0], axes[1]), -axes[2], atol=1e-6)


@pytest.mark.parametrize(
    ("camera", "size", "word"),
    [
        (Camera((0, 0, 0), (0, 5, 0)), (4, 4), "parallel"),
        (Camera((0, 0, 0), (0, 0, -1), (0, 0, 0)), (4, 4), "parallel"),
        (Camera((1, 1, 1), (1, 1, 1)), (4, 4), "different"),
        (Camera((np.nan, 0, 0), (1, 1, 1)), (4, 4), "finite"),
        (Camera((0, 0, 0), (0, 0, -1), fov=180.0), (4, 4), "fov"),
        (CAMERA, (0, 4), "0x4"),
    ],
)
def test_a_camera_that_sees_nothing_is_refused(camera, size, word):
    with pytest.raises(UserError, match=word):
        ray_tables(camera, *size, np.zeros(3))


def test_an_index_beyond_the_vertices_is_refused():
    with pytest.raises(UserError, match="vertex 3"):
        prepare(scene_of(TRIANGLE, [[0, 1, 3]]))


def test_an_empty_mesh_can_be_prepared():
    prepared = prepare(scene_of(np.zeros((0, 3)), np.zeros((0, 3), int)))
    assert prepared.moment(0, 2, 2).points.shape == (0, 3)
    assert prepared.radius == 1.0


def test_lights_follow_their_path_over_the_frames():
    frames = [TRIANGLE, TRIANGLE, TRIANGLE]
    path = Orbit((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), turns=0.5)
    made = Geometry(np.array([[0, 1, 2]], np.int32), lambda k: frames[k], 3)
    prepared = prepare(Scene("m", "M", lambda: made, CAMERA, (Light((0.0, 9.0, 4.0)),), light_path=path))
    places = [prepared.moment(k, 2, 2).lights[0] for k in range(3)]
    assert np.allclose(places, [(0, 9, 4), (-9, 0, 4), (0, -9, 4)], atol=1e-6)


def test_the_hash_knows_positions_order_and_frame():
    def digest(vertices, faces):
        return prepare(scene_of(vertices, faces)).sha256()

    two = np.vstack([TRIANGLE, [[1.0, 1, 0]]])
    first = digest(two, [[0, 1, 2], [1, 3, 2]])
    assert first == digest(two, [[0, 1, 2], [1, 3, 2]])
    assert len({first, digest(two, [[1, 3, 2], [0, 1, 2]]), digest(two * 2, [[0, 1, 2], [1, 3, 2]])}) == 3
