"""What holds for scene files of all formats: polygons, encodings, corners that are no numbers, and what is no mesh."""

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.mesh_files import refused, written
from helpers.real_scenes import MESHES, needs_real
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.readers import usd
from shadowbench.harness.scene.readers.load import SUFFIXES, load, source


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-be"])
@pytest.mark.parametrize("suffix", ["obj", "ply", "stl"])
def test_a_text_in_another_encoding_is_read_by_its_mark(tmp_path, encoding, suffix):
    plain = {"obj": files.obj().replace(b"\n", b"\r"), "ply": files.ply_ascii(), "stl": files.stl_ascii()}[suffix]
    mark = "\ufeff" if encoding.endswith("e") else ""
    coded = load(written(tmp_path, f"a.{suffix}", (mark + plain.decode()).encode(encoding)))
    right = load(written(tmp_path, f"b.{suffix}", plain))
    assert np.array_equal(coded.faces, right.faces)
    assert np.array_equal(coded.frames[0], right.frames[0])


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".toml"])
def test_a_git_lfs_pointer_is_called_what_it_is(tmp_path, suffix):
    path = written(tmp_path, f"a{suffix}", "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    with pytest.raises(UserError, match=rf"a{suffix}: is a Git LFS pointer.*git lfs pull"):
        resolve(path)


@pytest.mark.parametrize(("suffix", "words"), [
    ("abc", ("Alembic (.abc) is not read", "Blender", "USD")),
    ("FBX", ("FBX (.fbx) is not read", "FBX2glTF", ".glb")), ("pbrt", ("pbrt", ".toml")),
    ("mtl", ("materials of an OBJ file", "give the .obj file")), ("plx", ("did you mean .ply?",)),
    ("txt", ("known:", ".stl, .toml, .usd")),
])  # fmt: skip
def test_a_format_that_is_not_read_names_what_converts_it(tmp_path, suffix, words):
    refused(written(tmp_path, f"a.{suffix}", b"x"), *words)
    with pytest.raises(UserError, match=r"is not read|cannot be read"):
        resolve(tmp_path / f"a.{suffix}")


@pytest.mark.parametrize("suffix", ["ply", "npz", "xyz", "mtl", *(["usda"] if usd.available() else [])])
def test_files_that_are_none(tmp_path, suffix):
    refused(tmp_path / f"absent.{suffix}", "no such file")
    refused(tmp_path, "no numbered")


def test_the_hash_of_a_source_is_that_of_its_bytes(tmp_path):
    path = written(tmp_path, "a.obj", b"abc")
    assert source((path,)).sha256 == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_usd_is_read_where_its_package_is_installed(tmp_path, monkeypatch):
    path = written(tmp_path, "a.usda", files.USDA)
    if usd.available():
        loaded = load(path)
        assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 4]]
        assert np.array_equal(loaded.frames[0], files.QUAD + np.float32([10, 0, 0]))
        assert loaded.up == (0, 0, 1)
    monkeypatch.setattr(usd, "available", lambda: False)
    refused(path, "usd-core", "pip install")


def agrees_with_trimesh(path) -> None:
    """The same triangles with the very same corners, so the same bounds."""
    theirs, ours = trimesh.load_mesh(path, process=False), load(path)
    kind = np.float32 if path.suffix == ".ply" else np.float64
    assert np.array_equal(ours.frames[0].astype(kind)[ours.faces], theirs.triangles)


@needs_real
def test_real_files_are_what_trimesh_reads():
    for path in MESHES:
        agrees_with_trimesh(path)


@pytest.mark.parametrize("kind", ["obj", "ply", "ascii.ply", "stl", "ascii.stl", "off", "glb"])
def test_generated_meshes_are_what_trimesh_reads(tmp_path, kind):
    for k, mesh in enumerate((trimesh.creation.icosphere(2), trimesh.creation.annulus(1.0, 2.0, 0.5))):
        path = tmp_path / f"{k}.{kind}"
        mesh.export(path, **{"ascii.ply": {"encoding": "ascii"}, "ascii.stl": {"file_type": "stl_ascii"}}.get(kind, {}))
        agrees_with_trimesh(path)
