"""glTF files: order, transforms, kinds of primitives, buffers and notes; broken ones are one line."""

import base64
import json

import numpy as np
import pytest
import trimesh
from helpers import mesh_files as files
from helpers.gltf_files import CORNERS, SQUARE, Gltf, bounds, square
from helpers.mesh_files import refused, written
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.readers.checks import Wanted
from shadowbench.harness.scene.readers.gltf import container
from shadowbench.harness.scene.readers.load import load, source


def test_transforms_and_order(tmp_path):
    loaded = load(written(tmp_path, "a.glb", files.glb()))
    assert loaded.faces.tolist() == [*map(list, files.FACES), *[[i + 5 for i in face] for face in files.FACES]]
    assert np.array_equal(loaded.frames[0], np.vstack([files.QUAD, files.QUAD + np.float32([10, 0, 0])]))
    assert loaded.up == (0, 1, 0)


def test_untouched_positions_keep_their_bits(tmp_path):
    loaded = load(written(tmp_path, "a.glb", square().glb()))
    assert loaded.frames[0].dtype == np.float32
    assert np.array_equal(loaded.frames[0], SQUARE)


@pytest.mark.parametrize("index", ["u1", "<u2"])
def test_small_indices_in_many_places(tmp_path, index):
    def change(head):
        head["nodes"] = [{"mesh": 0, "translation": [i, 0, 0]} for i in range(60)]
        head["scenes"] = [{"nodes": list(range(60))}]

    faces = load(written(tmp_path, "a.glb", files.glb(change=change, index=index))).faces
    assert np.array_equal(faces[-4:], np.array(files.FACES) + 59 * 5)


def test_the_order_is_that_of_the_scene_not_of_names(tmp_path):
    """Nodes named so that sorting by name would turn them round."""

    def change(head):
        head["nodes"] = [{"mesh": 0, "name": f"{9 - i}", "translation": [i, 0, 0]} for i in range(10)]
        head["scenes"] = [{"nodes": [3, 0, 1, 2, *range(4, 10)]}]

    loaded = load(written(tmp_path, "a.glb", files.glb(change=change)))
    assert loaded.frames[0][::5, 0].tolist() == [3, 0, 1, 2, 4, 5, 6, 7, 8, 9]


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


def test_strips_and_fans(tmp_path):
    made = Gltf()
    points = np.random.default_rng(0).random((5, 3)).astype("f4")
    strip = made.mesh(points, np.array([4, 0, 1, 2, 3], "u1"), mode=5)
    fan = made.mesh(points, None, mode=6)
    made.node(mesh=strip)
    made.node(mesh=fan, translation=[5, 0, 0])
    loaded = load(made.write(tmp_path))
    assert loaded.faces[:3].tolist() == [[4, 0, 1], [0, 2, 1], [1, 2, 3]]
    assert (loaded.faces[3:] - 5).tolist() == [[1, 2, 0], [2, 3, 0], [3, 4, 0]]


@pytest.mark.parametrize("mode", [5, 6])
@pytest.mark.parametrize("corners", [0, 1, 2])
def test_strips_and_fans_too_short_for_a_triangle(tmp_path, mode, corners):
    made = square()
    made.node(mesh=made.mesh(SQUARE, np.arange(corners, dtype="u1"), mode=mode), translation=[5, 0, 0])
    assert len(load(made.write(tmp_path)).faces) == 2


def test_several_meshes_modes_and_primitives(tmp_path):
    def change(head):
        solid, points = ({"attributes": {"POSITION": 0}, "indices": 1}, {"attributes": {"POSITION": 0}, "mode": 0})
        strip = {"attributes": {"POSITION": 0}, "mode": 5}
        head["meshes"] = [{"primitives": [solid]}, {"primitives": [points, strip, {"attributes": {}}, solid]}]
        head["nodes"] = [{"mesh": 1}]
        head["scenes"] = [{"nodes": [0]}]

    loaded = load(written(tmp_path, "a.glb", files.glb(change=change)))
    assert loaded.faces[3:].tolist() == [list(face) for face in files.FACES]
    assert len(loaded.frames[0]) == 5, "both primitives are of the same vertices"
    assert loaded.notes == ("1 primitive of points or lines left out", "1 primitive without positions left out")


def test_only_the_default_scene_is_read(tmp_path):
    made = square()
    made.head["scenes"].append({"nodes": [made.add("nodes", {"mesh": 0})], "name": "other"})
    assert len(load(made.write(tmp_path)).faces) == 2
    assert load(made.write(tmp_path)).notes == ("scene 'other' left out",)
    del made.head["scene"]
    assert len(load(made.write(tmp_path)).faces) == 2, "without a default it is the first"


def test_the_children_of_a_node_without_a_mesh_are_read(tmp_path):
    made = Gltf()
    above = made.node(camera=0, translation=[1, 0, 0])
    made.add("cameras", {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}})
    made.node(above, mesh=made.mesh(), translation=[0, 2, 0])
    assert bounds(load(made.write(tmp_path))) == ([1, 2, 0], [2, 3, 0])


def test_materials_are_noted(tmp_path):
    made = square()
    made.head["materials"] = [{}, {"alphaMode": "MASK"}, {"name": "unused"}]
    made.head["textures"] = [{"source": 0}]
    made.node(mesh=made.mesh(material=1), translation=[5, 0, 0])
    made.primitive()["material"] = 0
    assert load(made.write(tmp_path)).notes == (
        "2 materials and 1 texture left out",
        "1 material with transparency drawn opaque",
    )


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
        "embedded_binary.glb": _with_embedded_buffer(),
    }
    for name, text in texts.items():
        loaded = load(written(tmp_path, name, text))
        assert np.array_equal(loaded.frames[0], SQUARE), name
        assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    for name, beside in (("beside.gltf", ["ü.bin"]), ("embedded.gltf", [])):
        assert [path.name for path in load(tmp_path / name).files[1:]] == beside


