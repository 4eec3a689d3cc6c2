"""glTF files that promise more than they hold, and damaged ones: linear memory, and one line for each refusal."""

import itertools
import json
import struct
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
from helpers.gltf_files import SQUARE, Gltf, binary
from helpers.mesh_files import refused
from scene.test_load_gltf_extensions import FACES, POINTS, draco, packed
from scene.test_load_gltf_moving import skinned
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.readers.load import load

CASES = 3000
"""Damaged files of each kind of damage, over all seeds."""


def primitives(count: int, shared: bool) -> Gltf:
    """A mesh of many primitives, each with vertices of its own or all of the same."""
    made = Gltf()
    everything = made.accessor(np.random.default_rng(0).random((count, 3))) if shared else -1
    parts = []
    for i in range(count):
        corners = made.accessor(np.arange(i, i + 3) % (count if shared else 4), "u4")
        parts.append(
            {
                "attributes": {"POSITION": everything if shared else made.accessor(SQUARE + i)},
                "indices": corners,
            }
        )
    made.node(mesh=made.add("meshes", {"primitives": parts}))
    return made


@pytest.mark.parametrize("shared", [True, False])
def test_memory_grows_with_the_file_not_with_its_primitives(tmp_path, shared):
    """Of one array of vertices, 20,000 primitives would hold it 20,000 times: 5 GB."""
    path = primitives(5_000, shared).write(tmp_path)
    tracemalloc.start()
    try:
        loaded = load(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(loaded.faces) == 5_000
    assert len(loaded.frames[0]) == (5_000 if shared else 20_000)
    assert peak < 20 * path.stat().st_size, f"{peak / path.stat().st_size:.1f} times the file"


def test_nodes_at_one_place_share_their_vertices_and_too_many_are_refused(tmp_path):
    made = Gltf()
    points = made.accessor(np.random.default_rng(0).random((20_000, 3)))
    for i in range(2000):
        primitive = {"attributes": {"POSITION": points}, "indices": made.accessor(np.arange(3) + i, "u4")}
        made.node(mesh=made.add("meshes", {"primitives": [primitive]}))
    loaded = load(made.write(tmp_path))
    assert (len(loaded.faces), len(loaded.frames[0])) == (2000, 20_000)
    for i, node in enumerate(made.head["nodes"]):
        node["translation"] = [0, 0, i]
    refused(made.write(tmp_path), "vertices with instances, more than 33554432")


def test_a_few_bytes_that_name_many_triangles(tmp_path):
    made = Gltf()
    mesh = made.mesh()
    made.head["meshes"][0]["primitives"] *= 4000
    for i in range(6000):
        made.node(mesh=mesh, translation=[i, 0, 0])
    refused(made.write(tmp_path), "triangles with instances, more than 33554432")


def test_nodes_nested_beyond_reason(tmp_path):
    made = Gltf()
    node = None
    for _ in range(20_000):
        node = made.node(node, translation=[1, 0, 0])
    made.head["nodes"][node]["mesh"] = made.mesh()
    assert load(made.write(tmp_path)).frames[0][0].tolist() == [20_000, 0, 0]


def everything() -> Gltf:
    """A file with all that is read: every kind of accessor, primitive, node, animation, camera and light."""
    made = skinned()
    rng = np.random.default_rng(7)
    sparse = {
        "count": 1,
        "indices": {"bufferView": made.view(b"\2\0"), "componentType": 5123},
        "values": {"bufferView": made.view(np.float32([0, 0, 5]).tobytes())},
    }
    target = made.add("accessors", {"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse})
    made.primitive()["targets"] = [{"POSITION": target}]
    small = made.accessor(rng.integers(-100, 100, (4, 4)), "i1", type="VEC3", normalized=True)
    made.head["bufferViews"][-1]["byteStride"] = 4
    strip = {"attributes": {"POSITION": small}, "mode": 5, "material": 0}
    lines = {"attributes": {"POSITION": small}, "mode": 1}
    fan = {"attributes": {"POSITION": small}, "mode": 6, "indices": made.accessor(np.arange(4), "u1")}
    mesh = made.add("meshes", {"primitives": [strip, lines, fan]})
    node = made.node(mesh=mesh, matrix=np.diag([1, -1, 1, 1]).ravel().tolist(), camera=0)
    places = made.accessor(rng.random((3, 3)))
    made.extend(made.head["nodes"][node], "EXT_mesh_gpu_instancing", {"attributes": {"TRANSLATION": places}})
    made.extend(made.head["nodes"][node], "KHR_node_visibility", {"visible": True})
    made.extend(made.head["nodes"][node], "KHR_lights_punctual", {"light": 0})
    made.extend(
        made.head, "KHR_lights_punctual", {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}}]}
    )
    made.add("cameras", {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}})
    made.add("materials", {"alphaMode": "BLEND", "name": "glass"})
    made.head["scenes"].append({"nodes": [0], "name": "other"})
    made.animate(
        translation=(0, [0, 0.2], rng.random((2, 3)), "STEP"),
        rotation=(1, [0, 0.1], rng.random((2, 4))),
        scale=(0, [0, 0.1], rng.random((6, 3)), "CUBICSPLINE"),
        weights=(2, [0, 0.2], [0, 1]),
    )
    return made


