"""The stand-ins: sizes, topology, views, the same bytes every time, and that each moves as what it stands for."""

import functools
import hashlib

import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shadowbench.harness.judge.reference import embree_reference
from shadowbench.harness.scene import catalogue
from shadowbench.harness.scene.names import PAPER, stand_in
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Geometry
from shadowbench.harness.scene.standins import bodies, bunny_dragon, cloth, fairy, implicit, shapes
from shadowbench.harness.scene.standins.motion import Swing
from shadowbench.harness.scene.standins.shapes import Mesh


def edge_faults(faces: NDArray[np.integer]) -> int:
    """How many directed edges lack a single partner the other way: 0 if closed and consistently oriented."""
    count = int(faces.max()) + 1 if len(faces) else 0
    start, end = faces.astype(np.int64).ravel(), np.roll(faces, -1, axis=1).astype(np.int64).ravel()
    forward, backward = np.sort(start * count + end), np.sort(end * count + start)
    repeated = int((forward[1:] == forward[:-1]).sum())
    alone = np.setdiff1d(forward, backward, assume_unique=repeated == 0)
    return repeated + len(alone)


def areas(mesh: Mesh) -> NDArray[np.float64]:
    """Area of each triangle in square metres, float64 [triangle_count]."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


TABLE_1 = dict(zip(PAPER, (174_000, 82_000, 252_000, 284_000, 92_000, 1_087_716), strict=True))
"""Triangles in the paper's Table 1."""

ROOMS = ["sibenik", "conference"]
MOVING = [name for name in PAPER if PAPER[name].moves]


@functools.cache
def prepared(name: str) -> Prepared:
    return prepare(stand_in(name))


def moving(name: str) -> Geometry:
    return prepared(name).geometry


def triangles_of(name: str) -> shapes.Mesh:
    return shapes.Mesh(prepared(name).points(0)[0].astype(np.float64), prepared(name).faces)