def _with_embedded_buffer() -> bytes:
    made = square()
    made.text()
    embedded = made.head["buffers"]
    glb = made.glb()
    length = int.from_bytes(glb[12:16], "little")
    head = json.loads(glb[20 : 20 + length])
    head["buffers"] = embedded
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    chunk = len(text).to_bytes(4, "little") + b"JSON" + text
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunk)).to_bytes(4, "little") + chunk


def test_every_byte_of_a_buffer_counts_in_the_record(tmp_path):
    path = square().write(tmp_path, "a.gltf")
    known = source(load(path).files).sha256
    buffer = path.with_suffix(".bin")
    blob = buffer.read_bytes()
    for at in (0, 47):
        buffer.write_bytes(blob[:at] + bytes([blob[at] ^ 1]) + blob[at + 1 :])
        assert source(load(path).files).sha256 != known
    buffer.write_bytes(blob)
    assert source(load(path).files).sha256 == known


def test_a_buffer_that_is_a_pointer_of_git_lfs_is_named(tmp_path):
    path = square().write(tmp_path, "a.gltf")
    path.with_suffix(".bin").write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
    with pytest.raises(UserError, match=r"a\.bin: is a Git LFS pointer"):
        load(path)


SHAPES = {
    "box": trimesh.creation.box(),
    "ball": trimesh.creation.icosphere(2),
    "ring": trimesh.creation.annulus(1, 2, 0.5),
    "capsule": trimesh.creation.capsule(),
    "cone": trimesh.creation.cone(1, 2),
}


@pytest.mark.parametrize("suffix", ["glb", "gltf", "draco.glb"])
def test_files_of_trimesh_have_its_bounds_and_counts(tmp_path, suffix):
    scene = trimesh.Scene()
    for i, shape in enumerate(SHAPES.values()):
        turn = trimesh.transformations.random_rotation_matrix(np.random.default_rng(i).random(3))
        turn[:3, 3] = [3 * i, i, -i]
        scene.add_geometry(shape, node_name=f"n{i}", transform=turn, parent_node_name=f"n{i - 1}" if i else None)
    path = tmp_path / f"a.{suffix}"
    if suffix == "gltf":
        for name, blob in scene.export(file_type="gltf").items():
            (tmp_path / name.replace("model.gltf", path.name)).write_bytes(blob)
    else:
        path.write_bytes(scene.export(file_type="glb", extension_draco="draco" in suffix))
    ours, theirs = load(path), trimesh.load_scene(path, process=False)
    assert len(ours.faces) == sum(len(shape.faces) for shape in SHAPES.values())
    assert np.allclose(bounds(ours), theirs.bounds, atol=1e-6)
    assert np.allclose(bounds(ours), scene.bounds, atol=1e-3 if "draco" in suffix else 1e-5)


def test_large_embedded_data_are_no_json(tmp_path, monkeypatch):
    """Embedded images of any size are not parsed; only what is read is decoded."""
    monkeypatch.setattr(container, "_JSON_LIMIT", 1 << 12)
    made = square()
    made.text()
    image = "data:image/png;base64," + base64.b64encode(bytes(1 << 13)).decode()
    made.head["images"] = [{"uri": image}]
    path = written(tmp_path, "a.gltf", json.dumps(made.head).encode())
    assert len(load(path).faces) == 2


@pytest.mark.parametrize(
    "uri",
    [
        "/etc/hostname", "../a.bin", "sub/../../a.bin", "http://host/a.bin", "file:///a.bin", "C:\\a.bin", "..\\a.bin",
        "%2e%2e/a.bin", "%2Fetc/hostname", "\\\\host\\a.bin",
    ],
)  # fmt: skip
def test_files_outside_the_folder_are_not_opened(tmp_path, uri):
    made = square()
    written(tmp_path, "a.bin", bytes(made.data))
    folder = tmp_path / "folder"
    folder.mkdir()
    refused(written(folder, "a.gltf", made.text(uri)), "outside the file's folder", "buffer 0")


def test_a_missing_buffer_is_named(tmp_path):
    made = square()
    for uri in ("absent.bin", "."):
        path = written(tmp_path, "a.gltf", made.text(uri))
        refused(path, f"its buffer '{uri}' is missing", "beside the file")
    long = "x" * 1000 + ".bin"
    assert len(refused(written(tmp_path, "a.gltf", made.text(long)), "is missing")) < 600


def test_what_a_missing_buffer_holds_is_left_out_where_that_is_allowed(tmp_path):
    made = square()
    lost = made.mesh()
    made.node(mesh=lost, translation=[5, 0, 0])
    index = made.primitive(lost)["attributes"]["POSITION"]
    made.head["bufferViews"][made.head["accessors"][index]["bufferView"]]["buffer"] = 1
    path = made.write(tmp_path, "a.gltf")
    head = json.loads(path.read_text())
    head["buffers"].append({"byteLength": 100, "uri": "absent.bin"})
    path.write_text(json.dumps(head))
    refused(path, "absent.bin")
    loaded = load(path, Wanted(allow_missing=True))
    assert len(loaded.faces) == 2
    assert loaded.notes == ("1 node left out, whose data are in a missing file",)


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
