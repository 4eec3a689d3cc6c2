"""glTF files: order, transforms, kinds of primitives, buffers and notes; broken ones are one line."""

import base64
import json

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.gltf_samples import CORNERS, SQUARE, Gltf, binary, bounds, square
from helpers.mesh_files import refused, written
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.readers.checks import Wanted
from shadowbench.harness.scene.readers.gltf import container
from shadowbench.harness.scene.readers.load import load, source


@pytest.mark.parametrize("index", ["u1", "<u2", "<u4"])
def test_the_order_is_that_of_the_scene_not_of_names(tmp_path, index):
    """Nodes named so that sorting by name would turn them round; positions that are not moved keep their bits."""
    made = Gltf()
    mesh = made.mesh(files.QUAD, np.array(files.FACES, index).ravel())
    for i in range(60):
        made.node(mesh=mesh, name=f"{99 - i}", translation=[i, 0, 0])
    order = made.head["scenes"][0]["nodes"] = [3, 0, 1, 2, *range(4, 60)]
    made.head["scenes"].append({"nodes": [0], "name": "other"})
    loaded = load(made.write(tmp_path))
    assert loaded.frames[0][::5, 0].tolist() == order
    assert np.array_equal(loaded.faces, np.concatenate([np.array(files.FACES, int) + 5 * i for i in range(60)]))
    assert (loaded.up, loaded.notes) == ((0, 1, 0), ("scene 'other' left out",))
    del made.head["scene"]
    made.head["scenes"].reverse()
    first = load(made.write(tmp_path))
    assert first.frames[0].dtype == np.float32, "without a default it is the first scene, and nothing moves there"
    assert np.array_equal(first.frames[0], files.QUAD)


number = st.floats(-3, 3, width=32)


def vectors(count, of=number):
    return st.lists(of, min_size=count, max_size=count)


placed = st.one_of(
    st.fixed_dictionaries(
        {},
        optional={
            "translation": vectors(3),
            "rotation": vectors(4).filter(lambda q: np.linalg.norm(q) > 0.1),
            "scale": vectors(3, st.floats(0.25, 2, width=32)),
        },
    ),
    vectors(12).map(lambda m: {"matrix": [*m[:3], 0, *m[3:6], 0, *m[6:9], 0, *m[9:], 1]}),
)


@given(st.lists(st.tuples(placed, st.integers(0, 9), st.booleans()), min_size=1, max_size=8))
@settings(derandomize=True, max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
def test_trees_of_nodes_are_placed_as_trimesh_places_them(tmp_path_factory, nodes):
    """Whatever the tree, every triangle is where trimesh has it: transforms by matrix and by parts, of all parents."""
    made = Gltf()
    meshes = [made.mesh(np.random.default_rng(k).random((4, 3)), CORNERS) for k in range(2)]
    for i, (place, parent, second) in enumerate(nodes):
        rotation = place.get("rotation")
        if rotation:
            place = {**place, "rotation": (np.array(rotation) / np.linalg.norm(rotation)).tolist()}
        made.node(parent % (i + 1) - 1 if parent % (i + 1) else None, mesh=meshes[second], **place)
    path = written(tmp_path_factory.getbasetemp(), "tree.glb", made.glb())
    ours, theirs = load(path), trimesh.load_scene(path, process=False)
    assert len(ours.faces) == 2 * len(nodes)
    found = ours.frames[0].astype(np.float64)[ours.faces].mean(axis=1)
    expected = theirs.to_mesh().triangles.mean(axis=1)
    size = 1e-5 * max(1.0, np.abs(expected).max())
    distance = np.abs(found[:, None] - expected[None]).max(axis=2)
    assert (distance.min(axis=1) < size).all()
    assert (distance.min(axis=0) < size).all()
    for mine, other in zip(bounds(ours), theirs.bounds, strict=True):
        assert np.allclose(mine, other, atol=size)


def test_a_mirrored_node_turns_its_triangles_round(tmp_path):
    """So that the front of a closed mesh stays its outside."""
    loaded = load(square(scale=[-1, 1, 1]).write(tmp_path))
    a, b, c = loaded.frames[0][loaded.faces].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    assert loaded.faces[:, 0].tolist() == [0, 0]


POINTS = np.random.default_rng(0).random((5, 3)).astype("f4")


@pytest.mark.parametrize(("mode", "corners", "faces"), [
    (5, [4, 0, 1, 2, 3], [[4, 0, 1], [0, 2, 1], [1, 2, 3]]),
    (6, None, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]),
    *((mode, list(range(count)), []) for mode in (5, 6) for count in range(3)),
])  # fmt: skip
def test_strips_and_fans(tmp_path, mode, corners, faces):
    made = square()
    made.node(mesh=made.mesh(POINTS, None if corners is None else np.array(corners, "u1"), mode=mode))
    assert (load(made.write(tmp_path)).faces[2:] - 4).tolist() == faces


def test_primitives_share_their_vertices_and_what_is_left_out_is_noted(tmp_path):
    made = square()
    made.head["materials"] = [{}, {"alphaMode": "MASK"}, {"name": "unused"}]
    made.head["textures"] = [{"source": 0}]
    plain = made.primitive()
    strip, lines = ({"attributes": plain["attributes"], "mode": mode, "material": 1} for mode in (5, 1))
    made.head["meshes"][0]["primitives"] = [lines, strip, {"attributes": {}}, {**plain, "material": 0}]
    loaded = load(made.write(tmp_path))
    assert (loaded.faces.tolist(), len(loaded.frames[0])) == ([[0, 1, 2], [1, 3, 2], [0, 1, 2], [0, 2, 3]], 4)
    assert loaded.notes == (
        "1 primitive of points or lines left out", "1 primitive without positions left out",
        "2 materials and 1 texture left out", "1 material with transparency drawn opaque",
    )  # fmt: skip