def volume_of(mesh: shapes.Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


@pytest.mark.slow
@pytest.mark.parametrize("name", PAPER)
def test_size_and_topology(name: str) -> None:
    geometry, count = prepared(name).geometry, prepared(name).vertex_count
    assert len(geometry.faces) == PAPER[name].triangles
    assert abs(len(geometry.faces) / TABLE_1[name] - 1) < 0.01
    assert ((geometry.frame_count > 1), geometry.faces.dtype) == (PAPER[name].moves, np.int32)
    np.testing.assert_array_equal(np.unique(geometry.faces), np.arange(count))
    a, b, c = geometry.faces.T
    assert not ((a == b) | (b == c) | (c == a)).any()
    assert name in MOVING or prepared(name).points(0)[1].all(), "an area that is 0"
    for k in {0, geometry.frame_count // 2, geometry.frame_count - 1}:
        points = geometry.positions(k)
        assert (points.shape, points.dtype) == ((count, 3), np.float64)
        assert np.isfinite(points).all()


@pytest.mark.parametrize("name", ["fairy", "sibenik"])
def test_same_bytes_when_built_again(name: str) -> None:
    def digest(geometry: Geometry) -> str:
        frames = [geometry.positions(k) for k in (0, geometry.frame_count - 1)]
        return hashlib.sha256(b"".join(array.tobytes() for array in (geometry.faces, *frames))).hexdigest()

    assert digest(stand_in(name).geometry()) == digest(prepared(name).geometry)


@pytest.mark.parametrize("name", MOVING)
def test_no_frame_depends_on_the_frames_asked_for_before(name: str) -> None:
    geometry = moving(name)
    early, later = geometry.positions(3).copy(), geometry.positions(9)
    assert not np.array_equal(early, later)
    later[:] = 0.0
    np.testing.assert_array_equal(geometry.positions(3), early)


@pytest.mark.parametrize("name", MOVING)
def test_motion_is_what_is_declared(name: str) -> None:
    geometry = moving(name)
    assert geometry.motion.kind == ("rigid" if name == "bunny_dragon" else "deforming")
    assert (geometry.motion.vertices is None) == (name == "bunny_dragon")
    first = geometry.positions(0)
    moved = np.zeros(len(first), dtype=bool)
    for k in (geometry.frame_count // 3, geometry.frame_count - 1):
        moved |= (geometry.positions(k) != first).any(axis=1)
    low, high = geometry.motion.vertices or (0, len(first))
    assert not moved[:low].any()
    assert not moved[high:].any()
    assert moved[low : low + 8].any()  # a blade of grass stands on roots that do not move
    assert moved[low:high].mean() > 0.05


def test_buddha_is_closed_faces_outwards_and_has_triangles_of_nearly_one_size() -> None:
    mesh = triangles_of("buddha")
    assert prepared("buddha").scene.closed
    assert edge_faults(mesh.faces) == 0
    assert 0.2 < volume_of(mesh) < 1.5
    low, high = np.percentile(areas(mesh), [5, 95])
    assert high < 12 * low


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_is_closed_around_camera_and_light_and_has_triangles_of_very_different_sizes(name: str) -> None:
    """Rays all around from eye and light hit something, at a distance that shows they are in free space."""
    assert not prepared(name).scene.closed
    moment, scene = prepared(name).moment(0, 8, 8), EmbreeScene()
    TriangleMesh(scene, moment.points, prepared(name).faces)
    directions = np.random.default_rng(1).normal(size=(4000, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for origin in (moment.eye, moment.lights[0]):
        hit = scene.run(np.tile(origin, (4000, 1)), directions, output=True)
        assert (hit["primID"] >= 0).all()
        assert hit["tfar"].min() > 0.05
    area = areas(triangles_of(name))
    assert area.max() > 40.0
    assert np.median(area) < 0.02
    assert (area > 1.0).sum() > 50


@pytest.mark.parametrize(("name", "low", "high"), [("sibenik", 1, 1), ("conference", 1, 1), ("buddha", 0.3, 0.6)])
def test_view_is_filled_with_lit_and_shadowed_parts(name: str, low: float, high: float) -> None:
    answers = embree_reference(prepared(name), prepared(name).moment(0, 96, 96))
    seen = answers.triangle >= 0
    assert low <= seen.mean() <= high
    assert 0.05 < answers.shadowed[0][seen].mean() < 0.8


CLOSED = {
    "box": shapes.box((0, 0, 0), (1, 2, 3)),
    "cylinder": shapes.cylinder(1.0, 2.0, 48, rings=3),
    "frustum": shapes.cylinder(1.0, 2.0, 12, top=0.2),
    "sphere": shapes.sphere(1.0, 64),
    "cushion": shapes.cushion((1, 2, 3), 32),
    "tube": shapes.tube([[0, 0, 0], [0, 1, 0], [0.5, 2, 0]], [0.1, 0.2, 0.1], 8),
    "ring": shapes.tube([[1, 0, 0], [0, 0, 1], [-1, 0, 0], [0, 0, -1]], 0.1, 8, closed=True),
}
VOLUMES = {"box": 6.0, "cylinder": 2 * np.pi, "sphere": 4 / 3 * np.pi}


@pytest.mark.parametrize("shape", sorted(CLOSED))
def test_shapes_are_closed_and_face_outwards(shape: str) -> None:
    mesh = CLOSED[shape]
    assert (mesh.vertices.dtype, mesh.faces.dtype, edge_faults(mesh.faces)) == (np.float64, np.int32, 0)
    assert volume_of(mesh) == pytest.approx(VOLUMES[shape], rel=0.01) if shape in VOLUMES else volume_of(mesh) > 0
    assert areas(mesh).min() > 0


def test_edge_faults_sees_a_hole_and_a_turned_triangle() -> None:
    faces = CLOSED["box"].faces
    assert edge_faults(faces[1:]) == 3
    assert edge_faults(np.concatenate([faces[:1, ::-1], faces[1:]])) > 0


def test_transform_order_and_mirror() -> None:
    moved = shapes.transform(CLOSED["box"], scale=(-1, 1, 2), rotate=((0, 1, 0), 90.0), translate=(10, 0, 0))
    # (1, 2, 3) is scaled to (-1, 2, 6), turned to (6, 2, 1), and moved.
    assert np.isclose(moved.vertices, (16, 2, 1)).all(axis=1).any()
    assert volume_of(moved) == pytest.approx(12.0)


def test_noise_is_smooth_and_depends_on_its_seed_only() -> None:
    points = np.random.default_rng(0).uniform(-40, 40, (500, 3))
    assert np.array_equal(shapes.noise(points, 3, 4), shapes.noise(points.copy(), 3, 4))
    assert not np.array_equal(shapes.noise(points, 3, 4), shapes.noise(points, 4, 4))
    assert np.abs(shapes.noise(points, 3, 4)).max() <= 1.0
    assert np.abs(shapes.noise(points, 3) - shapes.noise(points + 1e-6, 3)).max() < 1e-5


def test_surface_stays_closed_where_sheets_touch() -> None:
    """Noise as fine as the lattice: squares with the surface across all four sides are everywhere."""

    def sponge(points: np.ndarray) -> np.ndarray:
        ball = np.linalg.norm(points, axis=1) - np.float32(0.5)
        return np.maximum(ball, 0.05 * shapes.noise(points * 40.0, 7)).astype(np.float32)

    mesh = implicit.polygonise(sponge, (-0.6, -0.6, -0.6), (0.6, 0.6, 0.6), 0.02, slack=3.0)
    assert len(mesh.faces) > 20_000
    assert edge_faults(mesh.faces) == 0


def test_fairy_is_a_teapot_in_a_stadium() -> None:
    corners = moving("fairy").positions(0)[moving("fairy").faces]
    assert (np.ptp(corners.reshape(-1, 3), axis=0)[[0, 2]] >= 24.0).all()
    area = areas(shapes.Mesh(moving("fairy").positions(0), moving("fairy").faces))
    large = area > 1.0
    assert large.sum() < 500, "the ground is made of few triangles"
    assert area[large].sum() > 500.0, "and is 24 m wide"
    middle = corners.mean(axis=1)
    assert (np.hypot(middle[:, 0], middle[:, 2]) < 2.0).mean() > 0.5, "most triangles are within a clearing of 2 m"


def test_fairy_moves_without_tearing() -> None:
    body = fairy._fairy()[0]
    edges = body.mesh.faces[:, :2]
    at_rest = np.linalg.norm(np.subtract(*body.mesh.vertices[edges.T]), axis=1)
    for phase in (0.15, 0.6):
        points = body.mesh.vertices.copy()
        for motion in body.motions:
            motion.apply(points, phase)
        length = np.linalg.norm(np.subtract(*points[edges.T]), axis=1)
        assert np.abs(points - body.mesh.vertices).max() > 0.05
        assert np.quantile(length / at_rest, [0.001, 0.999]) == pytest.approx(1.0, abs=0.5)
    moved = np.linalg.norm(np.subtract(*(moving("fairy").positions(k) for k in (5, 0))), axis=1)
    assert (moved > 1e-4).mean() > 0.5
    assert moved.max() < 1.0


def test_bunny_and_dragon_fly_apart_in_patches() -> None:
    geometry = moving("bunny_dragon")
    before, after = (geometry.positions(k) for k in (0, geometry.frame_count - 1))
    count, faces = len(before), geometry.faces
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    links = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    assert 200 < connected_components(links, directed=False)[0] < 5000
    # At first the patches are joined to the last bit into two closed bodies (V = F / 2 + 2 each, less handles).
    whole = len(np.unique(before, axis=0))
    assert abs(whole - len(faces) / 2) < 20
    assert count > 1.15 * whole
    assert len(np.unique(after, axis=0)) == count


def test_the_dragon_waits_for_the_bunny() -> None:
    geometry = moving("bunny_dragon")
    first = geometry.positions(0)
    struck = bunny_dragon.IMPACT_TIME / bunny_dragon.FRAME_TIME
    for k in range(1, geometry.frame_count):
        moved = np.linalg.norm(geometry.positions(k) - first, axis=1)
        if k <= struck:
            still = moved == 0.0
            assert 0.6 < still.mean() < 0.85, "the dragon rests"
            np.testing.assert_allclose(moved[~still], bunny_dragon.BUNNY_SPEED * k * bunny_dragon.FRAME_TIME)
    assert (moved > 0.1).mean() > 0.9, "in the end all of it flies"


@pytest.mark.parametrize("name", ["bunny_dragon", "balls-2k-moving70", "balls-2k-moving100"])
def test_bodies_keep_their_shape(name: str) -> None:
    """No two vertices of a triangle come nearer or go farther, and triangles of one body have turned alike."""
    geometry = moving(name) if name in PAPER else catalogue.resolve(name).geometry()
    bodies, faces = geometry.motion.bodies, geometry.faces
    assert len(bodies) == len(faces)
    assert 20 < bodies.max() < 1000
    lengths = []
    for k in (0, geometry.frame_count - 1):
        points = geometry.positions(k)[faces].astype(np.float64)
        middle = np.stack([np.bincount(bodies, points[:, 0, axis]) / np.bincount(bodies) for axis in range(3)], axis=1)
        arms = np.concatenate([points - np.roll(points, 1, axis=1), (points[:, 0] - middle[bodies])[:, None]], axis=1)
        lengths.append(np.linalg.norm(arms, axis=-1))
    np.testing.assert_allclose(*lengths, atol=1e-5 if name != "bunny_dragon" else 1e-11)


def test_cloth_runs_the_same_again() -> None:
    again = cloth.simulate(cloth.SETTINGS, 3, cloth.FRAME_TIME)
    assert again.tobytes() == cloth._simulated()[:3].tobytes()


def test_cloth_falls_folds_and_stays_outside_ball_and_ground() -> None:
    geometry = moving("cloth")
    sheet = (cloth.SETTINGS.cells * cloth.REFINE + 1) ** 2
    assert np.ptp(geometry.positions(0)[:sheet, 1]) < 0.01
    for k in range(geometry.frame_count):
        points = geometry.positions(k)[:sheet]
        arm = points - (0.0, cloth.SETTINGS.ball_radius, 0.0)
        assert np.linalg.norm(arm, axis=1).min() > cloth.SETTINGS.ball_radius
        assert points[:, 1].min() > 0.0
    assert np.quantile(points[:, 1], 0.1) < 0.1, "the rim lies on the ground"
    assert points[:, 1].max() > 2 * cloth.SETTINGS.ball_radius, "the middle lies on the ball"


def test_cloth_keeps_its_size_and_touches_itself() -> None:
    frames, cell = cloth._simulated(), cloth.SETTINGS.side / cloth.SETTINGS.cells
    for place in frames[1:]:
        length = np.linalg.norm(np.diff(place, axis=1), axis=0) / cell
        assert abs(length.mean() - 1) < 0.03
        assert np.quantile(length, 0.99) < 1.35
    n, points = frames.shape[2], frames[-1].reshape(3, -1).T

    def strangers(distance: float) -> int:
        i, j = cKDTree(points).query_pairs(distance, output_type="ndarray").T
        return int((np.maximum(abs(i // n - j // n), abs(i % n - j % n)) > 1).sum())

    assert strangers(cloth.SETTINGS.thickness * cell * 1.02) > 100, "layers lie on each other"
    assert strangers(0.5 * cloth.SETTINGS.thickness * cell) == 0, "and not in each other"


def test_cloth_batches_hold_every_constraint_once() -> None:
    settings, n = cloth.ClothSettings(cells=9), 10
    number = np.broadcast_to(np.arange(n * n).reshape(n, n), (3, n, n))
    seen = []
    for first, second, rest, _ in cloth._batches(settings, n):
        ends = np.stack([number[first][0].ravel(), number[second][0].ravel()], axis=1)
        assert len(np.unique(ends)) == ends.size, "a batch shares no vertex"
        reach = np.hypot(*np.divmod(ends[:, 1], n) - np.stack(np.divmod(ends[:, 0], n)))
        np.testing.assert_allclose(reach * settings.side / settings.cells, rest)
        seen.append(ends)
    every = np.concatenate(seen)
    assert len(np.unique(every, axis=0)) == len(every) == 2 * n * (n - 1) + 2 * (n - 1) ** 2 + 2 * n * (n - 2)


def test_ball_angle_is_the_integral_of_its_speed() -> None:
    settings = cloth.ClothSettings()
    times = np.linspace(0.0, 2.0, 20001)
    speed = np.array([settings.ball_speed(t) for t in times])
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(times))])
    np.testing.assert_allclose([settings.ball_angle(t) for t in times[::1000]], angle[::1000], atol=1e-6)


def test_body_of_one_sphere_is_that_sphere() -> None:
    mesh = bodies.Body([bodies.ball((0.2, -0.1, 0.3), 0.5)]).mesh(0.05)
    arm = mesh.vertices - (0.2, -0.1, 0.3)
    np.testing.assert_allclose(np.linalg.norm(arm, axis=1), 0.5, atol=5e-4)
    assert edge_faults(mesh.faces) == 0
    assert ((bodies.normals(mesh) * arm).sum(axis=1) > 0.49).all(), "normals point out"


@pytest.mark.parametrize("make", [bunny_dragon.bunny, bunny_dragon.dragon, fairy.fairy_body])
def test_leaving_out_far_blobs_changes_nothing(make) -> None:
    body, rng = make(), np.random.default_rng(0)
    chosen = rng.integers(0, len(body.blobs), 6000)
    ends = np.array([(blob.start, blob.end) for blob in body.blobs])
    points = (ends[chosen, rng.integers(0, 2, 6000)] + rng.normal(0, 0.1, (6000, 3))).astype(np.float32)
    field = np.full(len(points), 1e3, dtype=np.float32)
    for blob in body.blobs:
        field = bodies._united(field, blob, np.ascontiguousarray(points.T))
    np.testing.assert_allclose(body.distance(points), field, atol=2e-4)


def test_swing_turns_by_weight_about_its_axis() -> None:
    points = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 5.0, 0.0]])
    Swing((0, 0, 0), (0, 0, 2), reach=90, weight=np.array([1.0, 0.0, 0.5])).apply(points, 0.25)
    np.testing.assert_allclose(points, [[0, 1, 0], [1, 0, 0], np.sqrt(0.5) * np.array([-3, 7, 0])], atol=1e-12)
