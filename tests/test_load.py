"""Scene files: right ones are read as they are, broken ones are one line."""

import tracemalloc
from pathlib import Path

import mesh_files as files
import numpy as np
import pytest
import trimesh
from shadowbench.harness.errors import UserError
from shadowbench.harness.moment import Prepared
from shadowbench.harness.scene import Camera, Scene
from shadowbench.harness.scenes import usd
from shadowbench.harness.scenes.checks import MAX_LINE, fan
from shadowbench.harness.scenes.load import load, source

REAL = Path(__file__).resolve().parents[2] / "shared" / "scenes"
PENTAGON = [(0, 1, 2, 3, 4), (0, 1, 2), (0, 1, 2, 3)]
PENTAGON_FANS = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2], [0, 1, 2], [0, 2, 3]]


def written(tmp_path, name, content) -> Path:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refused(path, *words) -> str:
    """Loading fails with one line that names the file and all words."""
    with pytest.raises(UserError) as caught:
        load(path)
    line = str(caught.value)
    assert "\n" not in line
    assert str(path) in line
    assert "; " in line, "the line names no way out"
    for word in words:
        assert word in line
    return line


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


@pytest.mark.parametrize("content", [files.ply_binary(polygons=PENTAGON), files.ply_ascii(polygons=PENTAGON)])
def test_ply_polygons_become_fans_in_the_order_of_the_file(tmp_path, content):
    assert load(written(tmp_path, "p.ply", content)).faces.tolist() == PENTAGON_FANS


def test_obj_polygons_become_fans_in_the_order_of_the_file(tmp_path):
    assert load(written(tmp_path, "p.obj", files.obj(polygons=PENTAGON))).faces.tolist() == PENTAGON_FANS


@pytest.mark.parametrize("suffix", ["ply", "obj"])
def test_plain_files_are_what_trimesh_reads(tmp_path, suffix):
    path = tmp_path / f"sphere.{suffix}"
    trimesh.creation.icosphere(3).export(path)
    theirs, ours = trimesh.load_mesh(path, process=False), load(path)
    assert np.array_equal(ours.faces, theirs.faces)
    assert np.array_equal(ours.frames[0], theirs.vertices)


