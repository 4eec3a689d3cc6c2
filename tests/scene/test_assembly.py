"""Several meshes as one scene; files in place of a name that cannot be taken, and of sizes that cannot be traced."""

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.gltf_samples import square
from helpers.mesh_files import written
from shadowbench.harness.commands.answering import answer
from shadowbench.harness.errors import UserError
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.scene import catalogue
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.declaration import matrix_of
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers.checks import Wanted

ROOM = np.array([[0, 0, 0], [8, 0, 0], [8, 0, 8], [0, 0, 8]], dtype=np.float32)
FLOOR = [(0, 2, 1), (0, 3, 2)]


@pytest.fixture
def folder(tmp_path):
    """A floor, a mesh at rest, and five frames that rise; a folder for declarations."""
    written(tmp_path, "room.obj", files.obj(ROOM, FLOOR))
    written(tmp_path, "quad.ply", files.ply_binary())
    (tmp_path / "wave").mkdir()
    for number in range(5):
        written(tmp_path / "wave", f"{number:02}.ply", files.ply_binary(files.QUAD + (0, number, 0)))
    return tmp_path


def declared(folder, *meshes: str, more: str = "", name: str = "scene.toml"):
    text = more + "\n" + "\n".join(f"[[meshes]]\n{mesh}" for mesh in meshes)
    return written(folder, name, text.encode())


def test_meshes_stand_in_their_places_in_order(folder):
    path = declared(
        folder,
        'file = "room.obj"',
        'file = "quad.ply"\ntransform = {scale = 2, rotate = [0, 90, 0], translate = [1, 2, 3]}',
        'file = "quad.ply"\ntransform = {matrix = [[0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}',
    )
    scene = resolve(path)
    geometry = scene.geometry()
    x, y, z = files.QUAD.astype(float).T
    expected = np.concatenate([ROOM, np.c_[2 * z + 1, 2 * y + 2, -2 * x + 3], np.c_[-y + 5, x, z]])
    assert np.array_equal(geometry.positions(0), expected)
    own = [np.array(FLOOR), np.array(files.FACES) + 4, np.array(files.FACES) + 9]
    assert geometry.faces.tolist() == np.concatenate(own).tolist()
    assert (scene.name, scene.title) == ("scene", "room.obj + quad.ply + quad.ply (scene.toml)")
    assert scene.source.file == "scene.toml: room.obj + quad.ply + quad.ply"
    assert np.isfinite(prepare(scene).moment(0, 4, 4).eye).all()


def test_a_mirrored_mesh_is_turned_round(folder):
    """So that the front of a closed mesh stays its outside."""
    for transform in ("scale = [1, -1, 1]", "scale = -2", "matrix = [[0,1,0,0],[1,0,0,0],[0,0,1,0],[0,0,0,1]]"):
        mesh = resolve(declared(folder, f'file = "quad.ply"\ntransform = {{{transform}}}')).geometry()
        assert mesh.faces.tolist() == [[a, c, b] for a, b, c in files.FACES]
    turned = resolve(declared(folder, 'file = "quad.ply"\ntransform = {scale = [-1, -1, 1]}')).geometry()
    assert turned.faces.tolist() == [list(face) for face in files.FACES]


def test_meshes_of_several_rates_are_named(folder):
    for name, last in (("fast", 0.5), ("slow", 1.0)):
        moving = square()
        moving.animate(translation=(0, np.linspace(0, last, 31), np.zeros((31, 3)) + np.arange(31)[:, None]))
        moving.write(folder, f"{name}.glb")
    scene = resolve(declared(folder, 'file = "fast.glb"', 'file = "slow.glb"'))
    assert scene.rate == 60.0
    assert scene.source.left_out.endswith("rates of 60 and 30 frames a second read frame by frame")


@pytest.mark.parametrize("pattern", ["wave", "wave/%02d.ply", "wave/*.ply"])
def test_what_rests_and_what_moves_stand_together(folder, pattern):
    scene = resolve(declared(folder, 'file = "room.obj"', f'file = "{pattern}"', 'file = "quad.ply"'))
    geometry = scene.geometry()
    assert (geometry.frame_count, geometry.motion.vertices) == (5, (4, 9))
    for k in range(5):
        points = geometry.positions(k)
        assert np.array_equal(points[:4], ROOM)
        assert np.array_equal(points[4:9], files.QUAD + (0, k, 0))
        assert np.array_equal(points[9:], files.QUAD)
    few = resolve(declared(folder, 'file = "room.obj"', f'file = "{pattern}"'), None, Wanted((1, None, 2)))
    assert [few.geometry().positions(k)[4, 1] for k in range(few.geometry().frame_count)] == [1, 3]
    assert few.source.asked == {"frames": "1::2"}


