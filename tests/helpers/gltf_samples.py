"""glTF files of many kinds of entries: a skinned square, compressed points, and one with all that is read."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from shadowbench.harness.scene.readers.checks import Loaded

COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="f4")
CORNERS = np.array([0, 1, 2, 0, 2, 3], dtype="u2")


def binary(head: dict[str, Any], data: bytes = b"") -> bytes:
    """A binary file of a JSON part and a binary chunk."""
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data if data else b""
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


class Gltf:
    """A glTF file in the making: ``head`` is its JSON part, ``data`` its one buffer. It starts with an empty scene."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.head: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}

    def add(self, name: str, entry: dict[str, Any]) -> int:
        """Put an entry into one of the lists of the JSON part; its index."""
        self.head.setdefault(name, []).append(entry)
        return len(self.head[name]) - 1

    def view(self, blob: bytes, **more: Any) -> int:
        """A buffer view of some bytes."""
        self.data += b"\0" * (-len(self.data) % 4)
        entry = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(blob), **more}
        self.data += blob
        return self.add("bufferViews", entry)

    def accessor(self, values: Any, dtype: str | None = None, **more: Any) -> int:
        """An accessor of values [count] or [count, width]."""
        array = np.asarray(values, dtype=dtype or "f4")
        width = 1 if array.ndim == 1 else array.shape[1]
        kind = {"componentType": COMPONENTS[array.dtype.str[1:]], "type": TYPES[width]}
        return self.add("accessors", {"bufferView": self.view(array.tobytes()), "count": len(array), **kind, **more})

    def sparse(self, count: int, index: int, value: list[float]) -> int:
        """An accessor of ``count`` zero vectors but one."""
        places = {"bufferView": self.view(np.uint16(index).tobytes()), "componentType": 5123}
        values = {"bufferView": self.view(np.float32(value).tobytes())}
        said = {"count": 1, "indices": places, "values": values}
        return self.add("accessors", {"componentType": 5126, "count": count, "type": "VEC3", "sparse": said})

    def mesh(self, points: Any = SQUARE, corners: Any = CORNERS, **more: Any) -> int:
        """A mesh of one primitive; ``more`` goes into the primitive."""
        attributes = {"POSITION": self.accessor(points), **more.pop("attributes", {})}
        primitive = {"attributes": attributes, **more}
        if corners is not None:
            primitive["indices"] = self.accessor(corners, np.asarray(corners).dtype.str[1:])
        return self.add("meshes", {"primitives": [primitive]})

    def primitive(self, mesh: int = 0) -> dict[str, Any]:
        """The first primitive of a mesh."""
        return self.head["meshes"][mesh]["primitives"][0]

    def node(self, under: int | None = None, **entry: Any) -> int:
        """A node, below another one or a root of the scene."""
        node = self.add("nodes", entry)
        if under is None:
            self.head["scenes"][0]["nodes"].append(node)
        else:
            self.head["nodes"][under].setdefault("children", []).append(node)
        return node

    def animate(self, **channels: tuple[int, Any, Any] | tuple[int, Any, Any, str]) -> int:
        """An animation; each channel by its path: node, times, values, and perhaps the interpolation."""
        animation: dict[str, Any] = {"samplers": [], "channels": []}
        for path, (node, times, values, *how) in channels.items():
            sampler = {"input": self.accessor(times), "output": self.accessor(values)}
            sampler.update({"interpolation": how[0]} if how else {})
            animation["channels"].append(
                {"sampler": len(animation["samplers"]), "target": {"node": node, "path": path}}
            )
            animation["samplers"].append(sampler)
        return self.add("animations", animation)

    def extend(self, entry: dict[str, Any], name: str, said: Any, required: bool = False) -> None:
        """An extension of an entry, declared for the file."""
        entry.setdefault("extensions", {})[name] = said
        for key in ("extensionsUsed", "extensionsRequired")[: 1 + required]:
            self.head.setdefault(key, []).append(name)

    def glb(self) -> bytes:
        """The file as one binary."""
        self.head["buffers"] = [{"byteLength": len(self.data)}, *self.head.get("buffers", [])[1:]]
        return binary(self.head, bytes(self.data))

    def text(self, uri: str | None = None) -> bytes:
        """The file as text, its buffer at a URI or embedded in it."""
        if uri is None:
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.head["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        return json.dumps(self.head).encode()

    def write(self, folder: Path, name: str = "a.glb") -> Path:
        """The file in a folder; beside a ``.gltf`` its buffer, of the same name and the ending ``.bin``."""
        path = folder / name
        if path.suffix == ".gltf":
            path.with_suffix(".bin").write_bytes(self.data)
            path.write_bytes(self.text(path.with_suffix(".bin").name))
        else:
            path.write_bytes(self.glb())
        return path


def square(**node: Any) -> Gltf:
    """A file of one node with a square of two triangles, from (0, 0, 0) to (1, 1, 0)."""
    made = Gltf()
    made.node(mesh=made.mesh(), **node)
    return made


def bounds(loaded: Loaded, frame: int = 0) -> tuple[list[float], list[float]]:
    """Lowest and highest corner of the triangles."""
    points = loaded.frames[frame][loaded.faces].reshape(-1, 3)
    return points.min(axis=0).tolist(), points.max(axis=0).tolist()


DRACO = "KHR_draco_mesh_compression"

POINTS = np.random.default_rng(5).random((50, 3)).astype("f4")
FACES = np.random.default_rng(6).permutation(np.arange(150) % 50).astype("u4")


def draco(points: np.ndarray, corners: np.ndarray, **attributes: np.ndarray) -> Gltf:
    """A file of one mesh that is compressed without loss of order."""
    import DracoPy  # of the extra "gltf", which not all tests have

    made = Gltf()
    packed = DracoPy.encode(
        points,
        corners.reshape(-1, 3),
        quantization_bits=24,
        preserve_order=True,
        generic_attributes={i: values for i, values in enumerate(attributes.values())} or None,
    )
    ids = {a["attribute_type"]: a["unique_id"] for a in DracoPy.decode(packed).attributes}
    named = {"POSITION": ids[0], **{name: i for i, name in enumerate(attributes)}}
    made.node(mesh=made.mesh(points, corners))
    for name, values in attributes.items():
        made.primitive()["attributes"][name] = made.accessor(values, values.dtype.str[1:])
    for accessor in made.head["accessors"]:
        accessor.pop("bufferView")
    made.data.clear()
    made.head["bufferViews"] = []
    said = {"bufferView": made.view(packed), "attributes": named}
    made.extend(made.primitive(), DRACO, said, required=True)
    return made


def packed(points: np.ndarray, corners: np.ndarray, name: str = "EXT_meshopt_compression") -> Gltf:
    """A file of one square whose buffer views are compressed by meshoptimizer, with an empty buffer to fall back on."""
    import meshopt

    made = square()
    made.head["accessors"][0]["count"], made.head["accessors"][1]["count"] = len(points), len(corners)
    made.head["accessors"][1]["componentType"] = 5125
    plain = [(points, "ATTRIBUTES"), (corners, "TRIANGLES")]
    made.data.clear()
    made.head["bufferViews"], made.head["buffers"] = [], [{}, {"byteLength": 1 << 20}]
    made.extend(made.head["buffers"][1], name, {"fallback": True}, required=True)
    for values, mode in plain:
        stride = values.nbytes // len(values)
        view = made.view(meshopt.encode_gltf_buffer(values, mode))
        said = {**made.head["bufferViews"][view], "byteStride": stride, "count": len(values), "mode": mode}
        made.head["bufferViews"][view] = {
            "buffer": 1,
            "byteOffset": 1 << 15,
            "byteLength": values.nbytes,
            "extensions": {name: said},
        }
    return made


def skinned(points=SQUARE, influences=1) -> Gltf:
    """A square between two joints, one above the other; its own node is far away, which means nothing."""
    rng = np.random.default_rng(4)
    made = Gltf()
    joints, weights = (rng.integers(0, 2, (influences, len(points), 4)), rng.random((influences, len(points), 4)))
    attributes = {}
    for i in range(influences):
        attributes[f"JOINTS_{i}"] = made.accessor(joints[i], "u1")
        attributes[f"WEIGHTS_{i}"] = made.accessor(weights[i])
    mesh = made.mesh(points, CORNERS, attributes=attributes)
    first = made.node(translation=[0, 1, 0])
    second = made.node(first, rotation=[0, 0, 0.6, 0.8])
    inverse = rng.normal(size=(2, 4, 4))
    inverse[:, 3] = [0, 0, 0, 1]
    made.add(
        "skins",
        {"joints": [second, first], "inverseBindMatrices": made.accessor(inverse.transpose(0, 2, 1).reshape(2, 16))},
    )
    made.node(mesh=mesh, skin=0, translation=[1000, 0, 0], scale=[-1, 1, 1])
    return made


def everything() -> Gltf:
    """A file with all that is read: every kind of accessor, primitive, node, animation, camera and light."""
    made = skinned()
    rng = np.random.default_rng(7)
    target = made.sparse(4, 2, [0, 0, 5])
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
    made.extend(made.head, "KHR_lights_punctual", {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}}]})
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


def moved(**channels) -> Gltf:
    """A square whose node moves: for each path times and values, and perhaps the interpolation."""
    made = square()
    made.animate(**{path: (0, *curve) for path, curve in channels.items()})
    return made


def instanced(attributes: dict[str, object], **node: object) -> Gltf:
    """A square in many instances, of an array for each attribute."""
    made = square(**node)
    said = {"attributes": {name: made.accessor(values) for name, values in attributes.items()}}
    made.extend(made.head["nodes"][0], "EXT_mesh_gpu_instancing", said)
    return made
