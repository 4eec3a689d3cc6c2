"""Scenes by name: stand-ins, originals in their place, and any file with a view chosen from its bounds."""

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.mesh_files import shape_of
from helpers.real_scenes import REAL, needs_real
from shadowbench.harness.errors import UserError
from shadowbench.harness.hardcases import shapes
from shadowbench.harness.judge.receivers import facing
from shadowbench.harness.judge.reference import embree_reference
from shadowbench.harness.scene import catalogue
from shadowbench.harness.scene.names import NAMES, TITLES
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers import usd
from shadowbench.harness.scene.readers.checks import Loaded
from shadowbench.harness.scene.scene import Scene
from shadowbench.harness.scene.shape import Shape
from shadowbench.harness.scene.views import FOV, view

needs_usd = pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")


@pytest.fixture(autouse=True)
def no_folder_from_outside(monkeypatch):
    monkeypatch.delenv(catalogue.FOLDER_VARIABLE, raising=False)


def put(folder: Path, name: str, points=files.QUAD, content=None) -> Path:
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    if content is None:
        content = files.obj(points) if path.suffix == ".obj" else files.ply_binary(points)
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("name", NAMES)
def test_a_stand_in_says_that_it_is_one(name):
    """Without building its geometry."""
    scene = catalogue.resolve(name)
    assert (scene.name, scene.title) == (name, f"{TITLES[name]} (stand-in)")
    assert "stand-in for the " in scene.stand_in
    assert "\n" not in scene.stand_in
    assert scene.source.kind == "procedural"
    assert scene.lights


@needs_usd
def test_the_bunny_of_the_warp_package_is_real():
    scene = catalogue.resolve("bunny")
    prepared = prepare(scene)
    assert (prepared.triangle_count, scene.stand_in, scene.source.kind) == (12200, None, "file")
    assert len(scene.source.sha256) == 64
    assert "bunny.usd" in scene.source.file
    assert everything_is_seen(scene)


def test_without_usd_core_the_bunny_says_what_to_install(monkeypatch):
    monkeypatch.setattr(usd, "available", lambda: False)
    with pytest.raises(UserError, match=r"^bunny: .*usd-core; \S*python\S* -m pip install usd-core$"):
        catalogue.resolve("bunny")


@pytest.mark.parametrize("given", ["argument", "environment"])
@pytest.mark.parametrize("name", ["sibenik.obj", "Sibenik.PLY", "sibenik/wave_1.ply", "sibenik_007.ply"])
def test_an_original_takes_its_stand_ins_place(tmp_path, monkeypatch, given, name):
    path = put(tmp_path, name)
    if given == "environment":
        monkeypatch.setenv(catalogue.FOLDER_VARIABLE, str(tmp_path))
    scene = catalogue.resolve("sibenik", tmp_path if given == "argument" else None)
    assert (scene.name, scene.title, scene.stand_in) == ("sibenik", "Sibenik", None)
    assert (scene.source.kind, scene.source.file) == ("file", path.name)
    assert scene.source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert prepare(scene).triangle_count == len(files.FACES)
    assert catalogue.resolve("cloth", tmp_path).stand_in


def test_the_argument_goes_before_the_environment_and_a_whole_file_before_numbered_frames(tmp_path, monkeypatch):
    for name in ("cloth_001.ply", "cloth_002.ply", "cloth.obj"):
        put(tmp_path / "a", name)
    (tmp_path / "b").mkdir()
    monkeypatch.setenv(catalogue.FOLDER_VARIABLE, str(tmp_path / "a"))
    assert catalogue.resolve("cloth").source.file == "cloth.obj"
    assert catalogue.resolve("cloth", tmp_path / "b").stand_in


def test_numbered_frames_are_an_animation(tmp_path):
    contents = [put(tmp_path, f"cloth_{k:03d}.ply", files.QUAD + k).read_bytes() for k in (92, 93)]
    put(tmp_path, "cloth_notes.ply", content=b"not a frame")
    scene = catalogue.resolve("cloth", tmp_path)
    prepared = prepare(scene)
    assert (prepared.frame_count, scene.source.file) == (2, "cloth_092.ply..cloth_093.ply (2 files)")
    assert scene.source.sha256 == hashlib.sha256(b"".join(contents)).hexdigest()
    assert (prepared.points(1)[0] - prepared.points(0)[0] == 1).all()


def test_a_broken_original_is_not_replaced_by_its_stand_in(tmp_path):
    put(tmp_path, "cloth.ply", content=files.ply_binary()[:-5])
    with pytest.raises(UserError, match="truncated"):
        catalogue.resolve("cloth", tmp_path)


def test_folders_that_are_none(tmp_path, monkeypatch):
    with pytest.raises(UserError, match="give an existing folder"):
        catalogue.resolve("cloth", tmp_path / "absent")
    monkeypatch.setenv(catalogue.FOLDER_VARIABLE, str(tmp_path / "absent"))
    with pytest.raises(UserError, match="correct or unset SHADOWBENCH_SCENES"):
        catalogue.resolve("cloth")


