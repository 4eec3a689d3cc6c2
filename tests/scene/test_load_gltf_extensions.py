"""glTF: data in other forms, and extensions; what changes the triangles is read or refused by name."""

import sys

import meshopt
import numpy as np
import pytest
from helpers.gltf_samples import CORNERS, DRACO, FACES, POINTS, SQUARE, Gltf, bounds, draco, instanced, packed, square
from helpers.mesh_files import refused
from shadowbench.harness.scene.readers.load import load


def test_sparse_positions(tmp_path):
    """Three of the values of an accessor are in others' place, with and without an array of its own below them."""
    made = square()
    sparse = {
        "count": 1,
        "indices": {"bufferView": made.view(np.uint16(2).tobytes()), "componentType": 5123},
        "values": {"bufferView": made.view(np.float32([1, 1, 2]).tobytes())},
    }
    made.head["accessors"][0]["sparse"] = sparse
    assert bounds(load(made.write(tmp_path))) == ([0, 0, 0], [1, 1, 2])
    del made.head["accessors"][0]["bufferView"]
    assert load(made.write(tmp_path)).frames[0].tolist() == [[0, 0, 0], [0, 0, 0], [1, 1, 2], [0, 0, 0]]
    made.head["accessors"][0]["count"] = 1 << 30
    refused(made.write(tmp_path), "elements, but no data")
    made.head["accessors"][0]["count"] = 4
    sparse["indices"]["byteOffset"] = 1 << 20
    refused(made.write(tmp_path), "accessor 0 (sparse) needs")
    del sparse["indices"]["byteOffset"]
    made.data[made.head["bufferViews"][sparse["indices"]["bufferView"]]["byteOffset"]] = 4
    refused(made.write(tmp_path), "accessor 0 (sparse) names element 4, but there are 4")


def test_interleaved_attributes(tmp_path):
    rows = np.zeros(4, dtype=[("normal", "<f4", 3), ("position", "<f4", 3), ("color", "u1", 4)])
    rows["position"] = SQUARE
    made = square()
    view = made.view(rows.tobytes()[:-4], byteStride=28)
    made.head["accessors"][0].update(bufferView=view, byteOffset=12)
    assert np.array_equal(load(made.write(tmp_path)).frames[0], SQUARE)
    made.head["accessors"][0]["byteOffset"] = 13
    refused(made.write(tmp_path), "accessor 0 needs")


@pytest.mark.parametrize(("kind", "normalized", "one"), [
    ("i2", False, 1), ("u2", False, 1), ("i1", True, 127), ("u1", True, 255), ("i2", True, 32767),
    ("u2", True, 65535), ("i1", True, -128),
])  # fmt: skip
def test_quantised_positions(tmp_path, kind, normalized, one):
    """The most negative integer is minus one."""
    made = square()
    rows = np.zeros((4, 4), dtype=kind)
    rows[:, :3] = SQUARE * np.array(one, dtype=kind)
    place = made.accessor(rows, kind, type="VEC3", normalized=normalized)
    made.head["bufferViews"][-1]["byteStride"] = rows.strides[0]
    made.primitive()["attributes"]["POSITION"] = place
    made.head["extensionsRequired"] = ["KHR_mesh_quantization"]
    assert np.array_equal(load(made.write(tmp_path)).frames[0], SQUARE * np.sign(one))


def test_default_weights_of_morph_targets(tmp_path):
    made = square()
    up = made.sparse(4, 1, [0, 0, 3])
    made.primitive()["targets"] = [{"POSITION": up}, {"NORMAL": up}, {"POSITION": up}]
    assert bounds(load(made.write(tmp_path))) == ([0, 0, 0], [1, 1, 0])
    made.head["meshes"][0]["weights"] = [1, 1, 0]
    assert bounds(load(made.write(tmp_path))) == ([0, 0, 0], [1, 1, 3])
    made.head["nodes"][0]["weights"] = [0.5, 0, 1]
    assert bounds(load(made.write(tmp_path))) == ([0, 0, 0], [1, 1, 4.5])
    made.head["accessors"][up]["count"] = 3
    refused(made.write(tmp_path), "a morph target has 3 vertices, its primitive 4")


def test_instances_are_turned_scaled_and_moved_with_their_node(tmp_path):
    """The transform of the node comes after that of the instance, which has parts in the order of a node's."""
    half = 0.5**0.5
    made = instanced(
        {
            "TRANSLATION": [[1, 0, 0], [0, 0, 1]],
            "ROTATION": [[0, 0, half, half], [0, 0, 0, 2]],
            "SCALE": [[2, 2, 2], [1, -1, 1]],
        },
        translation=[0, 100, 0],
        scale=[10, 10, 10],
    )
    points = load(made.write(tmp_path)).frames[0]
    turned = 2 * SQUARE[:, [1, 0, 2]] * [-1, 1, 1] + [1, 0, 0]
    expected = np.concatenate([turned, SQUARE * [1, -1, 1] + [0, 0, 1]]) * 10 + [0, 100, 0]
    assert np.allclose(points, expected, atol=1e-5)
    faces = load(made.write(tmp_path)).faces
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]], "the mirrored one is turned round"


