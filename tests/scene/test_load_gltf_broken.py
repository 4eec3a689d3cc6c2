"""glTF files that are broken, damaged or promise more than they hold: one line for each refusal, in linear memory."""

import contextlib
import itertools
import json

import numpy as np
import pytest
from helpers.fuzzed_inputs import READ, REFUSED
from helpers.gltf_samples import (
    FACES,
    POINTS,
    SQUARE,
    Gltf,
    binary,
    draco,
    everything,
    instanced,
    moved,
    packed,
    skinned,
    square,
)
from helpers.mesh_files import refused, traced_memory, written
from helpers.reader_fuzz import outcome, within_memory
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.readers.gltf import model
from shadowbench.harness.scene.readers.load import load


def twice() -> Gltf:
    """A square that hangs in a node and below another one."""
    made = square()
    made.node(made.node(), mesh=0, translation=[10, 0, 0])
    return made


def lit() -> Gltf:
    made = square()
    made.extend(made.head, "KHR_lights_punctual", {"lights": [{"type": "point"}]})
    made.node(extensions={"KHR_lights_punctual": {"light": 0}})
    return made


SAMPLES = {
    "nodes": twice(),
    "skin": skinned(),
    "moved": moved(translation=([0, 1], [[0, 0, 0], [5, 0, 0]])),
    "lit": lit(),
    "draco": draco(POINTS, FACES),
    "meshopt": packed(POINTS, FACES),
}
GONE = object()
PRIMITIVE = "meshes 0 primitives 0"
PACKED = "bufferViews 0 extensions EXT_meshopt_compression"
CHANNEL = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
INSTANCES = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}


@pytest.mark.parametrize(("sample", "place", "value", "word"), [
    ("nodes", "accessors 0 count", 2_000_000_000, "accessor 0 needs"),
    ("nodes", "accessors 1 count", -3, "not a whole number"),
    ("nodes", "accessors 1 count", True, "not a whole number"),
    ("nodes", "accessors 1 count", 5, "not a multiple of 3"),
    ("nodes", "accessors 1 byteOffset", 4, "accessor 1 needs"),
    ("nodes", "accessors 0 componentType", 5130, "accessor 0"),
    ("nodes", "accessors 0 componentType", 5125, "not 3 floats"),
    ("nodes", "accessors 0 type", "VEC2", "not 3 floats"),
    ("nodes", "accessors 1 componentType", 5122, "unsigned integers"),
    ("nodes", "bufferViews 1 byteOffset", 1 << 30, "buffer view 1"),
    ("nodes", "bufferViews 1 byteOffset", 12, "names vertex"),
    ("nodes", "bufferViews 0 byteStride", 1, "stride"),
    ("nodes", "bufferViews 0 buffer", 1, "buffer view 0 names buffer 1"),
    ("nodes", "nodes 2", {"children": [1]}, "has two parents"),
    ("nodes", "nodes 2 children", [77], "node 77"),
    ("nodes", "nodes 2", {"children": [0]}, "has two parents"),
    ("nodes", "nodes 0 mesh", 7, "node 0 names mesh 7"),
    ("nodes", "nodes 2 translation", [0, 1], "not 3 finite numbers"),
    ("nodes", "nodes 2 translation", [0, 1, 1e999], "Infinity"),
    ("nodes", "nodes 2 translation", [0, 1, 10**400], "not 3 finite numbers"),
    ("nodes", "nodes 2 matrix", [1] * 15, "not 16 finite numbers"),
    ("nodes", "nodes 2 matrix", [1] * 16, "last row is not 0, 0, 0, 1"),
    ("nodes", "nodes 2 matrix", np.eye(4).ravel().tolist(), "node 2 has both a matrix and a translation"),
    ("nodes", f"{PRIMITIVE} mode", 7, "mode 7"),
    ("nodes", f"{PRIMITIVE} mode", 1, "no triangles"),
    ("nodes", f"{PRIMITIVE} indices", 9, "names accessor 9"),
    ("nodes", "meshes", [], "names mesh 0"),
    ("nodes", "nodes", "no list", "nodes is not a list"),
    ("nodes", "nodes", [3, 4, 5], "node 0 is not an object"),
    ("nodes", "scenes", [], "no scene"),
    ("nodes", "scene", 5, "names scene 5"),
    ("nodes", "buffers", [], "names buffer 0"),
    ("skin", "skins 0 joints", [1], "names joint 1, but its skin has 1"),
    ("skin", "skins 0 joints 0", 9, "its joint 9 is no node of the scene"),
    ("skin", "skins 0 joints", [], "has no joints"),
    ("skin", "skins 0 joints", [1, 0, 0], "3 joints, but 2 matrices"),
    ("skin", f"{PRIMITIVE} attributes JOINTS_0", GONE, "a primitive has no joints"),
    ("skin", f"{PRIMITIVE} attributes WEIGHTS_0", GONE, "joints without weights"),
    ("skin", "nodes 2 extensions", INSTANCES, "both a skin and instances"),
    ("moved", "nodes 0 matrix", np.eye(4).ravel().tolist(), "moves node 0, which has a matrix"),
    ("moved", "animations 0 channels", [CHANNEL] * 2, "two channels for the translation of node 0"),
    ("moved", "animations 0 channels 0 sampler", 3, "names sampler 3"),
    ("moved", "animations 0 channels 0 target path", "color", "animates 'color'"),
    ("lit", "nodes 1 extensions KHR_lights_punctual light", 3, "names light 3, but there are 1"),
    ("lit", "extensions KHR_lights_punctual lights 0 color", [1, 1], "color is not 3 finite numbers"),
    ("draco", "accessors 0 count", 1 << 30, "its compressed data (50, 3)"),
    ("draco", f"{PRIMITIVE} extensions KHR_draco_mesh_compression attributes POSITION", 77, "compressed data nothing"),
    ("draco", "bufferViews 0 byteLength", 60, "cannot be decompressed"),
    ("meshopt", f"{PACKED} count", 1 << 30, "buffer view 0 unpacks"),
    ("meshopt", f"{PACKED} count", 49, "accessor 0 needs 600 bytes, its view has 588"),
    ("meshopt", f"{PACKED} mode", "POINTS", "buffer view 0: its compression has the mode 'POINTS'"),
    ("meshopt", f"{PACKED} filter", "NOISE", "buffer view 0 cannot be decompressed"),
    ("meshopt", f"{PACKED} byteStride", 5, "buffer view 0 cannot be decompressed"),
    ("meshopt", f"{PACKED} byteOffset", 1 << 20, "buffer view 0 reaches beyond"),
])  # fmt: skip
def test_a_wrong_value_is_named(tmp_path, sample, place, value, word):
    made = SAMPLES[sample]
    made.glb()
    head = json.loads(json.dumps(made.head))
    holder = head
    *path, last = (int(key) if key.isdigit() else key for key in place.split())
    for key in path:
        holder = holder[key]
    if value is GONE:
        del holder[last]
    else:
        holder[last] = value
    refused(written(tmp_path, "a.glb", binary(head, bytes(made.data))), word)


