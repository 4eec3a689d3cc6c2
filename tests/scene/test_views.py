"""The automatic view shows something of every mesh: strays, markers and planes seen edge-on do not empty the picture."""

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.mesh_files import written
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare

SIZE = 32
STRAY = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.5\nv 1e9 1e9 1e9\nf 1 2 3\nf 2 4 3\n"
QUAD = "v 498213 4612087 412\nv 498223 4612087 412\nv 498223 4612097 413\nv 498213 4612097 413\nf 1 2 3\nf 1 3 4\n"
MARKER = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n"


def hits(path) -> float:
    """The share of the pixels of the automatic view that hit something."""
    prepared = prepare(resolve(path))
    triangles = Judge.of(prepared, prepared.moment(0, SIZE, SIZE)).checked_reference.answers["triangle"]
    return float((triangles >= 0).mean())


def eye(path) -> np.ndarray:
    return np.array(resolve(path).camera.eye)


@pytest.mark.parametrize(
    "more",
    ["", "f 5 5 5\n", "f 1 1 5\n", "v 2e9 2e9 2e9\nv 3e9 3e9 3e9\nf 5 6 7\n", "v nan 0 0\nf 1 2 6\n"],
    ids=["unused vertex", "point", "edge", "line", "nan"],
)
def test_what_has_no_area_does_not_set_the_camera(tmp_path, more):
    plain = written(tmp_path, "plain.obj", STRAY.replace("v 1e9 1e9 1e9\n", ""))
    assert hits(plain) > 0.1
    assert np.allclose(eye(written(tmp_path, "stray.obj", STRAY + more)), eye(plain))


@pytest.mark.parametrize("marker", ["first", "last"])
def test_a_far_marker_leaves_a_picture(tmp_path, marker):
    text = MARKER + QUAD.replace("f 1 2 3\nf 1 3 4", "f 4 5 6\nf 4 6 7") if marker == "first" else QUAD + MARKER
    path = written(tmp_path, "far.obj", text)
    assert hits(path) > 0.1
    assert resolve(path).source.left_out == "1 triangle too far from the others for the automatic view"


def test_a_far_marker_beside_a_mesh_of_many_small_triangles(tmp_path):
    ball = trimesh.creation.icosphere(3)
    far = trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation((0, 2e5, 0))
    path = tmp_path / "far.ply"
    trimesh.util.concatenate([far, ball]).export(path)
    assert hits(path) > 0.1


def test_scattered_parts_are_all_shown(tmp_path):
    """Balls a hundred radii apart are the scene, not strays of it."""
    balls = [
        trimesh.creation.icosphere(1).apply_translation((100.0 * i, 0, 70.0 * j)) for i in range(3) for j in range(3)
    ]
    path = tmp_path / "balls.ply"
    trimesh.util.concatenate(balls).export(path)
    prepared = prepare(resolve(path))
    camera = np.array(resolve(path).camera.eye)
    assert np.linalg.norm(camera - prepared.middle - prepared.centre) > 200.0


@pytest.mark.parametrize("turn", range(0, 180, 15))
def test_a_plane_is_never_seen_edge_on(tmp_path, turn):
    """An upright plane turned about the upward axis; the automatic azimuth is 35 degrees."""
    angle = np.radians(turn)
    along = np.array([np.cos(angle), 0, np.sin(angle)])
    points = [-along, along, along + (0, 2, 0), -along + (0, 2, 0)]
    assert hits(written(tmp_path, "plane.obj", files.obj(points, [(0, 1, 2, 3)]))) > 0.02


@pytest.mark.parametrize("seed", range(4))
def test_a_plane_that_holds_the_usual_view_direction_is_seen(tmp_path, seed):
    """Tilted planes: spanned by the direction of the automatic view of a cube, and by any other direction."""
    cube = tmp_path / "cube.obj"
    trimesh.creation.box((2, 2, 2)).export(cube)
    toward = eye(cube) / np.linalg.norm(eye(cube))
    across = np.cross(toward, np.random.default_rng(seed).normal(size=3))
    across /= np.linalg.norm(across)
    points = [toward + across, toward - across, -toward - across, -toward + across]
    assert hits(written(tmp_path, "plane.obj", files.obj(points, [(0, 1, 2, 3)]))) > 0.02


def test_a_marker_far_from_a_moving_mesh_leaves_a_picture(tmp_path):
    for number in range(3):
        points = np.concatenate([files.QUAD + number, [[1e6, 0, 0], [1e6, 1, 0], [1e6, 0, 1]]])
        written(tmp_path, f"wave_{number}.ply", files.ply_binary(points, [*files.FACES, (5, 6, 7)]))
    assert hits(tmp_path) > 0.05
