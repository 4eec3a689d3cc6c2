"""The conventions fixed once: recentring, weld, zero-area flags, ray tables; polygons; parts of changing topology."""

import numpy as np
import pytest
from helpers.second_judge import Flat
from hypothesis import given, settings
from hypothesis import strategies as st
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.light_paths import Orbit
from shadowbench.harness.scene.moment import ray_tables
from shadowbench.harness.scene.prepared import prepare, valid_triangles, weld
from shadowbench.harness.scene.readers import polygons
from shadowbench.harness.scene.readers.polygons import fixed_topology, triangulate
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
    assert (moment.valid.tolist(), prepared.radius) == ([1, 0, 0, 0, 0], pytest.approx(np.sqrt(2) / 2))


@given(st.lists(st.tuples(*[st.sampled_from([-1.0, -0.0, 0.0, 1e-45, 1.0, np.inf])] * 3), min_size=1, max_size=40))
@settings(derandomize=True, max_examples=100, deadline=None)
def test_weld_is_brute_force(rows):
    points = np.array(rows)
    single = points.astype(np.float32)
    expected = [min(j for j in range(len(rows)) if (single[j] == single[i]).all()) for i in range(len(rows))]
    assert (weld(points).tolist(), weld(np.array([[np.nan, 0, 0]] * 2)).tolist()) == (expected, [0, 1])
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


@pytest.mark.parametrize(("camera", "size", "word"), [
    (Camera((0, 0, 0), (0, 5, 0)), (4, 4), "parallel"),
    (Camera((0, 0, 0), (0, 0, -1), (0, 0, 0)), (4, 4), "parallel"),
    (Camera((1, 1, 1), (1, 1, 1)), (4, 4), "different"), (Camera((np.nan, 0, 0), (1, 1, 1)), (4, 4), "finite"),
    (Camera((0, 0, 0), (0, 0, -1), fov=180.0), (4, 4), "fov"), (CAMERA, (0, 4), "0x4"),
])  # fmt: skip
def test_a_camera_that_sees_nothing_is_refused(camera, size, word):
    with pytest.raises(UserError, match=word):
        ray_tables(camera, *size, np.zeros(3))


def test_an_index_beyond_the_vertices_is_refused():
    with pytest.raises(UserError, match="vertex 3"):
        prepare(scene_of(TRIANGLE, [[0, 1, 3]]))


def test_an_empty_mesh_can_be_prepared():
    prepared = prepare(scene_of(np.zeros((0, 3)), np.zeros((0, 3), int)))
    assert (prepared.moment(0, 2, 2).points.shape, prepared.radius) == ((0, 3), 1.0)


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


ARROW = [(0, 0), (4, -3), (1, 0), (4, 3)]
COMB = [(0, 0), (7, 0), (7, 4), (6, 4), (6, 1), (4, 1), (4, 4), (3, 4), (3, 1), (1, 1), (1, 4), (0, 4)]
STAIR = [(0, 0), (4, 0), (4, 1), (3, 1), (3, 2), (2, 2), (2, 3), (1, 3), (1, 4), (0, 4)]
BESIDE = [(0, 0), (1, 0), (2, 0), (4, 0), (4, 4), (2, 1), (0, 4), (0, 2)]  # three corners on a line, twice
TWICE = [(0, 0), (4, 0), (4, 0), (4, 4), (2, 1), (2, 1), (0, 4)]
KEYHOLE = [(0, 0), (6, 0), (6, 6), (0, 6), (0, 0), (2, 2), (2, 4), (4, 4), (4, 2), (2, 2)]
SHAPES = {"arrow": ARROW, "comb": COMB, "stair": STAIR, "beside": BESIDE, "twice": TWICE, "keyhole": KEYHOLE}


def area_of(outline) -> float:
    x, y = np.array(outline, dtype=float).T
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2


def placed(outline, turn: int = 0, frame=None) -> np.ndarray:
    """The outline in space, beginning with its corner ``turn``."""
    flat = np.roll(np.array(outline, dtype=np.float64), -turn, axis=0)
    return np.c_[flat, np.zeros(len(flat))] @ (np.eye(3) if frame is None else frame)


def cut(points: np.ndarray) -> np.ndarray:
    return triangulate(points, np.array([len(points)]), np.arange(len(points)))


def require_covered_once(points: np.ndarray, outline, frame: np.ndarray, tolerance: float) -> None:
    """The triangles are as many as they must be, all turned one way, and have the polygon's area."""
    faces = cut(points)
    a, b, c = points.astype(np.float64)[faces].transpose(1, 0, 2)
    normal = np.cross(frame[0], frame[1])
    own = np.cross(b - a, c - a) / 2 @ normal / (normal @ normal)
    assert (faces.shape, own.sum()) == ((len(outline) - 2, 3), pytest.approx(area_of(outline), rel=tolerance))
    assert np.abs(own).sum() == pytest.approx(abs(area_of(outline)), rel=tolerance)


FRAMES = [np.eye(3), np.eye(3)[[2, 0, 1]], np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]]


@pytest.mark.parametrize("shape", SHAPES)
def test_the_triangles_of_a_concave_polygon_cover_it_once(shape):
    """And every inner edge is shared by two triangles, so that no corner lies on another triangle's edge."""
    for outline in (SHAPES[shape], SHAPES[shape][::-1]):
        count = len(outline)
        for turn in range(count):
            for frame in FRAMES:
                require_covered_once(placed(outline, turn, frame), outline, frame, 1e-9)
            edges = [(int(f[i]), int(f[(i + 1) % 3])) for f in cut(placed(outline, turn)) for i in range(3)]
            alone = {edge for edge in edges if edge[::-1] not in edges}
            assert shape == "keyhole" or alone == {(i, (i + 1) % count) for i in range(count)}


