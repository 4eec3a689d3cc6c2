"""glTF files put together entry by entry, for the tests of reading them."""

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