@pytest.mark.parametrize(("attributes", "word"), [
    ({"TRANSLATION": [[0, 0, 0]], "SCALE": [[1, 1, 1]] * 2}, "[1, 2]"), ({"TRANSLATION": [[0, 0]]}, "not 3 floats"),
    ({}, "counts []"),
])  # fmt: skip
def test_broken_instances(tmp_path, attributes, word):
    refused(instanced(attributes).write(tmp_path), word)


@pytest.mark.parametrize(("times", "values", "how", "word"), [
    ([0, 0], [[0, 0, 0]] * 2, (), "do not increase"),
    ([1, 0], [[0, 0, 0]] * 2, (), "do not increase"),
    ([0, np.nan], [[0, 0, 0]] * 2, (), "do not increase"),
    ([], np.zeros((0, 3)), (), "do not increase"),
    ([0, 1], [[0, 0, 0]] * 3, (), "9 numbers for 2 keys of the translation, not 6"),
    ([0, 1], [[0, 0, 0]] * 2, ("CUBICSPLINE",), "not 18"),
    ([0, 1], [[0, 0, 0]] * 2, ("BEZIER",), "interpolation 'BEZIER'"),
    ([0, 1], [[0, 0, 0, 1]] * 2, (), "not 3 floats"),
    ([0, 1], [[0, 0, np.inf]] * 2, (), "not finite"),
    ([0, 1e9], [[0, 0, 0]] * 2, (), "2.4e+10 frames"),
])  # fmt: skip
def test_broken_animations(tmp_path, times, values, how, word):
    refused(moved(translation=(times, values, *how)).write(tmp_path), "animation 0", word)


@pytest.mark.parametrize(("content", "word"), [
    (b"", "JSON part cannot be read"),
    (b"glTF\1\0\0\0" + bytes(12), "glTF version 1"),
    (b"[]", "not an object"),
    (b'{"asset": {"version": "1.0"}, "scenes": {}}', "glTF version 1.0"),
    (b'{"asset": {"version": "2.1", "minVersion": "2.1"}}', "glTF version 2.1"),
    (b'{"asset": {"version": "2.1"}}', "no scene"),
    (b'{"a": 1', "JSON part cannot be read"),
    (b'{"scenes": [{"nodes": []}]}', "no triangles"),
    (square().text("data:application/octet-stream;base64,AAA"), "base64"),
    (square().text("data:application/octet-stream;base64"), "no comma"),
    (square().text("data:application/octet-stream;base64,AAAA"), "accessor 0 needs"),
])  # fmt: skip
def test_broken_texts(tmp_path, content, word):
    refused(written(tmp_path, "a.gltf", content), word)


CASES = 1
"""Values that are tried in each place of a JSON part."""