def test_obj_records_that_are_no_geometry_change_nothing(tmp_path):
    text = """# comment
mtllib absent.mtl
o first
v 0 0 0 1.0
v 1 0 0 0.5 0.5 0.5
vt 0 0
vn 0 0 1
usemtl red
f 1/1/1 2/1/1 3/1/1
v 1 1 0
v 0 1 0
usemtl blue
f 1//1 \\
  3//1 4//1
usemtl red
s off
l 1 2
f 2/1 3/1 4/1
"""
    loaded = load(written(tmp_path, "a.obj", text))
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [1, 2, 3]]
    assert loaded.frames[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_negative_obj_indices_count_back_from_their_line(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n"
    path = written(tmp_path, "a.obj", text)
    assert load(path).faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    # What trimesh makes of it is why OBJ is read here: the same face twice.
    assert trimesh.load_mesh(path, process=False).triangles[0, :, 0].tolist() != [0, 1, 0]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "vertex 0"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "vertex 3 (from 0), but there are 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -2 -1\n", "vertex -4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "2 vertices"),
        ("v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "line 1"),
        ("v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n", "line 2"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 1.5\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles"),
        ("", "no triangles"),
        ("v " + "0 " * MAX_LINE, "longer than"),
    ],
)
def test_broken_obj_files(tmp_path, text, word):
    refused(written(tmp_path, "a.obj", text), word)


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
        (files.ply_binary(faces=3), "13 bytes are left"),
        (files.ply_binary(vertices=4), "truncated or its header wrong"),
        (files.ply_ascii(faces=3), "4 numbers are left"),
        (files.ply_ascii(faces=5), "end inside"),
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
        (files.ply_binary().replace(b"list uchar", b"list float"), "no integer type"),
        (
            files.ply_binary().replace(b"property float x", b"property quad x"),
            "header line 'property quad x'",
        ),
        (files.ply_ascii().replace(b"0.5 0.5 1", b"0.5 half 1"), "not a number"),
        (files.ply_ascii().replace(b"3 0 1 2\n", b"3 0 1.5 2\n"), "no whole number"),
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
    assert np.array_equal(fan(counts, corners), expected)


def test_stl_keeps_every_triangle_and_its_corners(tmp_path):
    for name, content in (("a.stl", files.stl_binary()), ("b.stl", files.stl_ascii())):
        loaded = load(written(tmp_path, name, content))
        assert np.array_equal(loaded.frames[0][loaded.faces], files.QUAD[np.array(files.FACES)])
        assert loaded.up == (0, 0, 1)


def test_stl_of_several_solids(tmp_path):
    content = files.stl_ascii() + files.stl_ascii(triangles=[(0, 1, 4)]).replace(b"hand", b"foot")
    loaded = load(written(tmp_path, "a.stl", content))
    expected = files.QUAD[np.array([*files.FACES, (0, 1, 4)])]
    assert np.array_equal(loaded.frames[0][loaded.faces], expected)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (files.stl_binary(claimed=5), "claims 5 triangles"),
        (files.stl_binary(claimed=3), "claims 3 triangles"),
        (files.stl_binary()[:-7], "truncated"),
        (files.stl_binary(claimed=4_000_000_000), "claims 4000000000"),
        (files.stl_binary(triangles=np.zeros((0, 3), int)), "no triangles"),
        (b"solid a\nendsolid a\n", "no triangles"),
        (files.stl_ascii()[:-40], "could be read"),
        (files.stl_ascii().replace(b"vertex 1 1 0", b"vertex 1 one 0", 1), ""),
        (files.stl_ascii().replace(b"  vertex 1 1 0\n", b"", 1), "instead of 12"),
        (b"short", "neither"),
    ],
)
def test_broken_stl_files(tmp_path, content, word):
    refused(written(tmp_path, "a.stl", content), word)


def test_glb_applies_transforms_and_keeps_the_order(tmp_path):
    loaded = load(written(tmp_path, "a.glb", files.glb()))
    assert loaded.faces.tolist() == [
        *map(list, files.FACES),
        *[[i + 5 for i in face] for face in files.FACES],
    ]
    assert np.array_equal(loaded.frames[0], np.vstack([files.QUAD, files.QUAD + np.float32([10, 0, 0])]))
    assert loaded.up == (0, 1, 0)


@pytest.mark.parametrize("index", ["u1", "<u2"])
def test_glb_with_small_indices_in_many_places(tmp_path, index):
    def change(head):
        head["nodes"] = [{"mesh": 0} for _ in range(60)]
        head["scenes"] = [{"nodes": list(range(60))}]

    faces = load(written(tmp_path, "a.glb", files.glb(change=change, index=index))).faces
    assert np.array_equal(faces[-4:], np.array(files.FACES) + 59 * 5)


def test_glb_order_is_that_of_the_scene_not_of_names(tmp_path):
    """Nodes named so that sorting by name would turn them round."""

    def change(head):
        head["nodes"] = [{"mesh": 0, "name": f"{9 - i}", "translation": [i, 0, 0]} for i in range(10)]
        head["scenes"] = [{"nodes": [3, 0, 1, 2, *range(4, 10)]}]

    loaded = load(written(tmp_path, "a.glb", files.glb(change=change)))
    assert loaded.frames[0][::5, 0].tolist() == [3, 0, 1, 2, 4, 5, 6, 7, 8, 9]