def drawn(rng: np.random.Generator) -> np.ndarray:
    """A star, a comb or a spiral, sometimes with corners on its sides, once or twice each."""
    n = int(rng.integers(4, 14))
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    if (kind := rng.integers(3)) == 0:
        outline = np.c_[np.cos(turn), np.sin(turn)] * rng.uniform(0.1, 3, (n, 1))
    elif kind == 1:
        steps = np.arange(n)
        outline = np.r_[np.c_[steps, 0 * steps], np.c_[steps, 1 + rng.random(n) * 5 * (steps % 2)][::-1]]
    else:
        along = np.linspace(0, 4 * np.pi, 3 * n)[:, None]
        way = np.c_[np.cos(along), np.sin(along)]
        outline = np.r_[(1.0 + along) * way, ((0.6 + along) * way)[::-1]]
    for _ in range(rng.integers(4)):
        k = int(rng.integers(len(outline)))
        middle = (outline[k] + outline[(k + 1) % len(outline)]) / 2
        outline = np.insert(outline, k + 1, [middle] * int(rng.integers(1, 3)), axis=0)
    return outline


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_drawn_polygons_are_covered_once(kind):
    rng = np.random.default_rng(5)
    for _ in range(100):
        outline = drawn(rng)
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0] * 10 ** rng.uniform(-3, 3)
        require_covered_once(placed(outline, int(rng.integers(len(outline))), frame).astype(kind), outline, frame, 1e-4)


CIRCLE = [(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 9)[:-1]]
STRAIGHT = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 3), (0, 3)]


@pytest.mark.parametrize(
    "points", [placed(CIRCLE), placed(STRAIGHT), (placed(STRAIGHT, 0, FRAMES[2]) + 5).astype("f4")]
)
def test_a_convex_polygon_is_a_fan_though_its_sides_be_straight_but_for_rounding(points):
    assert cut(points).tolist() == [[0, i, i + 1] for i in range(1, len(points) - 1)]


def test_polygons_keep_their_order_and_their_number_of_triangles(monkeypatch):
    monkeypatch.setattr(polygons, "_BLOCK", 50)  # corners: they are cut in several blocks
    some = [placed(ARROW, 1), placed([(0, 0), (1, 0), (0, 1)]), placed(COMB, 5), placed(ARROW, 0), placed(STAIR, 3)]
    parts = some * 20
    counts = np.array([len(part) for part in parts])
    points, starts = np.concatenate(parts), np.cumsum(counts) - counts
    faces = triangulate(points, counts, np.arange(len(points)))
    own = faces - np.repeat(starts, counts - 2)[:, None]
    assert own.tolist() == np.concatenate([cut(part) for part in some] * 20).tolist()


@pytest.mark.parametrize("points", [
    np.full((5, 3), np.nan),
    np.zeros((5, 3)),
    np.array([(0, 0, 0), (4, 0, 0), (0, 3, 0), (4, 3, 0), (2, 9, 0)], dtype=float),  # crosses itself
    np.array([(0, 0, 0), (1e308, 0, 0), (1e308, 1e308, 0), (1e307, 2e307, 0), (0, 1e308, 0)]),
], ids=["nan", "a point", "crossing", "huge"])  # fmt: skip
def test_what_has_no_triangulation_still_has_its_number_of_triangles(points):
    faces = cut(points)
    assert (faces.shape, set(faces.ravel())) == ((3, 3), set(range(5)))


def test_an_index_out_of_range_is_left_to_the_check():
    assert triangulate(np.zeros((3, 3)), np.array([4]), np.array([0, 1, 2, 7])).tolist() == [[0, 1, 2], [0, 2, 7]]


def test_a_polygon_of_more_corners_than_a_block():
    angle = np.linspace(0.0, 2.0 * np.pi, 70_000, endpoint=False)
    assert cut(placed(np.c_[np.cos(angle), np.sin(angle)])).shape == (69_998, 3)


FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
MORE = np.array([[3, 1, 0], [0, 1, 2], [4, 0, 1]], dtype=np.int32)


def piece(seed: int, count: int = 4, faces=FACES, kind=np.float32):
    return np.random.default_rng(seed).random((count, 3), dtype=np.float32).astype(kind), faces.copy()


@pytest.mark.parametrize(("frames", "triangles", "padded", "vanishing"), [
    ([[piece(0), piece(k)] for k in range(3)], 4, (), ()),
    ([[piece(0), piece(1)], [piece(0), None]], 4, (), (1,)),
    ([[one, piece(9)] for one in (piece(0), piece(1, 5, MORE), None, piece(2, faces=FACES[:1]))], 5, (0,), ()),
    ([[piece(0)], [piece(0, 5, kind=np.float64)]], 2, (0,), ()),  # one more vertex is another topology
    ([[None, piece(0)], [None, piece(1)]], 2, (), ()),
    ([[None], [None]], 0, (), ()),
])  # fmt: skip
def test_each_frame_has_its_triangles(frames, triangles, padded, vanishing):
    fixed = fixed_topology(frames)
    assert (len(fixed.faces), fixed.padded, fixed.vanishing) == (triangles, padded, vanishing)
    kinds = {one[0].dtype for frame in frames for one in frame if one}
    for frame, points in zip(frames, fixed.frames, strict=True):
        corners = points[fixed.faces]
        own = [one[0][one[1]] for one in frame if one]
        assert corners[np.isfinite(corners).all(axis=(1, 2))].tolist() == [t for part in own for t in part.tolist()]
        assert points.dtype == (np.float64 if np.dtype(np.float64) in kinds else np.float32)
        assert padded or len(points) == sum(max(len(f[i][0]) if f[i] else 0 for f in frames) for i in range(len(frame)))