def primitives(count: int, shared: bool) -> Gltf:
    """A mesh of many primitives, each with vertices of its own or all of the same."""
    made = Gltf()
    everything = made.accessor(np.random.default_rng(0).random((count, 3))) if shared else -1
    parts = []
    for i in range(count):
        corners = made.accessor(np.arange(i, i + 3) % (count if shared else 4), "u4")
        parts.append(
            {"attributes": {"POSITION": everything if shared else made.accessor(SQUARE + i)}, "indices": corners}
        )
    made.node(mesh=made.add("meshes", {"primitives": parts}))
    return made


@pytest.mark.parametrize("shared", [True, False])
def test_memory_grows_with_the_file_not_with_its_primitives(tmp_path, shared):
    """Of one array of vertices, 20,000 primitives would hold it 20,000 times: 5 GB."""
    path = primitives(600, shared).write(tmp_path)
    with traced_memory() as most:
        loaded = load(path)
        peak = most()
    assert (len(loaded.faces), len(loaded.frames[0])) == (600, (600 if shared else 2_400))
    assert peak < 20 * path.stat().st_size, f"{peak / path.stat().st_size:.1f} times the file"


def test_nodes_at_one_place_share_their_vertices_and_too_many_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(model, "_DRAWN", 1 << 20)
    made = Gltf()
    points = made.accessor(np.random.default_rng(0).random((20_000, 3)))
    for i in range(100):
        primitive = {"attributes": {"POSITION": points}, "indices": made.accessor(np.arange(3) + i, "u4")}
        made.node(mesh=made.add("meshes", {"primitives": [primitive]}))
    loaded = load(made.write(tmp_path))
    assert (len(loaded.faces), len(loaded.frames[0])) == (100, 20_000)
    for i, node in enumerate(made.head["nodes"]):
        node["translation"] = [0, 0, i]
    refused(made.write(tmp_path), "vertices with instances, more than 1048576")


def test_a_few_bytes_that_name_many_triangles(tmp_path, monkeypatch):
    monkeypatch.setattr(model, "_DRAWN", 1 << 16)
    made = Gltf()
    mesh = made.mesh()
    made.head["meshes"][0]["primitives"] *= 300
    for i in range(300):
        made.node(mesh=mesh, translation=[i, 0, 0])
    refused(made.write(tmp_path), "has 180000 triangles with instances, more than 65536")


def test_nodes_nested_beyond_reason(tmp_path):
    made = Gltf()
    node = None
    for _ in range(3_000):
        node = made.node(node, translation=[1, 0, 0])
    made.head["nodes"][node]["mesh"] = made.mesh()
    assert load(made.write(tmp_path)).frames[0][0].tolist() == [3_000, 0, 0]


VALUES = [
    0, 1, 2, 3, 4, 5, 6, 12, 5121, 5126, -1, 1 << 31, 1 << 62, 10**30, 0.5, -0.0, 1e300, None, True, False, "", "x",
    "TRIANGLES", "VEC3", "data:,", "STEP", [], [0], [0, 0, 0], [[]], {}, {"POSITION": 0}, {"extensions": {"A_b": {}}},
]  # fmt: skip


def leaves(entry):
    """Every place in a JSON part: what holds it, and its key."""
    for key, value in entry.items() if isinstance(entry, dict) else enumerate(entry):
        yield entry, key
        if isinstance(value, dict | list):
            yield from leaves(value)


SEEDS = {"everything": everything(), "draco": draco(POINTS, FACES), "meshopt": packed(POINTS, FACES)}


@pytest.mark.parametrize("name", SEEDS)
def test_values_replaced(tmp_path, name):
    """At each place of the JSON part in turn, one value after the other; and entries that are gone."""
    made, path = SEEDS[name], tmp_path / "a.glb"
    made.glb()
    places, values = len(list(leaves(made.head))), itertools.cycle(VALUES)
    outcomes = set()
    for k in range(CASES * places):
        changed = json.loads(json.dumps(made.head))
        holder, key = list(leaves(changed))[k % places]
        if k % 7 == 6:
            del holder[key]
        else:
            holder[key] = next(values)
        path.write_bytes(binary(changed, bytes(made.data)))
        outcomes.add(outcome(path, load))
    assert outcomes == {READ, REFUSED}


@pytest.mark.parametrize(("content", "word"), [
    (b'{"a":' + b"[" * 100_000 + b"]" * 100_000 + b"}", "JSON part cannot be read"),
    (b'{"a": [' + b"0," * (1 << 24) + b"0]}", "bytes, more than 33554432"),
], ids=["nested", "long"])  # fmt: skip
def test_a_json_part_beyond_reason(tmp_path, content, word):
    refused(written(tmp_path, "a.gltf", content), word)


def test_counts_that_the_file_does_not_hold_take_no_memory(tmp_path):
    for accessor in range(len(everything().head["accessors"])):
        for count in (10**5, 10**12):
            changed = everything()
            changed.head["accessors"][accessor]["count"] = count
            with contextlib.suppress(UserError):
                within_memory(changed.write(tmp_path))
