"""The automatic view shows something of every mesh: rooms from within, solids from outside, planes not edge-on."""

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.mesh_files import shape_of, written
from shadowbench.harness.commands.options import view_of
from shadowbench.harness.errors import UserError
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.light_paths import Orbit
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers.checks import Loaded
from shadowbench.harness.scene.scene import Camera, Geometry, Light, Scene
from shadowbench.harness.scene.views import WITHIN_FOV, view

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


ROOM, THICK = (4.0, 2.6, 3.0), (4.3, 2.75, 3.3)

Z_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def block(extents, at) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(extents)
    mesh.apply_translation(at)
    return mesh


def room() -> trimesh.Trimesh:
    """Walls, floor and ceiling of 4 x 2.6 x 3, which face inwards."""
    mesh = block(ROOM, (0, 1.3, 0))
    mesh.invert()
    return mesh


def furniture() -> list[trimesh.Trimesh]:
    """A row of cupboards below and above, a tall one, and a table."""
    legs = [block((0.05, 0.75, 0.05), (0.6 + x, 0.375, 0.5 + z)) for x in (-0.6, 0.6) for z in (-0.35, 0.35)]
    return [
        block((4, 0.9, 0.6), (0, 0.45, -1.2)), block((3, 0.7, 0.35), (0.3, 1.9, -1.3)),
        block((0.6, 2, 0.6), (-1.7, 1, 0.5)), block((1.4, 0.05, 0.8), (0.6, 0.77, 0.5)), *legs,
    ]  # fmt: skip


def turned(bounds: np.ndarray, z_up: bool) -> np.ndarray:
    """Lowest and highest corner of a box after y became z."""
    return np.sort(bounds @ Z_UP, axis=0) if z_up else bounds


def loaded(*parts: trimesh.Trimesh, z_up: bool = False, shuffled: bool = False) -> Loaded:
    mesh = trimesh.util.concatenate(list(parts))
    points, faces = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32)
    if z_up:
        points = points @ Z_UP
    if shuffled:  # every other triangle the other way round
        faces[::2] = faces[::2, ::-1]
    return Loaded(faces, (points,), (), up=(0.0, 0.0, 1.0) if z_up else (0.0, 1.0, 0.0))


def is_within(made: Loaded) -> bool:
    """Whether eye and light lie in the box of the mesh."""
    camera, (light,) = view(shape_of(made))
    low, high = made.frames[0].min(axis=0), made.frames[0].max(axis=0)
    places = np.array([camera.eye, light.position])
    return bool((places > low).all() and (places < high).all())


@pytest.mark.parametrize("z_up", [False, True])
@pytest.mark.parametrize("shuffled", [False, True])
@pytest.mark.parametrize("thick", [False, True])
def test_a_furnished_room_is_looked_at_from_within(z_up, shuffled, thick):
    outer = [block(THICK, (0, THICK[1] / 2 - 0.01, 0))] if thick else []
    camera, (light,) = view(shape_of(loaded(room(), *outer, *furniture(), z_up=z_up, shuffled=shuffled)))
    walls = turned(np.array([np.negative(ROOM) / 2, np.divide(ROOM, 2)]) + (0, ROOM[1] / 2, 0), z_up)
    for place in (camera.eye, light.position):
        assert ((walls[0] < place) & (place < walls[1])).all()
    assert (camera.fov, np.argmax(camera.up)) == (WITHIN_FOV, (2 if z_up else 1))
    for piece in furniture():
        corners = turned(np.array(piece.bounds), z_up)
        for place in (camera.eye, light.position):
            assert not ((corners[0] <= place) & (place <= corners[1])).all(), "inside a piece of furniture"


def test_an_empty_room_is_one_if_its_walls_face_inwards():
    assert is_within(loaded(room()))
    assert not is_within(loaded(block(ROOM, (0, 1.3, 0))))
    assert not is_within(loaded(block(ROOM, (0, 1.3, 0)), shuffled=True))


@pytest.mark.parametrize("inverted", [False, True])
def test_a_solid_is_looked_at_from_outside_whichever_way_it_is_oriented(inverted):
    for mesh in (trimesh.creation.icosphere(3), trimesh.creation.torus(1.0, 0.4), trimesh.creation.cone(1, 2)):
        if inverted:
            mesh.invert()
        assert not is_within(loaded(mesh))


def test_a_room_without_a_ceiling_is_looked_at_from_outside():
    open_above = room()
    open_above.update_faces(open_above.triangles_center[:, 1] < 2.59)
    assert not is_within(loaded(open_above, *furniture()))


SCENE = Scene(
    "t", "T", lambda: Geometry.static(np.eye(3), np.array([[0, 1, 2]])), Camera((0, 0, 5), (0, 0, 0)),
    (Light((1.0, 2.0, 3.0)),), light_path=Orbit((0.0, 0.0, 0.0)),
)  # fmt: skip


def test_camera_and_lights_of_the_command_line():
    assert view_of(None, None, None).applied(SCENE) == SCENE
    seen = view_of(("1,2,3", "-1,0,0.5"), 70.0, ["0,9,0", "1e3,0,-2"]).applied(SCENE)
    assert seen.camera == Camera((1.0, 2.0, 3.0), (-1.0, 0.0, 0.5), fov=70.0)
    assert [light.position for light in seen.lights] == [(0.0, 9.0, 0.0), (1000.0, 0.0, -2.0)]
    assert seen.light_path is None, "they do not move"
    assert view_of(None, 30.0, None).applied(SCENE).camera == Camera((0, 0, 5), (0, 0, 0), fov=30.0)


def test_a_camera_may_look_along_its_up():
    seen = view_of(("0,9,0", "0,0,0"), None, None).applied(SCENE)
    axes = prepare(seen).moment(0, 4, 4).axes
    assert np.allclose(axes[2], (0, -1, 0))
    assert np.isfinite(axes).all()


@pytest.mark.parametrize(("camera", "fov", "lights", "line"), [
    (("1,2", "0,0,0"), None, None, "--camera '1,2': give three numbers, as in --camera 0,1.7,4"),
    (("1,2,x", "0,0,0"), None, None, "give three numbers"),
    (("1,2,nan", "0,0,0"), None, None, "nan is not a number"),
    (("1,2,3", "1,2,3"), None, None, "eye and target must be finite and different"),
    (None, 0.0, None, "fov 0.0 degrees must be more than 0 and less than 180"),
    (None, 180.0, None, "fov 180.0 degrees must be more than 0 and less than 180"),
    (None, None, ["1;2;3"], "--light '1;2;3': give three numbers"),
    (None, None, ["1,2,1e39"], "outside the range of float32"),
])  # fmt: skip
def test_what_is_no_place_is_one_line(camera, fov, lights, line):
    with pytest.raises(UserError) as caught:
        view_of(camera, fov, lights).applied(SCENE)
    assert line in str(caught.value)
