"""The animated stand-ins: size, repeatability, and that the motion is what it stands for."""

import hashlib

import numpy as np
import pytest
from helpers.mesh_checks import edge_faults
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shadowbench.harness.scene import catalogue
from shadowbench.harness.scene.scene import Geometry
from shadowbench.harness.scene.standins import bodies, bunny_dragon, cloth, cloth_solver, fairy
from shadowbench.harness.scene.standins.motion import Swing

MODULES = {"fairy": fairy, "bunny_dragon": bunny_dragon, "cloth": cloth}
TRIANGLES = {"fairy": 174_000, "bunny_dragon": 252_000, "cloth": 92_000}
"""As in the paper's Table 1."""


@pytest.fixture(scope="module")
def built() -> dict[str, Geometry]:
    return {name: module.geometry() for name, module in MODULES.items()}


def digest(geometry: Geometry, frames: list[int]) -> str:
    state = hashlib.sha256(geometry.faces.tobytes())
    for k in frames:
        state.update(np.ascontiguousarray(geometry.positions(k)).tobytes())
    return state.hexdigest()


@pytest.mark.parametrize("name", MODULES)
def test_triangle_count_is_the_papers_within_one_percent(built, name):
    assert abs(len(built[name].faces) / TRIANGLES[name] - 1) < 0.01