def test_buffers_beside_the_file_and_within_it(tmp_path):
    made = square()
    (tmp_path / "sub folder").mkdir()
    (tmp_path / "sub folder" / "ü.bin").write_bytes(made.data)
    embedded = made.text()
    texts = {
        "beside.gltf": made.text("sub%20folder/%C3%BC.bin"),
        "plain.gltf": made.text("sub folder/ü.bin"),
        "embedded.gltf": embedded,
        "escaped.gltf": embedded.replace(b"application/octet-stream", rb"application\/octet-stream"),
        "marked.gltf": b"\xef\xbb\xbf" + embedded,
        "percent.gltf": made.text("data:," + "".join(f"%{byte:02x}" for byte in made.data)),
        "text_named.glb": embedded,
        "binary_named.gltf": square().glb(),
        "embedded_binary.glb": binary(json.loads(embedded)),
    }
    for name, text in texts.items():
        loaded = load(written(tmp_path, name, text))
        assert np.array_equal(loaded.frames[0], SQUARE), name
        assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert load(tmp_path / "embedded.gltf").files == (tmp_path / "embedded.gltf",)
    beside = load(tmp_path / "beside.gltf").files
    assert [path.name for path in beside] == ["beside.gltf", "ü.bin"]
    known = source(beside).sha256
    beside[1].write_bytes(made.data[:-1] + b"\7")
    assert source(beside).sha256 != known
    beside[1].write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
    with pytest.raises(UserError, match=r"ü\.bin: is a Git LFS pointer"):
        load(beside[0])


def test_large_embedded_data_are_no_json(tmp_path, monkeypatch):
    """Embedded images of any size are not parsed; only what is read is decoded."""
    monkeypatch.setattr(container, "_JSON_LIMIT", 1 << 12)
    made = square()
    made.text()
    image = "data:image/png;base64," + base64.b64encode(bytes(1 << 13)).decode()
    made.head["images"] = [{"uri": image}]
    path = written(tmp_path, "a.gltf", json.dumps(made.head).encode())
    assert len(load(path).faces) == 2


@pytest.mark.parametrize("uri", [
    "/etc/hostname", "../a.bin", "sub/../../a.bin", "http://host/a.bin", "file:///a.bin", "C:\\a.bin", "..\\a.bin",
    "%2e%2e/a.bin", "%2Fetc/hostname", "\\\\host\\a.bin",
])  # fmt: skip
def test_files_outside_the_folder_are_not_opened(tmp_path, uri):
    made = square()
    written(tmp_path, "a.bin", bytes(made.data))
    folder = tmp_path / "folder"
    folder.mkdir()
    refused(written(folder, "a.gltf", made.text(uri)), "outside the file's folder", "buffer 0")


@pytest.mark.parametrize("uri", ["absent.bin", ".", "x" * 1000 + ".bin"])
def test_a_missing_buffer_is_named(tmp_path, uri):
    path = written(tmp_path, "a.gltf", square().text(uri))
    line = refused(path, f"its buffer '{uri[:90]}", "is missing", "beside the file")
    assert len(line) < 600


@pytest.mark.parametrize("what", ["node", "animation"])
def test_what_a_missing_buffer_holds_is_left_out_where_that_is_allowed(tmp_path, what):
    made = square()
    made.node(mesh=made.mesh(), translation=[5, 0, 0])
    made.animate(translation=(0, [0, 1], [[0, 0, 0], [5, 0, 0]]))
    lost = made.primitive(1)["attributes"]["POSITION"] if what == "node" else len(made.head["accessors"]) - 1
    made.head["bufferViews"][made.head["accessors"][lost]["bufferView"]]["buffer"] = 1
    head = json.loads(made.text())
    head["buffers"].append({"byteLength": 100, "uri": "absent.bin"})
    path = written(tmp_path, "a.gltf", json.dumps(head))
    refused(path, "absent.bin")
    loaded = load(path, Wanted(allow_missing=True))
    assert (len(loaded.faces), len(loaded.frames)) == ((2, 25) if what == "node" else (4, 1))
    assert loaded.notes[0] == (
        "1 node left out, whose data are in a missing file"
        if what == "node"
        else "animation left out, whose data are in a missing file"
    )


def test_what_nothing_needs_refuses_nothing(tmp_path):
    """Bytes after the file, padding, an accessor that is not read, a camera without a lens."""
    made = square()
    made.add("accessors", {"bufferView": 77, "componentType": 1, "count": 1 << 60, "type": "VEC9"})
    made.add("bufferViews", {"buffer": 5, "byteLength": -1})
    made.add("cameras", {"type": "perspective"})
    made.node(camera=0)
    made.head["images"] = [{"uri": "../absent.png"}]
    made.head["materials"] = [{"extensions": {"VENDOR_anything": {}}}]
    blob = made.glb()
    chunk = b"\4\0\0\0ABCDwxyz"
    longer = blob[:8] + (len(blob) + len(chunk) + 5).to_bytes(4, "little") + blob[12:] + chunk + b"pad!!"
    for content in (blob, blob + b"\0", blob + b"trailing", longer):
        assert len(load(written(tmp_path, "a.glb", content)).faces) == 2
    assert load(tmp_path / "a.glb").cameras == {}
