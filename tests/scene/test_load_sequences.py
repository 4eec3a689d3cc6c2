"""Meshes in several frames: arrays of an NPZ file, and numbered files in a folder."""

from pathlib import Path

import numpy as np
import pytest
from helpers import mesh_files as files
from helpers.mesh_files import refused, written
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.readers.load import load, source


def npz(path, **arrays) -> Path:
    with path.open("wb") as stream:
        np.savez(stream, **arrays)
    return path


def test_npz_sequence(tmp_path):
    frames = np.stack([files.QUAD, files.QUAD + 1, files.QUAD * 2])
    loaded = load(npz(tmp_path / "a.npz", V=frames, F=np.array(files.FACES)))
    geometry = loaded.geometry()
    assert geometry.frame_count == 3
    assert all(np.array_equal(geometry.positions(k), frames[k]) for k in range(3))
    assert geometry.faces.tolist() == [list(face) for face in files.FACES]


@pytest.mark.parametrize(
    ("arrays", "word"),
    [
        ({"V": files.QUAD[None]}, "no array 'F'"),
        ({"F": np.array(files.FACES)}, "no array 'V'"),
        ({"V": files.QUAD[None], "F": np.array([[0, 1, 9]])}, "vertex 9"),
        ({"V": files.QUAD[None], "F": np.array([[0.0, 1.0, 2.0]])}, "save F as integers"),
        ({"V": files.QUAD[None, :, :2], "F": np.array(files.FACES)}, "save V as floats"),
        ({"V": np.zeros((0, 5, 3)), "F": np.array(files.FACES)}, "no frames"),
        ({"V": files.QUAD[None], "F": np.zeros((0, 3), int)}, "no triangles"),
        ({"V": np.zeros((0, 3)), "F": np.zeros((0, 3), int)}, "no triangles"),
        ({"V": np.array([{"a": 1}], dtype=object), "F": np.array(files.FACES)}, "V.npy"),
    ],
)
def test_broken_npz_files(tmp_path, arrays, word):
    refused(npz(tmp_path / "a.npz", **arrays), word)


def test_npz_that_unpacks_to_far_more_than_its_size(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, V=np.zeros((1, 6_000_000, 3), np.float32), F=np.array([[0, 1, 2]]))
    assert path.stat().st_size < 200_000
    refused(path, "unpacks to more than")


def test_numbered_frames_of_a_folder(tmp_path):
    for number in (2, 10, 1):
        written(tmp_path, f"wave_{number}.ply", files.ply_binary(files.QUAD + number))
    loaded = load(tmp_path)
    assert [frame[0, 0] for frame in loaded.frames] == [1, 2, 10]
    assert source(loaded.files).file == "wave_1.ply..wave_10.ply (3 files)"


def test_frames_must_have_the_same_connectivity(tmp_path):
    written(tmp_path, "wave_1.ply", files.ply_binary())
    written(tmp_path, "wave_2.ply", files.ply_binary(polygons=[*files.FACES[1:], files.FACES[0]]))
    with pytest.raises(UserError, match=r"wave_2\.ply.*wave_1\.ply; all frames of a sequence need"):
        load(tmp_path)


def test_a_folder_with_two_sequences_is_ambiguous(tmp_path):
    for name in ("a_1.ply", "b_1.ply"):
        written(tmp_path, name, files.ply_binary())
    with pytest.raises(UserError, match="several numbered sequences"):
        load(tmp_path)