def test_glb_transforms_are_those_of_trimesh(tmp_path):
    def change(head):
        turned = {
            "rotation": [0.5, 0.5, -0.5, 0.5],
            "scale": [2, 1, 3],
            "translation": [0, 7, 0],
            "children": [2],
        }
        matrix = [1, 2, 0, 0, 0, 1, 0, 0, 3, 0, 1, 0, 5, 6, 7, 1]
        head["nodes"] = [{"mesh": 0, "matrix": matrix}, turned, {"mesh": 0, "translation": [10, 0, 0]}]

    path = written(tmp_path, "a.glb", files.glb(change=change))
    ours = load(path)
    theirs = trimesh.load_scene(path, process=False).to_mesh()
    corners = ours.frames[0][ours.faces]
    assert np.allclose(sorted(corners.tolist()), sorted(theirs.triangles.tolist()))


def test_glb_with_several_meshes_modes_and_primitives(tmp_path):
    def change(head):
        solid, points = (
            {"attributes": {"POSITION": 0}, "indices": 1},
            {"attributes": {"POSITION": 0}, "mode": 0},
        )
        strip = {"attributes": {"POSITION": 0}, "mode": 5}
        head["meshes"] = [{"primitives": [solid]}, {"primitives": [points, strip, solid]}]
        head["nodes"] = [{"mesh": 1}]
        head["scenes"] = [{"nodes": [0]}]

    loaded = load(written(tmp_path, "a.glb", files.glb(change=change)))
    assert len(loaded.faces) == 3 + 4
    assert sorted(loaded.faces[0].tolist()) == [0, 1, 2]
    assert loaded.faces[3:].tolist() == [[i + 5 for i in face] for face in files.FACES]


def edit(*path, value):
    """A change of a GLB's JSON part: the entry at ``path`` becomes ``value``."""

    def change(head):
        for key in path[:-1]:
            head = head[key]
        head[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (edit("accessors", 0, "count", value=2_000_000_000), "accessor 0 needs"),
        (edit("accessors", 1, "count", value=-3), "not a whole number"),
        (edit("accessors", 1, "count", value=11), "not a multiple of 3"),
        (edit("accessors", 1, "byteOffset", value=4), "accessor 1 needs"),
        (edit("bufferViews", 1, "byteOffset", value=1 << 30), "buffer view 1"),
        (edit("bufferViews", 1, "byteOffset", value=0), "names vertex"),
        (edit("bufferViews", 0, "byteStride", value=1), "stride"),
        (edit("nodes", 2, value={"children": [1]}), "met twice"),
        (edit("nodes", 2, "children", value=[77]), "node 77"),
        (edit("nodes", 2, value={"children": [0]}), "met twice"),
        (edit("meshes", 0, "primitives", 0, "mode", value=6), "fans"),
        (edit("meshes", 0, "primitives", 0, "mode", value=1), "no triangles"),
        (edit("meshes", value=[]), "GLB"),
        (edit("extensionsRequired", value=["KHR_draco_mesh_compression"]), "KHR_draco"),
        (edit("accessors", 0, "sparse", value={}), "sparse"),
        (edit("buffers", 0, "uri", value="other.bin"), "self-contained"),
        (edit("nodes", value="no list"), "GLB"),
        (edit("scenes", value=[]), "no scene"),
    ],
)
def test_broken_glb_files(tmp_path, change, word):
    refused(written(tmp_path, "a.glb", files.glb(change=change)), word)


def test_truncated_glb(tmp_path):
    for length in (0, 11, 19, 40, 500, len(files.glb()) - 1):
        refused(written(tmp_path, "a.glb", files.glb()[:length]))


def test_glb_in_which_a_few_bytes_name_many_triangles(tmp_path):
    def change(head):
        head["nodes"] = [{"mesh": 0}] * 3000
        head["scenes"] = [{"nodes": list(range(3000))}]
        head["meshes"][0]["primitives"] *= 3000

    refused(written(tmp_path, "a.glb", files.glb(change=change)), "36000000 triangles by instancing")


@pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")
def test_usd_fans_transforms_visibility_and_up(tmp_path):
    loaded = load(written(tmp_path, "a.usda", files.USDA))
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 4]]
    assert np.array_equal(loaded.frames[0], files.QUAD + np.float32([10, 0, 0]))
    assert loaded.up == (0, 0, 1)