def test_bodies_of_meshes_are_told_apart(folder):
    """What rests is one body; balls that turn alike are one, and those of another mesh another."""
    meshes = [f'file = "balls-1k-moving{share}"' for share in (40, 80)]
    scene = resolve(declared(folder, 'file = "room.obj"', *meshes, 'file = "quad.ply"'))
    motion, parts = scene.geometry().motion, [resolve(f"balls-1k-moving{share}").geometry() for share in (40, 80)]
    own = [len(np.unique(part.motion.bodies)) for part in parts]
    assert (motion.kind, len(np.unique(motion.bodies))) == ("rigid", 1 + sum(own))
    resting = len(resolve(str(folder / "room.obj")).geometry().faces)
    assert set(motion.bodies[:resting]) == set(motion.bodies[-2:]) == {0}
    first = motion.bodies[resting : resting + len(parts[0].faces)]
    assert np.array_equal(np.unique(first, return_inverse=True)[1].ravel(), parts[0].motion.bodies)
    unknown = resolve(declared(folder, 'file = "wave"', meshes[0]))
    assert unknown.geometry().motion is None


def test_the_shorter_of_two_stays_as_in_its_last_frame(folder):
    scene = resolve(declared(folder, 'file = "wave"\nframes = "0:4:4"', 'file = "wave"\nframes = "1:3"'))
    geometry = scene.geometry()
    assert [geometry.positions(k)[[0, 5], 1].tolist() for k in range(3)] == [[0, 1], [4, 2], [4, 3]]
    assert geometry.motion is None


def test_a_scene_of_the_catalogue_and_a_declaration_are_meshes_too(folder):
    written(folder, "inner.toml", b'mesh = "quad.ply"\n[camera]\neye = [0, 0, 9]\n')
    scene = resolve(declared(folder, 'file = "cloth"', 'file = "inner.toml"'))
    assert scene.geometry().frame_count > 1
    assert scene.stand_in
    loop = declared(folder, 'file = "scene.toml"')
    with pytest.raises(UserError, match="refers back to this file"):
        resolve(loop)


def test_every_mesh_and_every_frame_makes_another_source(folder):
    path = declared(folder, 'file = "room.obj"', 'file = "wave"', 'file = "quad.ply"')
    hashes = [resolve(path).source.sha256]
    for name in ("room.obj", "quad.ply", *(f"wave/{number:02}.ply" for number in range(5))):
        file = folder / name
        old, new = (b"f 1 3", b"f  1 3") if name == "room.obj" else (b"by hand", b"by mine")
        assert old in file.read_bytes()
        file.write_bytes(file.read_bytes().replace(old, new))
        hashes.append(resolve(path).source.sha256)
    declared(folder, 'file = "room.obj"', 'file = "wave"', 'file = "quad.ply"', more="# another")
    hashes.append(resolve(path).source.sha256)
    assert len(set(hashes)) == 9


def test_what_was_left_out_of_each_is_named(folder):
    written(folder, "red.obj", b"usemtl red\n" + files.obj().replace(b"\nf", b"\nusemtl red\nf", 1))
    (folder / "wave" / "02.ply").unlink()
    noted = resolve(declared(folder, 'file = "red.obj"', 'file = "wave"')).source.left_out
    assert noted == (
        "red.obj: materials left out; 00.ply..04.ply (4 files): the numbers of its files are not evenly spaced: "
        "1 is followed by 3"
    )


@pytest.mark.parametrize(("mesh", "words"), [
    ("", r"meshes\[0\]: add its file"),
    ("file = 3", r"meshes\[0\]: add its file"),
    ('file = "absent.ply"', r"meshes\[0\]: absent\.ply: no such file"),
    ('file = "wave"\nframes = "3"', r"meshes\[0\]\.frames: '3': write A:B:STEP"),
    ('name = "x"', r"meshes\[0\]: unknown key 'name'"),
    ('frames = "0:3"', r"quad\.ply: has one frame, 0"),
    ("transform = 2", r"transform must be a table"),
    ("transform = {turn = 2}", r"transform: unknown key 'turn'"),
    ('transform = {scale = "2"}', r"transform\.scale must be a number"),
    ("transform = {rotate = 90}", r"transform\.rotate must be three numbers"),
    ("transform = {scale = 1e37, translate = [1e37, 0, 0]}", "too large for float32 rays"),
    ("transform = {matrix = [[1, 0, 0, 0]]}", "four rows of four numbers"),
    ("transform = {scale = 1, matrix = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}", "give either a matrix"),
    ("transform = {matrix = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,1,1]]}", "its last row must be 0, 0, 0, 1"),
])  # fmt: skip
def test_mistakes_name_the_mesh(folder, mesh, words):
    mesh = f'file = "quad.ply"\n{mesh}' if mesh and "file" not in mesh else mesh
    with pytest.raises(UserError, match=words) as caught:
        resolve(declared(folder, mesh))
    assert "scene.toml" in str(caught.value)


