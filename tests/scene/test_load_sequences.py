"""Meshes in several frames, of an NPZ file or numbered files; what is asked of a file: frames, rate, missing files."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers import threemf_files
from helpers.gltf_samples import square
from helpers.mesh_files import refused, written
from helpers.usd_stages import HEAD, mesh
from shadowbench.harness.commands.options import number_or_frames, view_of
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers import load as loading
from shadowbench.harness.scene.readers import usd
from shadowbench.harness.scene.readers.checks import Loaded, Wanted, frames_of
from shadowbench.harness.scene.readers.load import load, load_sequence, source
from shadowbench.harness.scene.scene import Camera, Scene


def usda(points=files.QUAD, faces=files.FACES) -> str:
    """A stage with one mesh."""
    corners = ", ".join(str(tuple(map(float, point))) for point in points)
    text = mesh("M", points=f"    point3f[] points = [{corners}]\n").replace("= [3]", f"= {[3] * len(faces)}")
    return HEAD + text.replace("[0, 1, 2]", str([i for face in faces for i in face]))


def glb(points=files.QUAD, faces=files.FACES) -> bytes:
    """A GLB with the mesh once."""
    return files.glb(points, faces, lambda head: head["scenes"][0].update(nodes=[0]))


WRITERS = {".ply": files.ply_binary, ".obj": files.obj, ".stl": files.stl_binary, ".glb": glb} | (
    {".usda": usda} if usd.available() else {}
)
"""A file of positions and faces in each format."""


def npz(path, **arrays) -> Path:
    with path.open("wb") as stream:
        np.savez(stream, **arrays)
    return path


@pytest.mark.parametrize(("arrays", "word"), [
    ({"V": files.QUAD[None]}, "no array 'F'"),
    ({"F": np.array(files.FACES)}, "no array 'V'"),
    ({"V": files.QUAD[None], "F": np.array([[0, 1, 9]])}, "vertex 9"),
    ({"V": files.QUAD[None], "F": np.array([[0.0, 1.0, 2.0]])}, "save F as integers"),
    ({"V": files.QUAD[None, :, :2], "F": np.array(files.FACES)}, "save V as floats"),
    ({"V": np.zeros((0, 5, 3)), "F": np.array(files.FACES)}, "no frames"),
    ({"V": files.QUAD[None], "F": np.zeros((0, 3), int)}, "no triangles"),
    ({"V": np.zeros((0, 3)), "F": np.zeros((0, 3), int)}, "no triangles"),
    ({"V": np.array([{"a": 1}], dtype=object), "F": np.array(files.FACES)}, "V.npy"),
])  # fmt: skip
def test_broken_npz_files(tmp_path, arrays, word):
    refused(npz(tmp_path / "a.npz", **arrays), word)


def test_npz_that_unpacks_to_far_more_than_its_size(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, V=np.zeros((1, 6_000_000, 3), np.float32), F=np.array([[0, 1, 2]]))
    assert path.stat().st_size < 200_000
    refused(path, "unpacks to more than")


MORE = [*files.FACES, (2, 3, 4)]
PAD = "the connectivity changes: 3 to 5 triangles, which vanish and appear"


@pytest.mark.parametrize("suffix", WRITERS)
def test_triangles_vanish_and_appear_where_the_connectivity_changes(tmp_path, suffix):
    own = [files.FACES, MORE, files.FACES[1:]]
    for number, faces in enumerate(own):
        written(tmp_path, f"wave_{number}{suffix}", WRITERS[suffix](files.QUAD + number, faces))
    loaded = load(tmp_path)
    assert PAD in loaded.notes
    scene = Scene("t", "T", loaded.geometry, Camera((0, 0, 5), (0, 0, 0)), ())
    prepared = prepare(scene)
    assert prepared.triangle_count == 5
    for number, faces in enumerate(own):
        points, valid = prepared.points(number)
        assert valid.tolist() == [1] * len(faces) + [0] * (5 - len(faces))
        expected = (files.QUAD + number)[np.array(faces)]
        assert np.array_equal(points[prepared.faces[: len(faces)]], expected)


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_sequence_of_any_format_has_one_mesh(tmp_path, suffix):
    for number in (2, 10, 1):
        written(tmp_path, f"wave_{number}{suffix}", WRITERS[suffix](files.QUAD + number))
    alone = load(tmp_path / f"wave_1{suffix}")
    loaded = load(tmp_path, Wanted(rate=12.0))
    assert np.array_equal(loaded.faces, alone.faces)
    assert [float(frame[0, 0] - alone.frames[0][0, 0]) for frame in loaded.frames] == [0, 1, 9]
    uneven = "the numbers of its files are not evenly spaced: 2 is followed by 10"
    assert (loaded.rate, loaded.up, loaded.notes) == (12.0, alone.up, (*alone.notes, uneven))
    assert source(loaded.files).file == f"wave_1{suffix}..wave_10{suffix} (3 files)"


def test_an_animated_file_of_a_sequence_gives_its_first_frame(tmp_path, monkeypatch):
    mesh = load(written(tmp_path, "a.ply", files.ply_binary()))

    def read(path, wanted):
        assert wanted.frames == (0, 0, 1)
        beside = (path.with_suffix(".bin"), tmp_path / "shared.bin")
        return Loaded(mesh.faces, mesh.frames, beside, rate=24.0, notes=("a skin left out",))

    monkeypatch.setitem(loading.READERS, ".glb", read)
    for number in range(3):
        written(tmp_path, f"w_{number}.glb", b"")
    loaded = load_sequence(sorted(tmp_path.glob("*.glb")), Wanted((0, None, 2)))
    assert len(loaded.frames) == 2
    assert load_sequence(sorted(tmp_path.glob("*.glb")), Wanted((0, None, 2), rate=12.0)).rate == 6.0
    assert [path.name for path in loaded.files] == ["w_0.glb", "w_2.glb", "w_0.bin", "shared.bin", "w_2.bin"]
    assert loaded.notes == ("a skin left out",)


@pytest.fixture
def frames(tmp_path):
    """Frames 7 to 12 among other files; the first coordinate of each is its number."""
    folder = tmp_path / "frames"
    folder.mkdir()
    for number in range(7, 13):
        written(folder, f"{number:04}.ply", files.ply_binary(files.QUAD + number))
        written(folder, f"low_{number}.ply", files.ply_binary(files.QUAD + 10 * number))
    written(folder, "notes.txt", b"")
    return folder


@pytest.mark.parametrize(("pattern", "name", "numbers"), [
    ("%04d.ply", "frames", range(7, 13)), ("%d.ply", "frames", range(7, 13)), ("0*.ply", "0", range(7, 13)),
    ("???[0-9].ply", None, ()), ("????.ply", "frames", range(7, 13)), ("low_%d.ply", "low", range(70, 130, 10)),
    ("low_*.ply", "low", range(70, 130, 10)), ("low_%02d.ply", "low", range(100, 130, 10)),
    ("low_%03d.ply", None, ()),
])  # fmt: skip
def test_a_pattern_stands_for_the_files_of_a_sequence(frames, pattern, name, numbers):
    if not numbers:
        with pytest.raises(UserError, match="no file matches"):
            resolve(frames / pattern)
        return
    scene = resolve(frames / pattern, None, Wanted((1, None, 1)))
    assert scene.name == name
    geometry = scene.geometry()
    assert [float(geometry.positions(k)[0, 0]) for k in range(geometry.frame_count)] == list(numbers)[1:]


def test_a_pattern_in_the_current_folder_and_one_of_several_formats(frames, monkeypatch):
    monkeypatch.chdir(frames)
    assert (resolve("%04d.ply").name, resolve("low_*.ply").name) == ("frames", "low")
    written(frames, "low_9.obj", files.obj())
    with pytest.raises(UserError, match=r"matches \.obj and \.ply files; give a pattern of one format"):
        resolve("low_*")
    with pytest.raises(UserError, match=r"matches \.txt files"):
        resolve("*.txt")
    written(frames, "star*.ply", files.ply_binary())
    assert resolve("star*.ply").geometry().frame_count == 1


def test_two_files_of_one_number_are_refused(tmp_path):
    for name in ("wave_1.ply", "wave_01.ply"):
        written(tmp_path, name, files.ply_binary())
    for given in (tmp_path, tmp_path / "wave_%d.ply", tmp_path / "*.ply"):
        with pytest.raises(UserError, match=r"wave_01\.ply and wave_1\.ply have one number"):
            resolve(given)


@pytest.mark.parametrize("suffix", [".glb", ".usda"] if usd.available() else [".glb"])
def test_a_sequence_of_animated_files_says_that_it_reads_their_first_frames(tmp_path, suffix):
    moving = square()
    moving.animate(translation=(0, [0, 1], [[0, 0, 0], [0, 0, 4]]))
    points = "point3f[] points.timeSamples = {0: [(0,0,0),(1,0,0),(0,1,0)], 24: [(0,0,4),(1,0,4),(0,1,4)]}\n"
    for number in (1, 2):
        content = moving.glb() if suffix == ".glb" else HEAD + mesh("M", points=points)
        written(tmp_path, f"w_{number}{suffix}", content)
    (noted,) = load(tmp_path).notes
    assert "1 of" in noted
    assert "25 frames" in noted


def test_a_frame_that_is_too_large_is_named(tmp_path):
    """Of a sequence by its own file; of an animation, whose buffers are further files, by that which was given."""
    for number in (1, 2, 3):
        written(tmp_path, f"w_{number}.ply", files.ply_ascii(files.QUAD * (1e38 if number == 2 else 1)))
    with pytest.raises(UserError, match=r"w_2\.ply: has coordinates of 1e\+38"):
        resolve(tmp_path)
    moving = square()
    moving.animate(translation=(0, [0, 1], [[0, 0, 0], [1e38, 0, 4]]))
    with pytest.raises(UserError, match=r"a\.gltf: has coordinates of"):
        resolve(moving.write(tmp_path, "a.gltf"))


def test_a_folder_with_two_sequences_is_ambiguous(tmp_path):
    for name in ("a_1.ply", "b_1.ply"):
        written(tmp_path, name, files.ply_binary())
    with pytest.raises(UserError, match="several numbered sequences"):
        load(tmp_path)


ASKED = Wanted((2, 8, 3), True, 12.5)


def waves(folder: Path, count: int = 9) -> Path:
    """A folder of numbered frames; the first coordinate of each is its number, from 0."""
    folder.mkdir(exist_ok=True)
    for number in range(count):
        written(folder, f"wave_{number:03}.ply", files.ply_binary(files.QUAD + number))
    return folder


@pytest.mark.parametrize(("text", "frames"), [
    ("2:8:3", (2, 8, 3)), ("2:8", (2, 8, 1)), ("5:", (5, None, 1)), (":", (0, None, 1)), ("::4", (0, None, 4)),
    (":3", (0, 3, 1)),
])  # fmt: skip
def test_the_frames_of_a_text(text, frames):
    assert (frames_of(text), frames_of(Wanted(frames).text())) == (frames, frames)


@pytest.mark.parametrize("text", ["", "3", "a:b", "1:2:3:4", "-1:4", "4:2", "0:9:0", "1.5:2"])
def test_other_texts_are_refused(text):
    with pytest.raises(UserError, match="write A:B:STEP"):
        frames_of(text)


def test_a_command_takes_a_number_or_the_frames_of_a_file():
    seen = ChosenView()
    assert (number_or_frames(None, seen), number_or_frames("7", seen)) == ((None, seen), (7, seen))
    assert number_or_frames("7:9", seen) == (None, ChosenView(wanted=Wanted((7, 9, 1))))
    with pytest.raises(UserError, match="give a number of frames, or those of a file as A:B:STEP"):
        number_or_frames("x", seen)
    with pytest.raises(UserError, match="--rate 0: must be more than 0"):
        view_of(rate=0.0)


def test_what_is_asked_travels_as_json():
    view = ChosenView(wanted=ASKED)
    assert ChosenView.read(json.loads(json.dumps(view.facts()))) == view
    assert view.changes
    assert (view.text(), Wanted().facts()) == ("", {})


def test_the_frames_of_a_folder_and_of_an_archive(tmp_path):
    stack = np.stack([files.QUAD + k for k in range(9)])
    np.savez(tmp_path / "a.npz", V=stack, F=np.array(files.FACES))
    for path in (waves(tmp_path / "waves"), tmp_path / "a.npz"):
        frames = load(path, ASKED).frames
        assert [float(frame[0, 0] - files.QUAD[0, 0]) for frame in frames] == [2, 5, 8]
        with pytest.raises(UserError, match=r"has frames 0 to 8; --frames 5:9:1 asks for others"):
            load(path, Wanted((5, 9, 1)))


STILL = {
    ".ply": files.ply_binary,
    ".obj": files.obj,
    ".stl": files.stl_binary,
    ".off": files.off,
    ".3mf": threemf_files.quad,
}


@pytest.mark.parametrize("suffix", loading.STILL)
def test_a_still_file_has_frame_0(tmp_path, suffix):
    path = written(tmp_path, "a" + suffix, STILL[suffix]())
    assert len(load(path, Wanted((0, None, 1))).frames) == 1
    with pytest.raises(UserError, match=r"has one frame, 0; --frames 1::1 asks for others"):
        load(path, Wanted((1, None, 1)))


def test_every_reader_is_asked(tmp_path, monkeypatch):
    path, seen = written(tmp_path, "a.glb", b""), []
    mesh = loading.READERS[".ply"](written(tmp_path, "a.ply", files.ply_binary()), Wanted())
    monkeypatch.setitem(loading.READERS, ".glb", lambda path, wanted: seen.append(wanted) or mesh)
    assert np.array_equal(load(path, ASKED).faces, mesh.faces)
    assert seen == [ASKED]


def test_what_is_asked_stands_in_the_source(tmp_path):
    scene = ChosenView(wanted=ASKED).resolved(waves(tmp_path / "waves"))
    assert scene.source.asked == {"frames": "2:8:3", "allow_missing": True, "rate": 12.5}
    assert not ChosenView().resolved(tmp_path / "waves").source.asked


@pytest.mark.parametrize("name", ["cloth", "balls-300k"])
def test_frames_of_what_is_no_file_are_refused(name):
    with pytest.raises(UserError, match=rf"{name}: --frames A:B:STEP is for files; this scene is procedural"):
        resolve(name, None, Wanted((0, 1, 1)))
    with pytest.raises(UserError, match="--rate is for files"):
        resolve(name, None, Wanted(rate=24.0))
    assert resolve(name, None, Wanted(allow_missing=True)).stand_in or name != "cloth"


def test_a_rate_of_one_frame_is_said_to_do_nothing(tmp_path, capsys):
    still = written(tmp_path, "a.ply", files.ply_binary())
    scene = resolve(still, None, Wanted(rate=12.0))
    assert scene.source.left_out == "--rate does nothing, because there is one frame"
    assert "note: a.ply: --rate does nothing" in capsys.readouterr().err
    waves(tmp_path / "waves")
    both = written(tmp_path, "a.toml", b'[[meshes]]\nfile = "a.ply"\n[[meshes]]\nfile = "waves"\n')
    for path in (tmp_path / "waves", both):
        scene = resolve(path, None, Wanted(rate=12.0))
        assert (scene.source.left_out, scene.rate) == ("", 12.0)
    assert resolve(both, None, Wanted((0, None, 4), rate=12.0)).rate == 3.0
