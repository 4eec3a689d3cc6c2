"""The static stand-ins: sizes, labels, closed surfaces, cameras and lights in free space, same bytes every time."""

import functools
import hashlib

import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from helpers.mesh_checks import areas, edge_faults
from shadowbench.harness.scene.names import stand_in
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.standins import buddha, conference, implicit, shapes, sibenik

MODULES = {"sibenik": sibenik, "conference": conference, "buddha": buddha}
TRIANGLES = {"sibenik": 82_000, "conference": 284_000, "buddha": 1_087_716}
NAMES = sorted(MODULES)


@functools.cache
def prepared(name: str) -> Prepared:
    return prepare(stand_in(name))


@functools.cache
def embree(name: str) -> EmbreeScene:
    scene = EmbreeScene()
    TriangleMesh(scene, prepared(name).points(0)[0], prepared(name).faces)
    return scene


def digest(name: str) -> str:
    geometry = MODULES[name].geometry()
    return hashlib.sha256(geometry.positions(0).tobytes() + geometry.faces.tobytes()).hexdigest()


@pytest.mark.parametrize("name", NAMES)
def test_triangle_count_is_within_one_percent_of_the_papers(name: str) -> None:
    assert abs(prepared(name).triangle_count / TRIANGLES[name] - 1) < 0.01


@pytest.mark.parametrize("name", NAMES)
def test_same_bytes_every_time(name: str) -> None:
    geometry = prepared(name).geometry
    first = hashlib.sha256(geometry.positions(0).tobytes() + geometry.faces.tobytes()).hexdigest()
    assert digest(name) == first


@pytest.mark.parametrize("name", NAMES)
def test_no_zero_area_triangle_after_rounding(name: str) -> None:
    points, valid = prepared(name).points(0)
    assert np.isfinite(points).all()
    assert valid.all()


@pytest.mark.parametrize("name", NAMES)
def test_every_vertex_is_used(name: str) -> None:
    assert len(np.unique(prepared(name).faces)) == prepared(name).vertex_count


def test_buddha_is_closed_and_faces_outwards() -> None:
    assert stand_in("buddha").closed
    assert edge_faults(prepared("buddha").faces) == 0
    points, faces = prepared("buddha").points(0)[0].astype(np.float64), prepared("buddha").faces
    a, b, c = (points[faces[:, k]] for k in range(3))
    volume = (a * np.cross(b, c)).sum() / 6
    assert 0.2 < volume < 1.5


