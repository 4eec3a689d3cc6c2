"""Scene files: right ones are read as they are, broken ones are one line."""

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.mesh_files import refused, written
from helpers.real_scenes import MESHES, needs_real
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.readers import usd
from shadowbench.harness.scene.readers.load import load, source
from shadowbench.harness.scene.readers.polygons import triangulate
from shadowbench.harness.scene.scene import Camera, Scene

PENTAGON = [(0, 1, 2, 3, 4), (0, 1, 2), (0, 1, 2, 3)]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.ply", files.ply_binary()),
        ("b.ply", files.ply_binary(big=True)),
        ("c.ply", files.ply_binary(count="int", index="ushort")),
        ("d.ply", files.ply_ascii()),
        ("e.obj", files.obj()),
        ("UPPER.OBJ", files.obj()),
        ("f.obj", files.obj().replace(b"\n", b"\r\n")),
        ("g.obj", files.obj().replace(b"\n", b"\r")),
        ("h.ply", files.ply_ascii().replace(b"\n", b"\r\n")),
    ],
)
def test_plain_files_are_read_as_they_are(tmp_path, name, content):
    loaded = load(written(tmp_path, name, content))
    assert np.array_equal(loaded.frames[0], files.QUAD)
    assert loaded.faces.tolist() == [list(face) for face in files.FACES]
    assert loaded.faces.dtype == np.int32
    assert loaded.geometry().frame_count == 1


@pytest.mark.parametrize(
    ("name", "make"), [("a.ply", files.ply_binary), ("b.ply", files.ply_ascii), ("c.obj", files.obj)]
)
def test_polygons_become_fans_in_the_order_of_the_file(tmp_path, name, make):
    loaded = load(written(tmp_path, name, make(polygons=PENTAGON)))
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2], [0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (files.ply_binary(polygons=[(0, 1, 5)]), "vertex 5 (from 0), but there are 5"),
        (files.ply_binary(polygons=[(0, 1, -1)]), "vertex -1"),
        (files.ply_ascii(polygons=[(0, 1, 5)]), "vertex 5"),
        (files.ply_binary(vertices=2_000_000_000), "claims 2000000000 of 'vertex'"),
        (files.ply_binary(faces=2_000_000_000), "claims 2000000000 of 'face'"),
        (files.ply_ascii(vertices=2_000_000_000), "claims 2000000000"),
        (files.ply_binary(faces=5), "truncated"),
        (files.ply_binary(faces=3), "13 bytes remain"),
        (files.ply_binary(vertices=4), "truncated or its header wrong"),
        (files.ply_ascii(faces=3), "more rows follow than the header claims: 1"),
        (files.ply_ascii(faces=5), "claims 5 of 'face', but 4 rows follow"),
        (files.ply_binary()[:-1], "truncated"),
        (files.ply_binary()[:-20], "truncated"),
        (files.ply_binary()[:100], "truncated"),
        (files.ply_binary()[:3], "no end_header"),
        (b"", "ply"),
        (b"ply\nend_header\n", "no format"),
        (files.ply_binary(faces=-1), "negative"),
        (files.ply_binary(polygons=[(0, 1)]), "face 0 has 2 vertices"),
        (files.ply_ascii(polygons=[(0, 1, 2), (0, 1)]), "face 1 has 2 vertices"),
        (files.ply_binary(polygons=[]), "no triangles"),
        (files.ply_binary().replace(b"float z", b"float w"), "lacks x, y or z"),
        (files.ply_binary().replace(b"vertex_indices", b"other_indices"), "vertex_indices"),
        (files.ply_binary().replace(b"list uchar", b"list float"), "not of an integer type"),
        (files.ply_binary().replace(b"property float x", b"property quad x"), "header line 'property quad x'"),
        (files.ply_ascii().replace(b"0.5 0.5 1", b"0.5 half 1"), "not a number"),
        (files.ply_ascii().replace(b"3 0 1 2\n", b"3 0 1.5 2\n"), "not a whole number"),
    ],
)
def test_broken_ply_files(tmp_path, content, word):
    refused(written(tmp_path, "a.ply", content), word)