def test_one_mesh_or_several(folder):
    with pytest.raises(UserError, match=r"give either mesh or \[\[meshes\]\]"):
        resolve(declared(folder, 'file = "quad.ply"', more='mesh = "quad.ply"'))
    with pytest.raises(UserError, match=r"write \[\[meshes\]\] before each of the meshes"):
        resolve(written(folder, "a.toml", b'meshes = "quad.ply"'))
    with pytest.raises(UserError, match="meshes: give at least one"):
        resolve(written(folder, "a.toml", b"meshes = []"))
    holed = written(folder, "holed.toml", b'mesh = "quad.ply"\n[alpha]\nevery = 2\n')
    with pytest.raises(UserError, match="has holes or mirrors of its own"):
        resolve(declared(folder, f'file = "{holed.name}"'))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("degrees", [90, 180, -90, 270, 360, 30])
def test_rotations_are_counterclockwise_and_exact_at_right_angles(tmp_path, axis, degrees):
    rotate = [0.0, 0.0, 0.0]
    rotate[axis] = degrees
    matrix = matrix_of(tmp_path, "", {"rotate": rotate})[:3, :3]
    one, other = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    angle = np.radians(degrees)
    assert np.allclose(matrix @ one, np.cos(angle) * one + np.sin(angle) * other)
    assert np.allclose(matrix @ matrix.T, np.eye(3))
    if degrees % 90 == 0:
        assert set(np.abs(matrix).ravel()) == {0.0, 1.0}


def put(path):
    path.write_bytes(files.obj(files.QUAD) if path.suffix == ".obj" else files.ply_binary(files.QUAD))


@pytest.mark.parametrize("make", [lambda path: path.mkdir(), lambda path: path.symlink_to(path)])
def test_what_bears_an_originals_name_and_is_no_file_is_reported(tmp_path, capsys, make):
    make(tmp_path / "sibenik.ply")
    assert catalogue.resolve("sibenik", tmp_path).stand_in
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"warning: {tmp_path / 'sibenik.ply'}: a " in said
    assert "using the stand-in" in said


def test_of_two_originals_it_is_said_which_is_taken(tmp_path, capsys):
    put(tmp_path / "sibenik.obj")
    put(tmp_path / "sibenik.ply")
    assert catalogue.resolve("sibenik", tmp_path).source.file == "sibenik.ply"
    said = capsys.readouterr().err
    assert "sibenik.ply and sibenik.obj are all originals of sibenik; using sibenik.ply" in said


@pytest.mark.parametrize(
    ("size", "said"),
    [(1e-44, "too small for float32"), (9e-39, "too small"), (2e37, "too large"), (1e38, "too large for float32 rays"),
     (1e39, "too large"), (1e300, "too large"), (1.1e-38, ""), (1e37, ""), (np.inf, "")],
)  # fmt: skip
def test_sizes_that_float32_cannot_trace_are_refused(tmp_path, size, said):
    """A corner that is infinite in the file is never hit, and so no error."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    points[points > 0] *= size
    path = tmp_path / "sized.npz"
    np.savez(path, V=points, F=np.array([[0, 1, 2], [0, 1, 3]]))
    if said:
        with pytest.raises(UserError, match=said) as refused:
            catalogue.resolve(path)
        assert str(refused.value).endswith("scale it to coordinates between 1e-38 and 1e+37")
    else:
        catalogue.resolve(path)


@pytest.mark.parametrize("size", [1e-38, 1e37])
@pytest.mark.parametrize("method", ["perspective_spherical", "ray_grids", "uniform_grid"])
def test_at_the_ends_of_that_range_answers_are_right(tmp_path, size, method):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]) * size
    path = tmp_path / "sized.npz"
    np.savez(path, V=points, F=np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3], [1, 2, 4]]))
    prepared = prepare(catalogue.resolve(path))
    moment = prepared.moment(0, 16, 16)
    found = answer(method, {}, prepared, moment, "cpu")
    assert found.answers is not None, found.reason
    assert (found.answers["triangle"] >= 0).sum() > 20
    assert score_answers(Judge.of(prepared, moment, device="cpu"), found.answers).score.true_errors == 0