def test_hidden_nodes(tmp_path):
    made = Gltf()
    above = made.node(mesh=made.mesh())
    made.node(above, mesh=0, translation=[5, 0, 0])
    made.node(mesh=0, translation=[9, 0, 0])
    made.extend(made.head["nodes"][above], "KHR_node_visibility", {"visible": False})
    assert bounds(load(made.write(tmp_path))) == ([9, 0, 0], [10, 1, 0])
    made.head["nodes"][above]["extensions"]["KHR_node_visibility"]["visible"] = "no"
    refused(made.write(tmp_path), "not true or false")


@pytest.mark.parametrize("where", [
    lambda head: head, lambda head: head["scenes"][0], lambda head: head["nodes"][0], lambda head: head["meshes"][0],
    lambda head: head["meshes"][0]["primitives"][0], lambda head: head["accessors"][0],
    lambda head: head["bufferViews"][0],
])  # fmt: skip
def test_unknown_extensions_are_refused_by_name(tmp_path, where):
    """Wherever they stand, if that is read; one that looks alone is known by its name."""
    made = square()
    made.extend(where(made.head), "VENDOR_moves_things", {})
    refused(made.write(tmp_path), "VENDOR_moves_things", "may change its triangles")
    made = square()
    made.extend(where(made.head), "EXT_structural_metadata", {})
    made.extend(where(made.head), "VENDOR_materials_shiny", {})
    assert len(load(made.write(tmp_path)).faces) == 2


def test_required_extensions(tmp_path):
    made = square()
    made.head["extensionsUsed"] = ["VENDOR_moves_things", "KHR_texture_basisu"]
    made.head["extensionsRequired"] = ["KHR_texture_basisu"]
    assert len(load(made.write(tmp_path)).faces) == 2, "one that stands nowhere does nothing"
    made.head["extensionsRequired"] = ["KHR_texture_basisu", "VENDOR_moves_things"]
    refused(made.write(tmp_path), "needs the extension VENDOR_moves_things")


def test_unknown_extensions_of_what_is_not_read_do_nothing(tmp_path):
    made = square()
    made.add("meshes", {"primitives": [], "extensions": {"VENDOR_moves_things": {}}})
    made.add("nodes", {"mesh": 1, "extensions": {"VENDOR_moves_things": {}}})
    splats = {"attributes": {"POSITION": 0}, "mode": 0, "extensions": {"KHR_gaussian_splatting": {}}}
    made.head["meshes"][0]["primitives"].append(splats)
    assert load(made.write(tmp_path)).notes == ("1 primitive of points or lines left out",)


# --- compression ----------------------------------------------------------------------------------------------


def test_draco(tmp_path):
    loaded = load(draco(POINTS, FACES).write(tmp_path))
    found, expected = loaded.frames[0][loaded.faces], POINTS[FACES.reshape(-1, 3)]
    assert np.allclose(found, expected, atol=1e-6)


def test_draco_beside_plain_data_is_not_needed(tmp_path):
    made = square()
    made.extend(made.primitive(), DRACO, {"bufferView": 99, "attributes": {}})
    assert np.array_equal(load(made.write(tmp_path)).frames[0], SQUARE)


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_meshopt(tmp_path, name):
    made = packed(POINTS, FACES, name)
    loaded = load(made.write(tmp_path))
    assert np.array_equal(loaded.frames[0], POINTS)
    assert np.array_equal(np.sort(loaded.faces), np.sort(FACES.reshape(-1, 3)))


def test_meshopt_with_a_filter(tmp_path):
    """Exponents and mantissas of 24 bits hold the corners of a square exactly."""
    made = packed(POINTS, FACES)
    values = meshopt.encode_filter_exp(SQUARE, 24)
    view = made.view(meshopt.encode_gltf_buffer(values, "ATTRIBUTES"))
    how = {"byteStride": 12, "count": 4, "mode": "ATTRIBUTES", "filter": "EXPONENTIAL"}
    said = {**made.head["bufferViews"].pop(view), **how}
    made.head["bufferViews"][0].update(byteLength=48, extensions={"EXT_meshopt_compression": said})
    made.head["accessors"][0]["count"] = 4
    made.head["bufferViews"][1] = {"buffer": 0, "byteOffset": len(made.data), "byteLength": 24}
    made.data += CORNERS.astype("u4").tobytes()
    made.head["accessors"][1]["count"] = 6
    assert np.array_equal(load(made.write(tmp_path)).frames[0], SQUARE)


@pytest.mark.parametrize(
    ("package", "content"), [("DracoPy", draco(POINTS, FACES)), ("meshopt", packed(POINTS, FACES))]
)
def test_without_the_decoder_the_line_says_what_to_install(tmp_path, monkeypatch, package, content):
    monkeypatch.setitem(sys.modules, package, None)
    refused(content.write(tmp_path), f"needs the package {package}", f"pip install {package}")