@pytest.mark.parametrize(("name", "line"), [
    ("sibenk", "no scene or file 'sibenk'; did you mean sibenik?"),
    ("zzz", "known: balls-300k, buddha, bunny, bunny_dragon, cloth, conference, fairy, sibenik"),
    ("absent.ply", "absent.ply: no such file"),
    ("some/where", "some/where: no such file"),
    ("x" * 5000, "no scene or file"),
    ("", "the name of the scene is empty"),
    ("balls-900000000000m", "balls-900000000000m: too many triangles; name balls-134217728 at most"),
    (f"balls-{'9' * 5000}", "no scene or file"),
])  # fmt: skip
def test_unknown_names(name, line):
    with pytest.raises(UserError) as caught:
        catalogue.resolve(name)
    assert line in str(caught.value)


@pytest.mark.parametrize(
    ("lost", "note"),
    [
        ([], ""),
        ([(0, 3, np.nan)], "frame 0: 1 triangle with a corner that is NaN or infinite, which no ray hits"),
        ([(1, 0, np.inf)], "frame 1: 2 triangles with a corner that is NaN or infinite, which no ray hits"),
        ([(1, 4, np.nan)], ""),
    ],
    ids=["finite", "first frame", "second frame", "of no triangle"],
)
def test_corners_that_are_no_numbers_are_noted(tmp_path, lost, note):
    frames = np.array([[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (9, 9, 9)]] * 2, float)
    for frame, corner, value in lost:
        frames[frame, corner, 1] = value
    path = tmp_path / "quad.npz"
    np.savez(path, V=frames, F=[(0, 1, 2), (0, 2, 3)])
    assert catalogue.resolve(path).source.left_out == note


def test_one_triangle_one_point_and_nan_can_be_looked_at(tmp_path):
    points = np.vstack([files.QUAD, [[np.nan] * 3]])
    for k, polygons in enumerate(([(0, 1, 2)], [(0, 0, 0)], [(5, 5, 5)], [(0, 1, 2), (0, 1, 5)], [(0, 1, 1)])):
        path = put(tmp_path, f"m{k}.ply", content=files.ply_binary(points, polygons))
        moment = prepare(catalogue.resolve(path)).moment(0, 4, 4)
        assert np.isfinite(moment.column).all()
        assert np.isfinite(moment.lights).all()


def pixels_of(scene: Scene, size: int = 64) -> np.ndarray:
    """Where the vertices that faces use fall in a square image, in pixels [n, 2]; behind the eye is NaN."""
    prepared = prepare(scene)
    result = []
    for frame in range(prepared.frame_count):
        moment = prepared.moment(frame, size, size)
        used = moment.points[np.unique(prepared.faces)].astype(np.float64)
        x, y, z = ((used[np.isfinite(used).all(axis=1)] - moment.eye) @ moment.axes.T).T
        z = np.where(z > 0, z, np.nan)
        place = np.stack([x / z / moment.tangents[0], -y / z / moment.tangents[1]], axis=1)
        result.append((place + 1) / 2 * size)
    return np.concatenate(result)


def everything_is_seen(scene: Scene) -> bool:
    """The whole thing lies in the image and fills it along one axis."""
    pixels = pixels_of(scene)
    inside = np.isfinite(pixels).all() and pixels.min() >= 0 and pixels.max() <= 64
    return bool(inside and np.ptp(pixels, axis=0).max() > 0.9 * 64)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("shift", [0.0, 1e4])
@pytest.mark.parametrize("seed", range(4))
def test_the_view_holds_everything_and_fills_the_image(scale, shift, seed):
    rng = np.random.default_rng(seed)
    points = (rng.normal(size=(200, 3)) * rng.uniform(0.1, 3, 3) + shift) * scale
    faces = np.arange(198, dtype=np.int32)[:, None] + np.arange(3, dtype=np.int32)
    loaded = Loaded(faces, (points,), ())
    camera, lights = view(shape_of(loaded))
    assert everything_is_seen(Scene("t", "T", loaded.geometry, camera, lights))


def test_the_view_holds_every_frame_of_an_animation_and_no_vertex_that_no_face_uses():
    faces = np.array(files.FACES, np.int32)
    moving = Loaded(faces, tuple(files.QUAD.astype(np.float64) + [k, 0, 0] for k in range(5)), ())
    assert everything_is_seen(Scene("t", "T", moving.geometry, *view(shape_of(moving))))
    alone, with_more = (Loaded(faces, (np.vstack([files.QUAD, *more]),), ()) for more in ([], [[[1e9, 0, 0]]]))
    assert view(shape_of(alone)) == view(shape_of(with_more))


def box(low, high, without=()) -> Loaded:
    """A box of 12 triangles less the sides (axis, end) in ``without``."""
    points, faces = shapes.box(low, high)
    kept = [faces[2 * side : 2 * side + 2] for side in range(6) if divmod(side, 2) not in without]
    return Loaded(np.concatenate(kept).astype(np.int32), (points,), ())