@pytest.mark.parametrize("name", MODULES)
def test_topology_is_sound_and_every_frame_is_finite(built, name):
    geometry = built[name]
    assert geometry.faces.dtype == np.int32
    assert geometry.faces.shape[1] == 3
    count = len(geometry.positions(0))
    assert geometry.faces.min() == 0
    assert geometry.faces.max() == count - 1
    a, b, c = geometry.faces.T
    assert not ((a == b) | (b == c) | (c == a)).any()
    for k in (0, geometry.frame_count // 2, geometry.frame_count - 1):
        points = geometry.positions(k)
        assert points.shape == (count, 3)
        assert points.dtype == np.float64
        assert np.isfinite(points).all()


@pytest.mark.parametrize("name", MODULES)
def test_no_frame_depends_on_the_frames_asked_for_before(built, name):
    geometry = built[name]
    early = geometry.positions(3).copy()
    later = geometry.positions(9)
    assert not np.array_equal(early, later)
    later[:] = 0.0
    np.testing.assert_array_equal(geometry.positions(3), early)


@pytest.mark.parametrize("name", ["fairy", "bunny_dragon"])
def test_same_bytes_when_built_again(built, name):
    frames = [0, built[name].frame_count - 1]
    assert digest(MODULES[name].geometry(), frames) == digest(built[name], frames)


def test_cloth_runs_the_same_again():
    again = cloth_solver.simulate(cloth.SETTINGS, 5, cloth.FRAME_TIME)
    assert again.tobytes() == cloth._simulated()[:5].tobytes()
    other = cloth_solver.simulate(cloth_solver.ClothSettings(seed=2), 2, cloth.FRAME_TIME)
    assert other.tobytes() != again[:2].tobytes()


def test_fairy_is_a_teapot_in_a_stadium(built):
    geometry = built["fairy"]
    points = geometry.positions(0)
    assert np.ptp(points[:, 0]) >= 24.0
    assert np.ptp(points[:, 2]) >= 24.0
    a, b, c = (points[geometry.faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    large = area > 1.0
    assert large.sum() < 500, "the ground is made of few triangles"
    assert area[large].sum() > 500.0, "and is 24 m wide"
    middle = (a + b + c) / 3
    near = np.hypot(middle[:, 0], middle[:, 2]) < 2.0
    assert near.mean() > 0.5, "most triangles are within a clearing of 2 m"


def test_fairy_moves_without_tearing(built):
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
    first, second = (built["fairy"].positions(k) for k in (0, 5))
    moved = np.linalg.norm(second - first, axis=1)
    assert (moved > 1e-4).mean() > 0.5
    assert moved.max() < 1.0


def test_bunny_and_dragon_fly_apart_in_rigid_patches(built):
    geometry = built["bunny_dragon"]
    count = len(geometry.positions(0))
    faces = geometry.faces.astype(np.int64)
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    links = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    patches = connected_components(links, directed=False)[0]
    assert 200 < patches < 5000
    before, after = (geometry.positions(k) for k in (0, geometry.frame_count - 1))
    # At first the patches are joined to the last bit into two closed bodies (V = F / 2 + 2 each, less handles).
    whole = len(np.unique(before, axis=0))
    assert abs(whole - len(faces) / 2) < 20
    assert count > 1.15 * whole
    assert len(np.unique(after, axis=0)) == count
    for corner in range(3):
        edge = faces[:, [corner, (corner + 1) % 3]]
        rest = np.linalg.norm(np.subtract(*before[edge.T]), axis=1)
        np.testing.assert_allclose(np.linalg.norm(np.subtract(*after[edge.T]), axis=1), rest, atol=1e-12)


def test_the_dragon_waits_for_the_bunny(built):
    geometry = built["bunny_dragon"]
    first = geometry.positions(0)
    struck = bunny_dragon.IMPACT_TIME / bunny_dragon.FRAME_TIME
    for k in range(1, geometry.frame_count):
        moved = np.linalg.norm(geometry.positions(k) - first, axis=1)
        if k <= struck:
            still = moved == 0.0
            assert 0.6 < still.mean() < 0.85, "the dragon rests"
            np.testing.assert_allclose(moved[~still], bunny_dragon.BUNNY_SPEED * k * bunny_dragon.FRAME_TIME)
    assert (moved > 0.1).mean() > 0.9, "in the end all of it flies"


def test_cloth_falls_folds_and_stays_outside_ball_and_ground(built):
    geometry = built["cloth"]
    sheet = (cloth.SETTINGS.cells * cloth.REFINE + 1) ** 2
    assert np.ptp(geometry.positions(0)[:sheet, 1]) < 0.01
    for k in range(geometry.frame_count):
        points = geometry.positions(k)[:sheet]
        arm = points - (0.0, cloth.SETTINGS.ball_radius, 0.0)
        assert np.linalg.norm(arm, axis=1).min() > cloth.SETTINGS.ball_radius
        assert points[:, 1].min() > 0.0
    assert np.quantile(points[:, 1], 0.1) < 0.1, "the rim lies on the ground"
    assert points[:, 1].max() > 2 * cloth.SETTINGS.ball_radius, "the middle lies on the ball"


def test_cloth_keeps_its_size_and_touches_itself(built):
    frames = cloth._simulated()
    cell = cloth.SETTINGS.side / cloth.SETTINGS.cells
    for place in frames[1:]:
        length = np.linalg.norm(np.diff(place, axis=1), axis=0) / cell
        assert abs(length.mean() - 1) < 0.03
        assert np.quantile(length, 0.99) < 1.35
    n = frames.shape[2]
    points = frames[-1].reshape(3, -1).T

    def strangers(distance: float) -> int:
        i, j = cKDTree(points).query_pairs(distance, output_type="ndarray").T
        return int((np.maximum(abs(i // n - j // n), abs(i % n - j % n)) > 1).sum())

    assert strangers(cloth.SETTINGS.thickness * cell * 1.02) > 100, "layers lie on each other"
    assert strangers(0.5 * cloth.SETTINGS.thickness * cell) == 0, "and not in each other"


def test_cloth_batches_hold_every_constraint_once():
    settings, n = cloth_solver.ClothSettings(cells=9), 10
    number = np.broadcast_to(np.arange(n * n).reshape(n, n), (3, n, n))
    seen = []
    for first, second, rest, _ in cloth_solver._batches(settings, n):
        ends = np.stack([number[first][0].ravel(), number[second][0].ravel()], axis=1)
        assert len(np.unique(ends)) == ends.size, "a batch shares no vertex"
        reach = np.hypot(*np.divmod(ends[:, 1], n) - np.stack(np.divmod(ends[:, 0], n)))
        np.testing.assert_allclose(reach * settings.side / settings.cells, rest)
        seen.append(ends)
    every = np.concatenate(seen)
    assert len(np.unique(every, axis=0)) == len(every)
    assert len(every) == 2 * n * (n - 1) + 2 * (n - 1) ** 2 + 2 * n * (n - 2)


def test_ball_angle_is_the_integral_of_its_speed():
    settings = cloth_solver.ClothSettings()
    times = np.linspace(0.0, 2.0, 20001)
    speed = np.array([settings.ball_speed(t) for t in times])
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(times))])
    np.testing.assert_allclose([settings.ball_angle(t) for t in times[::1000]], angle[::1000], atol=1e-6)


def test_body_of_one_sphere_is_that_sphere():
    mesh = bodies.Body([bodies.ball((0.2, -0.1, 0.3), 0.5)]).mesh(0.05)
    arm = mesh.vertices - (0.2, -0.1, 0.3)
    np.testing.assert_allclose(np.linalg.norm(arm, axis=1), 0.5, atol=5e-4)
    assert edge_faults(mesh.faces) == 0
    assert ((bodies.normals(mesh) * arm).sum(axis=1) > 0.49).all(), "normals point out"


@pytest.mark.parametrize("body", [bunny_dragon.bunny(), bunny_dragon.dragon(), fairy.fairy_body()])
def test_leaving_out_far_blobs_changes_nothing(body):
    rng = np.random.default_rng(0)
    chosen = rng.integers(0, len(body.blobs), 6000)
    ends = np.array([(blob.start, blob.end) for blob in body.blobs])
    points = (ends[chosen, rng.integers(0, 2, 6000)] + rng.normal(0, 0.1, (6000, 3))).astype(np.float32)
    field = np.full(len(points), 1e3, dtype=np.float32)
    for blob in body.blobs:
        field = bodies._united(field, blob, np.ascontiguousarray(points.T))
    np.testing.assert_allclose(body.distance(points), field, atol=2e-4)


def test_swing_turns_by_weight_about_its_axis():
    points = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 5.0, 0.0]])
    Swing((0, 0, 0), (0, 0, 2), reach=90, weight=np.array([1.0, 0.0, 0.5])).apply(points, 0.25)
    half = np.sqrt(0.5)
    expected = [[0, 1, 0], [1, 0, 0], [half * (2 - 5), half * (2 + 5), 0]]
    np.testing.assert_allclose(points, expected, atol=1e-12)


@pytest.mark.parametrize("name", ["bunny_dragon", "balls-2k-moving70", "balls-2k-moving100"])
def test_bodies_keep_their_shape(name):
    """No two vertices of a triangle come nearer or go farther, and triangles of one body have turned alike."""
    geometry = catalogue.resolve(name).geometry()
    bodies, faces = geometry.motion.bodies, geometry.faces
    assert len(bodies) == len(faces)
    assert 20 < bodies.max() < 1000
    first, last = (geometry.positions(k)[faces].astype(np.float64) for k in (0, geometry.frame_count - 1))
    edges = [points - np.roll(points, 1, axis=1) for points in (first, last)]
    sizes = [np.linalg.norm(edge, axis=-1) for edge in edges]
    assert np.abs(sizes[0] - sizes[1]).max() < 1e-5
    # From a body's middle to its triangles.
    far = [points[:, 0] - np.array([np.bincount(bodies, points[:, 0, k]) / np.bincount(bodies) for k in range(3)]).T[bodies]
           for points in (first, last)]  # fmt: skip
    assert np.abs(np.linalg.norm(far[0], axis=-1) - np.linalg.norm(far[1], axis=-1)).max() < 1e-5


@pytest.mark.parametrize(
    ("name", "kind", "whole"),
    [("fairy", "deforming", False), ("cloth", "deforming", False), ("bunny_dragon", "rigid", True)],
)
def test_motion_is_what_is_declared(name, kind, whole):
    geometry = {"fairy": fairy, "cloth": cloth, "bunny_dragon": bunny_dragon}[name].geometry()
    assert geometry.motion is not None
    assert geometry.motion.kind == kind
    assert (geometry.motion.vertices is None) == whole
    first = geometry.positions(0)
    moved = np.zeros(len(first), dtype=bool)
    for k in (geometry.frame_count // 3, geometry.frame_count - 1):
        moved |= (geometry.positions(k) != first).any(axis=1)
    low, high = geometry.motion.vertices or (0, len(first))
    assert not moved[:low].any()
    assert not moved[high:].any()
    assert moved[low : low + 8].any()  # a blade of grass stands on roots that do not move
    assert moved[low:high].mean() > 0.05