@pytest.mark.parametrize("name", ["sibenik", "conference"])
def test_camera_and_light_are_inside_a_closed_room(name: str) -> None:
    """Rays all around from eye and light hit something, at a distance that shows they are in free space."""
    assert not stand_in(name).closed
    moment = prepared(name).moment(0, 8, 8)
    directions = np.random.default_rng(1).normal(size=(4000, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for origin in (moment.eye, moment.lights[0]):
        hit = embree(name).run(np.tile(origin, (4000, 1)), directions, output=True)
        assert (hit["primID"] >= 0).all()
        assert hit["tfar"].min() > 0.05


@pytest.mark.parametrize(("name", "low", "high"), [("sibenik", 1, 1), ("conference", 1, 1), ("buddha", 0.3, 0.6)])
def test_view_is_filled_with_lit_and_shadowed_parts(name: str, low: float, high: float) -> None:
    size = 96
    moment = prepared(name).moment(0, size, size)
    directions = moment.directions(np.arange(size * size))
    hit = embree(name).run(np.tile(moment.eye, (size * size, 1)), directions, output=True)
    seen = hit["primID"] >= 0
    assert low <= seen.mean() <= high
    point = moment.eye + directions[seen] * hit["tfar"][seen, None]
    away = (point - moment.lights[0]).astype(np.float32)
    first = embree(name).run(np.tile(moment.lights[0], (len(away), 1)), away, output=True)["tfar"]
    lit = (first > 0.995).mean()
    assert 0.2 < lit < 0.95


@pytest.mark.parametrize("name", ["sibenik", "conference"])
def test_triangles_of_very_different_sizes(name: str) -> None:
    """What the rooms stand in for: a few triangles of many square metres, and very many tiny ones."""
    points, _ = prepared(name).points(0)
    area = areas(shapes.Mesh(points.astype(np.float64), prepared(name).faces))
    assert area.max() > 40.0
    assert np.median(area) < 0.02
    assert (area > 1.0).sum() > 50


def test_buddha_triangles_are_nearly_of_one_size() -> None:
    points, _ = prepared("buddha").points(0)
    area = areas(shapes.Mesh(points.astype(np.float64), prepared("buddha").faces))
    low, high = np.percentile(area, [5, 95])
    assert high < 12 * low


CLOSED = {
    "box": shapes.box((0, 0, 0), (1, 2, 3)),
    "cylinder": shapes.cylinder(1.0, 2.0, 48, rings=3),
    "frustum": shapes.cylinder(1.0, 2.0, 12, top=0.2),
    "sphere": shapes.sphere(1.0, 64),
    "cushion": shapes.cushion((1, 2, 3), 32),
    "tube": shapes.tube([[0, 0, 0], [0, 1, 0], [0.5, 2, 0]], [0.1, 0.2, 0.1], 8),
    "ring": shapes.tube([[1, 0, 0], [0, 0, 1], [-1, 0, 0], [0, 0, -1]], 0.1, 8, closed=True),
}


def volume_of(mesh: shapes.Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("shape", sorted(CLOSED))
def test_shapes_are_closed_and_face_outwards(shape: str) -> None:
    mesh = CLOSED[shape]
    assert mesh.vertices.dtype == np.float64
    assert mesh.faces.dtype == np.int32
    assert edge_faults(mesh.faces) == 0
    assert volume_of(mesh) > 0
    assert areas(mesh).min() > 0


def test_volumes_of_known_bodies() -> None:
    assert volume_of(CLOSED["box"]) == pytest.approx(6.0)
    assert volume_of(CLOSED["cylinder"]) == pytest.approx(2 * np.pi, rel=0.01)
    assert volume_of(CLOSED["sphere"]) == pytest.approx(4 / 3 * np.pi, rel=0.01)


def test_transform_order_and_mirror() -> None:
    moved = shapes.transform(CLOSED["box"], scale=(-1, 1, 2), rotate=((0, 1, 0), 90.0), translate=(10, 0, 0))
    # (1, 2, 3) is scaled to (-1, 2, 6), turned to (6, 2, 1), and moved.
    assert np.isclose(moved.vertices, (16, 2, 1)).all(axis=1).any()
    assert volume_of(moved) == pytest.approx(12.0)


def test_edge_faults_sees_a_hole_and_a_turned_triangle() -> None:
    faces = CLOSED["box"].faces
    assert edge_faults(faces[1:]) == 3
    assert edge_faults(np.concatenate([faces[:1, ::-1], faces[1:]])) > 0


def test_noise_depends_on_its_seed_only() -> None:
    points = np.random.default_rng(0).uniform(-40, 40, (500, 3))
    assert np.array_equal(shapes.noise(points, 3, 4), shapes.noise(points.copy(), 3, 4))
    assert not np.array_equal(shapes.noise(points, 3, 4), shapes.noise(points, 4, 4))
    assert np.abs(shapes.noise(points, 3, 4)).max() <= 1.0
    near = np.abs(shapes.noise(points, 3) - shapes.noise(points + 1e-6, 3)).max()
    assert near < 1e-5


def ball(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points, axis=1) - np.float32(0.5)


def test_surface_of_a_signed_distance() -> None:
    spacing = 0.02
    mesh = implicit.polygonise(ball, (-0.6, -0.6, -0.6), (0.6, 0.6, 0.6), spacing)
    assert edge_faults(mesh.faces) == 0
    assert volume_of(mesh) == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=0.01)
    assert np.abs(ball(mesh.vertices)).max() < 0.2 * spacing


def test_surface_stays_closed_where_sheets_touch() -> None:
    """Noise as fine as the lattice: squares with the surface across all four sides are everywhere."""

    def sponge(points: np.ndarray) -> np.ndarray:
        return np.maximum(ball(points), 0.05 * shapes.noise(points * 40.0, 7)).astype(np.float32)

    mesh = implicit.polygonise(sponge, (-0.6, -0.6, -0.6), (0.6, 0.6, 0.6), 0.02, slack=3.0)
    assert len(mesh.faces) > 20_000
    assert edge_faults(mesh.faces) == 0