@pytest.mark.parametrize(("axis", "end"), [(0, 0), (0, 1), (2, 0), (2, 1)])
def test_a_box_is_looked_into_through_its_open_side(axis, end):
    loaded = box([-1, 0, -1], [1, 2, 1.5], without=[(axis, end)])
    camera, (light,) = view(shape_of(loaded))
    forward = np.array(camera.target) - camera.eye
    assert np.argmax(np.abs(forward)) == axis
    assert forward[axis] * (1 if end else -1) < 0
    assert all(low < p < high for low, p, high in zip([-1, 0, -1], light.position, [1, 2, 1.5], strict=True))


@pytest.mark.parametrize("up", [1, 2])
def test_an_original_building_is_seen_from_within(tmp_path, up):
    """A room of 8 x 6 x 3 with its floor at 0, written with y and with z as up."""
    high = [8.0, 3.0, 6.0] if up == 1 else [8.0, 6.0, 3.0]
    room = box([0, 0, 0], high)
    put(tmp_path, "conference.ply", content=files.ply_binary(room.frames[0], room.faces.tolist()))
    scene = catalogue.resolve("conference", tmp_path)
    assert np.argmax(scene.camera.up) == up
    for place in (scene.camera.eye, scene.lights[0].position):
        assert all(0 < p < h for p, h in zip(place, high, strict=True))
    moment = prepare(scene).moment(0, 8, 8)
    assert abs(moment.axes[2][up]) < 1e-6


def test_a_closed_box_is_seen_from_outside():
    camera, (light,) = view(shape_of(box([-1, 0, -1], [1, 2, 1])))
    assert camera.fov == FOV
    assert min(camera.eye[2], light.position[1]) > 2


@pytest.mark.parametrize(
    ("low", "high", "up"),
    [([-1, 0, -1], [1, 2, 1], 1), ([-1, -1, 0], [1, 1, 2], 2), ([0, -1, -1], [2, 1, 1], 0), ([-1, -1, -1], [1, 1, 1], 1),
     ([-9, -9, 2], [9, 7, 3], 2), ([-9, 2, -9], [9, 3, 7], 1), ([0, 0, 0], [2, 2, 2], 1)],
)  # fmt: skip
def test_which_way_is_up_is_guessed_from_the_bounds(low, high, up):
    loaded = box(low, high)
    assert shape_of(loaded).up == up
    for faces in (loaded.faces, loaded.faces[:, ::-1]):  # of a solid, and of a room
        assert np.argmax(view(shape_of(Loaded(faces, loaded.frames, ())))[0].up) == up
    declared = Loaded(loaded.faces, loaded.frames, (), up=(0.0, 0.0, 1.0))
    assert shape_of(declared).up == 2


@pytest.mark.parametrize("up", [0, 1, 2])
def test_front_views_are_right_handed(up):
    right, upward, front = Shape(files.QUAD.astype(float), np.zeros((3, 2)), up, np.zeros((0, 3, 3))).frame()
    assert np.allclose(np.cross(right, upward), front)
    assert upward[up] == 1


def lit_and_shadowed(scene: Scene, size: int = 48) -> tuple[float, float, float]:
    """Shares of the pixels that see the scene, of those that are lit, and of those in another surface's shadow."""
    prepared = prepare(scene)
    moment = prepared.moment(0, size, size)
    seen = embree_reference(prepared, moment)
    hit = seen.triangle >= 0
    toward = facing(moment, moment.points[prepared.faces[seen.triangle[hit]]], 0)
    dark = seen.shadowed[0][hit] != 0
    return float(hit.mean()), float((toward & ~dark).mean()), float((toward & dark).mean())


@needs_real
@pytest.mark.parametrize(("name", "seen"), [
    ("sibenik", 0.99), ("cloth", 0.2), ("cornell_box.ply", 0.1), ("embree_tree.ply", 0.1), ("teapot.ply", 0.1),
    ("samba_seq.npz", 0.1), ("dragon_100k.ply", 0.1),
])  # fmt: skip
def test_the_views_of_real_files_show_light_and_shadow(name, seen):
    scene = catalogue.resolve(REAL / name if "." in name else name, REAL)
    assert scene.stand_in is None
    hit, lit, dark = lit_and_shadowed(scene)
    assert hit > seen
    assert lit > 0.3
    assert dark > 0.01
    assert "." not in name or everything_is_seen(scene)


@needs_real
def test_the_real_cloth_has_two_frames(tmp_path):
    for number in (92, 93):
        shutil.copy(REAL / f"cloth_{number:03d}.ply", tmp_path)
    prepared = prepare(catalogue.resolve("cloth", tmp_path))
    assert (prepared.frame_count, prepared.triangle_count) == (2, 92230)
    assert prepared.sha256(0) != prepared.sha256(1)
