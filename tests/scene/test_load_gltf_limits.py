"""glTF files that promise more than they hold, and damaged ones: linear memory, and one line for each refusal."""

import contextlib
import itertools
import json

import numpy as np
import pytest
from helpers.fuzzed_inputs import READ, REFUSED
from helpers.gltf_files import SQUARE, Gltf, binary
from helpers.gltf_samples import FACES, POINTS, draco, everything, packed
from helpers.mesh_files import refused, written
from helpers.reader_fuzz import outcome, within_memory
from helpers.traced_memory import traced_memory
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.readers.gltf import model
from shadowbench.harness.scene.readers.load import load

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
    assert len(loaded.faces) == 600
    assert len(loaded.frames[0]) == (600 if shared else 2_400)
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


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b'{"a":' + b"[" * 100_000 + b"]" * 100_000 + b"}", "JSON part cannot be read"),
        (b'{"a": [' + b"0," * (1 << 24) + b"0]}", "bytes, more than 33554432"),
    ],
    ids=["nested", "long"],
)
def test_a_json_part_beyond_reason(tmp_path, content, word):
    refused(written(tmp_path, "a.gltf", content), word)


def test_counts_that_the_file_does_not_hold_take_no_memory(tmp_path):
    for accessor in range(len(everything().head["accessors"])):
        for count in (10**5, 10**12):
            changed = everything()
            changed.head["accessors"][accessor]["count"] = count
            with contextlib.suppress(UserError):
                within_memory(changed.write(tmp_path))
