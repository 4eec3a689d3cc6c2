"""What is asked of a file: frames, rate, missing files. It reaches the reader, the record and the key of a point."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers import threemf_files
from helpers.mesh_files import written
from shadowbench.harness.commands.options import number_or_frames, view_of
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.readers import load as loading
from shadowbench.harness.scene.readers.checks import Wanted, frames_of
from shadowbench.harness.scene.readers.load import load

ASKED = Wanted((2, 8, 3), True, 12.5)


def waves(folder: Path, count: int = 9) -> Path:
    """A folder of numbered frames; the first coordinate of each is its number, from 0."""
    folder.mkdir(exist_ok=True)
    for number in range(count):
        written(folder, f"wave_{number:03}.ply", files.ply_binary(files.QUAD + number))
    return folder


@pytest.mark.parametrize(
    ("text", "frames"),
    [("2:8:3", (2, 8, 3)), ("2:8", (2, 8, 1)), ("5:", (5, None, 1)), (":", (0, None, 1)), ("::4", (0, None, 4)),
     (":3", (0, 3, 1))],
)  # fmt: skip
def test_the_frames_of_a_text(text, frames):
    assert frames_of(text) == frames
    assert frames_of(Wanted(frames).text()) == frames


@pytest.mark.parametrize("text", ["", "3", "a:b", "1:2:3:4", "-1:4", "4:2", "0:9:0", "1.5:2"])
def test_other_texts_are_refused(text):
    with pytest.raises(UserError, match="write A:B:STEP"):
        frames_of(text)


def test_a_command_takes_a_number_or_the_frames_of_a_file():
    seen = ChosenView()
    assert number_or_frames(None, seen) == (None, seen)
    assert number_or_frames("7", seen) == (7, seen)
    assert number_or_frames("7:9", seen) == (None, ChosenView(wanted=Wanted((7, 9, 1))))
    with pytest.raises(UserError, match="give a number of frames, or those of a file as A:B:STEP"):
        number_or_frames("x", seen)
    with pytest.raises(UserError, match="--rate 0: must be more than 0"):
        view_of(rate=0.0)


def test_what_is_asked_travels_as_json():
    view = ChosenView(wanted=ASKED)
    assert ChosenView.read(json.loads(json.dumps(view.facts()))) == view
    assert view.changes
    assert view.text() == ""
    assert Wanted().facts() == {}


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