def test_ply_with_other_properties_elements_and_orders(tmp_path):
    text = """ply
format ascii 1.0
element camera 1
property float x
element face 2
property uchar red
property list uchar int vertex_index
property list uchar float texcoord
element vertex 4
property float x
property float nx
property float y
property double z
element edge 1
property int vertex1
property int vertex2
end_header
9
255 4 0 1 2 3 2 0.5 0.5
0 3 0 1 2 0
0 7 0 0
1 7 0 0
1 7 1 0
0 7 1 0
0 1
"""
    loaded = load(written(tmp_path, "a.ply", text))
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]
    assert loaded.frames[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_fans_of_many_polygons_across_blocks():
    rng = np.random.default_rng(1)
    counts = rng.integers(3, 7, 40_000)
    corners = np.arange(counts.sum())
    expected, at = [], 0
    for count in counts:
        expected += [(at, at + i, at + i + 1) for i in range(1, count - 1)]
        at += count
    assert np.array_equal(triangulate(np.zeros((1, 3)), counts, corners), expected)


def test_stl_keeps_every_triangle_and_its_corners(tmp_path):
    for name, content in (("a.stl", files.stl_binary()), ("b.stl", files.stl_ascii())):
        loaded = load(written(tmp_path, name, content))
        assert np.array_equal(loaded.frames[0][loaded.faces], files.QUAD[np.array(files.FACES)])
        assert loaded.up == (0, 0, 1)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (files.stl_binary(claimed=5), "claims 5 triangles"),
        (files.stl_binary(claimed=3), "claims 3 triangles"),
        (files.stl_binary()[:-7], "truncated"),
        (files.stl_binary(claimed=4_000_000_000), "claims 4000000000"),
        (files.stl_binary(triangles=np.zeros((0, 3), int)), "no triangles"),
        (b"short", "neither"),
    ],
)
def test_broken_stl_files(tmp_path, content, word):
    refused(written(tmp_path, "a.stl", content), word)


def test_files_that_are_none(tmp_path):
    refused(tmp_path / "absent.ply", "no such file")
    refused(tmp_path / "absent.npz", "no such file")
    refused(tmp_path / "absent.usda", "no such file") if usd.available() else None
    refused(tmp_path / "absent.xyz", "no such file")
    refused(written(tmp_path, "a.plx", b""), "did you mean .ply?")
    refused(tmp_path, "no numbered")


@pytest.mark.parametrize(
    ("suffix", "words"),
    [
        ("abc", ("Alembic (.abc) is not read", "Blender", "USD")),
        ("FBX", ("FBX (.fbx) is not read", "FBX2glTF", ".glb")),
        ("dae", ("COLLADA", "COLLADA2GLTF")),
        ("step", ("STEP", "FreeCAD")),
        ("pbrt", ("pbrt", ".toml")),
        ("mtl", ("materials of an OBJ file", "give the .obj file")),
    ],
)
def test_a_format_that_is_not_read_names_what_converts_it(tmp_path, suffix, words):
    refused(written(tmp_path, f"a.{suffix}", b"x"), *words)
    with pytest.raises(UserError, match="is not read"):
        resolve(tmp_path / f"a.{suffix}")
    refused(tmp_path / f"b.{suffix}", "no such file")


def test_one_triangle_and_nan_vertices(tmp_path):
    points = np.vstack([files.QUAD, [[np.nan, 0, 0]]])
    for name, make in (("a.ply", files.ply_binary), ("b.ply", files.ply_ascii), ("c.obj", files.obj)):
        loaded = load(written(tmp_path, name, make(points, [(0, 1, 2), (0, 1, 5)])))
        scene = Scene("t", "T", loaded.geometry, Camera((0, 0, 5), (0, 0, 0)), ())
        assert prepare(scene).points(0)[1].tolist() == [1, 0]
        assert len(load(written(tmp_path, name, make(polygons=[(0, 1, 2)]))).faces) == 1


def test_the_hash_of_a_source_is_that_of_its_bytes(tmp_path):
    path = written(tmp_path, "a.obj", b"abc")
    assert source((path,)).sha256 == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


@needs_real
@pytest.mark.parametrize("kind", ["as it is", "obj", "stl", "off"])
def test_real_files_are_what_trimesh_reads(tmp_path, kind):
    """The kept meshes, and each written in other formats: bounds, triangles and their corners."""
    for mesh in MESHES:
        path = mesh
        if kind != "as it is":
            if mesh.stat().st_size > 1 << 20:  # trimesh takes long to write it
                continue
            path = tmp_path / f"{mesh.stem}.{kind}"
            trimesh.load_mesh(mesh, process=False).export(path)
        theirs, ours = trimesh.load_mesh(path, process=False), load(path)
        assert len(ours.faces) == len(theirs.faces)
        corners = ours.frames[0][ours.faces]
        assert np.array_equal(corners, theirs.triangles)
        assert np.array_equal(corners.reshape(-1, 3).min(axis=0), theirs.bounds[0])
        assert np.array_equal(corners.reshape(-1, 3).max(axis=0), theirs.bounds[1])


def test_usd_is_read_where_its_package_is_installed(tmp_path, monkeypatch):
    path = written(tmp_path, "a.usda", files.USDA)
    if usd.available():
        loaded = load(path)
        assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 4]]
        assert np.array_equal(loaded.frames[0], files.QUAD + np.float32([10, 0, 0]))
        assert loaded.up == (0, 0, 1)
    monkeypatch.setattr(usd, "available", lambda: False)
    refused(path, "usd-core", "pip install")