def seeds() -> dict[str, bytes]:
    return {
        "everything.glb": everything().glb(),
        "everything.gltf": everything().text(),
        "draco.glb": draco(POINTS, FACES).glb(),
        "meshopt.glb": packed(POINTS, FACES).glb(),
    }


def survives(path: Path) -> bool:
    """Whether the file is read; False where it is refused in one line. Nothing else may happen."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            loaded = load(path)
    except UserError as error:
        line = str(error)
        assert "\n" not in line
        assert len(line) < 600
        assert path.name in line
        return False
    assert len(loaded.faces)
    assert 0 <= loaded.faces.min() <= loaded.faces.max() < len(loaded.frames[0])
    assert all(frame.shape == loaded.frames[0].shape for frame in loaded.frames)
    return True


def test_seeds_are_read(tmp_path):
    for name, blob in seeds().items():
        path = tmp_path / name
        path.write_bytes(blob)
        assert survives(path)
        assert len(load(path).frames) == (7 if "everything" in name else 1)


def grown(run) -> int:
    """Bytes of Python's and numpy's memory that ``run`` leaves behind, once what it keeps the first time is kept."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        run()
        return tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", seeds())
def test_flipped_bytes(tmp_path, name):
    blob, path = seeds()[name], tmp_path / name
    rng = np.random.default_rng(8)
    outcomes = []

    def run():
        for _ in range(CASES // len(seeds())):
            damaged = bytearray(blob)
            for at in rng.integers(0, len(blob), rng.integers(1, 5)):
                damaged[at] = rng.integers(256)
            path.write_bytes(damaged)
            outcomes.append(survives(path))

    assert grown(run) < 1 << 22
    assert set(outcomes) == {True, False}


@pytest.mark.parametrize("name", seeds())
def test_cut_anywhere(tmp_path, name):
    blob, path = seeds()[name].rstrip(), tmp_path / name
    for length in range(len(blob)):
        path.write_bytes(blob[:length])
        assert not survives(path)


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


def head_of(blob: bytes) -> tuple[dict, bytes]:
    """The JSON part and the binary chunk of a file."""
    if blob[:4] != b"glTF":
        return json.loads(blob), b""
    (length,) = struct.unpack_from("<I", blob, 12)
    return json.loads(blob[20 : 20 + length]), blob[28 + length :]


@pytest.mark.parametrize("name", [name for name in seeds() if name.endswith(".glb")])
def test_values_replaced(tmp_path, name):
    """At each place of the JSON part in turn, one value after the other; and entries that are gone."""
    blob, path = seeds()[name], tmp_path / name
    head, data = head_of(blob)
    places, values = len(list(leaves(head))), itertools.cycle(VALUES)
    outcomes = []
    for k in range(max(CASES // 3, 2 * places)):
        changed = json.loads(json.dumps(head))
        holder, key = list(leaves(changed))[k % places]
        if k % 7 == 6:
            del holder[key]
        else:
            holder[key] = next(values)
        path.write_bytes(binary(changed, data))
        outcomes.append(survives(path))
    assert set(outcomes) == {True, False}


def test_json_nested_beyond_reason(tmp_path):
    path = tmp_path / "deep.gltf"
    path.write_bytes(b'{"a":' + b"[" * 100_000 + b"]" * 100_000 + b"}")
    refused(path, "JSON part cannot be read")


def test_a_json_part_beyond_reason(tmp_path):
    path = tmp_path / "large.gltf"
    path.write_bytes(b'{"a": [' + b"0," * (1 << 24) + b"0]}")
    refused(path, "its JSON part has", "more than")


def test_counts_that_the_file_does_not_hold_take_no_memory(tmp_path):
    made = everything()
    for accessor in range(len(made.head["accessors"])):
        for count in (10**5, 2**31 - 1, 10**12):
            changed = everything()
            changed.head["accessors"][accessor]["count"] = count
            path = changed.write(tmp_path)
            tracemalloc.start()
            try:
                load(path)
            except UserError:
                pass
            finally:
                peak = tracemalloc.get_traced_memory()[1]
                tracemalloc.stop()
            assert peak < 10 * path.stat().st_size + (1 << 19)