@pytest.mark.skipif(not usd.available(), reason="usd-core is not installed")
@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("[5, 3]", "[5, 2]", "face 1 has 2 vertices"),
        ("[5, 3]", "[5, 3, 3]", "11 corners are counted"),
        ("[0, 1, 2, 3, 4, 0, 1, 4]", "[0, 1, 2, 3, 9, 0, 1, 4]", "vertex 9"),
        ("def Mesh", "def Xform", "no visible mesh"),
        ("#usda 1.0", "#usda", "USD"),
    ],
)
def test_broken_usd_files(tmp_path, old, new, word):
    refused(written(tmp_path, "a.usda", files.USDA.replace(old, new)), word)


def test_without_usd_core_the_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(usd, "available", lambda: False)
    refused(written(tmp_path, "a.usda", files.USDA), "usd-core", "pip install")


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


def test_files_that_are_none(tmp_path):
    refused(tmp_path / "absent.ply", "no such file")
    refused(tmp_path / "absent.npz", "no such file")
    refused(tmp_path / "absent.usda", "no such file") if usd.available() else None
    refused(tmp_path / "absent.xyz", "no such file")
    refused(written(tmp_path, "a.plx", b""), "did you mean .ply?")
    refused(tmp_path, "no numbered")


def test_one_triangle_and_nan_vertices(tmp_path):
    points = np.vstack([files.QUAD, [[np.nan, 0, 0]]])
    for name, make in (("a.ply", files.ply_binary), ("b.ply", files.ply_ascii), ("c.obj", files.obj)):
        loaded = load(written(tmp_path, name, make(points, [(0, 1, 2), (0, 1, 5)])))
        scene = Scene("t", "T", loaded.geometry, Camera((0, 0, 5), (0, 0, 0)), ())
        assert Prepared(scene).points(0)[1].tolist() == [1, 0]
        assert len(load(written(tmp_path, name, make(polygons=[(0, 1, 2)]))).faces) == 1


def test_the_hash_of_a_source_is_that_of_its_bytes(tmp_path):
    path = written(tmp_path, "a.obj", b"abc")
    assert source((path,)).sha256 == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


@pytest.mark.parametrize(
    "kind", ["ply", "ascii.ply", "mixed.ply", "mixed.ascii.ply", "obj", "stl", "ascii.stl", "glb"]
)
def test_memory_stays_within_ten_times_the_file(tmp_path, kind):
    n = 40
    rng = np.random.default_rng(0)
    points = rng.random((n * n, 3)).astype(np.float32)
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    quads = np.stack([i, i + 1, i + n + 1, i + n], axis=1).tolist()
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    mixed = [*triangles[: len(quads)], *quads]
    content = {
        "ply": lambda: files.ply_binary(points, triangles),
        "ascii.ply": lambda: files.ply_ascii(points, triangles),
        "mixed.ply": lambda: files.ply_binary(points, mixed),
        "mixed.ascii.ply": lambda: files.ply_ascii(points, mixed),
        "obj": lambda: files.obj(points, mixed),
        "stl": lambda: files.stl_binary(points, triangles),
        "ascii.stl": lambda: files.stl_ascii(points, triangles),
        "glb": lambda: files.glb(points, triangles),
    }[kind]()
    path = written(tmp_path, f"a.{kind}", content)
    load(path)  # whatever is imported on the first call is not the file's
    tracemalloc.start()
    try:
        load(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak <= 10 * len(content) + (1 << 19), f"{peak / len(content):.1f} times the file"


@pytest.mark.skipif(not REAL.is_dir(), reason="the folder of real scenes is absent")
def test_real_files_are_what_trimesh_reads():
    for path in sorted(REAL.glob("*.ply")):
        theirs, ours = trimesh.load_mesh(path, process=False), load(path)
        assert np.array_equal(ours.faces, theirs.faces)
        assert np.array_equal(ours.frames[0], theirs.vertices)
