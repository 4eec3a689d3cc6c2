"""GLB (binary glTF 2.0). trimesh decodes the meshes; each instance is transformed by its node.

Order: nodes depth first from the roots of the default scene, children in file order; the primitives of a mesh in file
order. The nodes are traversed here because trimesh gives the primitives of a mesh random names and so loses their
order, drops the children of a camera, and skips unknown entries. trimesh also trusts the file's counts; so the JSON
part is checked first, and its number of triangles is compared with the number read.
"""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .checks import ALL, Mesh, Wanted, broken, checked, guarded, read_bytes

_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_HARMLESS = ("KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_")
_POINTS, _LINES, _TRIANGLES, _STRIP, _FAN = 0, 1, 4, 5, 6
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_JSON_LIMIT = 1 << 25
"""Largest JSON part, bytes. Parsed into Python objects it takes up to twenty times as much memory."""

_INSTANCED = 1 << 25
"""Largest number of triangles including instances; through nested instances a small file could have any number."""


def read_glb(path: Path, wanted: Wanted = ALL) -> Mesh:
    """All triangles of the default scene; transformed positions are float64. In glTF, y is up.

    Morph targets and skins are ignored (the rest pose is read); points and lines are skipped. Raises
    :class:`UserError` for compressed or external data, for counts that exceed the file's size, and if trimesh reads
    another number of triangles than the file declares.
    """
    from trimesh.exchange.gltf import load_glb  # imported here because it is slow and most runs read no GLB

    blob = read_bytes(path)
    with guarded(path, "GLB"):
        head, buffer_size = _json_part(path, blob)
        _check_accessors(path, head, buffer_size)
        expected = _count(path, head)
    if not expected:
        raise broken(path, "holds no triangles", "give a triangle mesh")
    with guarded(path, "GLB"):
        decoded = load_glb(io.BytesIO(blob), skip_materials=True)["geometry"]
        meshes = _by_mesh(head, list(decoded.values()))
        parts = [
            (node, own, corners, matrix)
            for node, matrix in _instances(path, head)
            for own, corners in meshes[head["nodes"][node]["mesh"]]
        ]
        read = sum(len(corners) for _, _, corners, _ in parts)
        if read != expected:
            raise broken(path, f"{expected} triangles, but {read} could be read")
        faces, at, offset = np.empty((expected, 3), dtype=np.int32), 0, 0
        for node, own, corners, _ in parts:
            # Checked per mesh: an index that is too large must not refer to a vertex of the next mesh.
            if len(corners) and (corners.min() < 0 or corners.max() >= len(own)):
                raise broken(path, f"node {node} names vertex {corners.max()}, but there are {len(own)}")
            np.add(corners, offset, out=faces[at : at + len(corners)], dtype=np.int64, casting="unsafe")
            at, offset = at + len(corners), offset + len(own)
        points = [_moved(own, matrix) for _, own, _, matrix in parts]
    return checked(path, points[0] if len(points) == 1 else np.concatenate(points), faces, (0.0, 1.0, 0.0))


def _json_part(path: Path, blob: bytes) -> tuple[dict[str, Any], int]:
    """The JSON chunk, and the size of the binary chunk."""
    if blob[:4] != b"glTF" or len(blob) < 20:
        raise broken(path, "does not begin with the GLB signature", "this is not a binary glTF file")
    version, length = struct.unpack_from("<II", blob, 4)
    if version != 2:
        raise broken(path, f"glTF version {version}", "export as glTF 2.0")
    if length != len(blob):
        problem = f"the header claims {length} bytes, but the file has {len(blob)}"
        raise broken(path, problem, "the file is truncated or its header wrong")
    head, binary, at = None, 0, 12
    while at < length:
        if at + 8 > length:
            raise broken(path, "a chunk ends beyond the file", "the file is truncated")
        size, kind = struct.unpack_from("<II", blob, at)
        if at + 8 + size > length:
            raise broken(path, "a chunk ends beyond the file", "the file is truncated")
        if head is None and kind != _JSON:
            raise broken(path, "the first chunk is not JSON")
        if head is None:
            if size > _JSON_LIMIT:
                raise broken(
                    path, f"its JSON part has {size} bytes, more than {_JSON_LIMIT}", "export a part of it"
                )
            head = json.loads(blob[at + 8 : at + 8 + size])
        elif kind == _BIN and not binary:
            binary = size
        at += 8 + size
    if not isinstance(head, dict):
        raise broken(path, "the JSON chunk is not an object")
    used = [str(name) for name in head.get("extensionsRequired", []) if not str(name).startswith(_HARMLESS)]
    if used:
        raise broken(path, f"needs the extension {used[0]}", "export it uncompressed and without extensions")
    if len(head.get("buffers", [])) > 1 or any("uri" in entry for entry in head.get("buffers", [])):
        raise broken(path, "its data are in external buffers", "export one self-contained .glb")
    return head, binary


def _whole(path: Path, entry: dict[str, Any], key: str, default: int | None = None) -> int:
    value = entry.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1 << 40:
        raise broken(path, f"{key} is {value!r}, not a whole number")
    return value


def _check_accessors(path: Path, head: dict[str, Any], buffer_size: int) -> None:
    """Check that every view lies in the buffer and every accessor in its view, before memory is allocated by counts."""
    views = head.get("bufferViews", [])
    for i, view in enumerate(views):
        if _whole(path, view, "byteOffset", 0) + _whole(path, view, "byteLength") > buffer_size:
            raise broken(path, f"buffer view {i} reaches beyond the {buffer_size} bytes of the buffer")
    for i, accessor in enumerate(head.get("accessors", [])):
        count = _whole(path, accessor, "count")
        item = _COMPONENT_BYTES[accessor["componentType"]] * _COMPONENTS[accessor["type"]]
        if "sparse" in accessor:
            raise broken(path, f"accessor {i} is sparse", "export it without sparse accessors")
        if "bufferView" not in accessor:
            raise broken(path, f"accessor {i} has no data", "export it uncompressed")
        view = views[_whole(path, accessor, "bufferView")]
        stride = _whole(path, view, "byteStride", item)
        if stride < item:
            raise broken(
                path,
                f"buffer view {accessor['bufferView']} has a stride of {stride} for items of {item} bytes",
            )
        need = _whole(path, accessor, "byteOffset", 0) + max(0, count - 1) * stride + (item if count else 0)
        if need > view["byteLength"]:
            raise broken(path, f"accessor {i} needs {need} bytes, its view has {view['byteLength']}")


def _count(path: Path, head: dict[str, Any]) -> int:
    """Number of triangles of the default scene, including instances."""
    sizes = [sum(_primitive(path, head, p) for p in mesh["primitives"]) for mesh in head.get("meshes", [])]
    total = sum(sizes[head["nodes"][node]["mesh"]] for node, _ in _instances(path, head))
    if total > _INSTANCED:
        problem = f"has {total} triangles with instances, more than {_INSTANCED}"
        raise broken(path, problem, "export a part of it")
    return total


def _instances(path: Path, head: dict[str, Any]) -> list[tuple[int, NDArray[np.float64]]]:
    """The nodes of the default scene that have a mesh, each with its transform to the scene.

    The nodes must form trees.
    """
    nodes, scenes = head.get("nodes", []), head.get("scenes", [])
    if not scenes:
        raise broken(path, "has no scene", "export with a default scene")
    roots = scenes[_whole(path, head, "scene", 0)].get("nodes", [])
    waiting = [(node, np.eye(4)) for node in reversed(roots)]
    seen: set[int] = set()
    found = []
    while waiting:
        node, above = waiting.pop()
        if not isinstance(node, int) or not 0 <= node < len(nodes) or node in seen:
            raise broken(
                path, f"node {node!r} does not exist or has two parents", "its nodes must form trees"
            )
        seen.add(node)
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = above @ _transform(nodes[node])
        if "mesh" in nodes[node]:
            _whole(path, nodes[node], "mesh")
            found.append((node, matrix))
        waiting.extend((child, matrix) for child in reversed(nodes[node].get("children", [])))
    return found


def _transform(node: dict[str, Any]) -> NDArray[np.float64]:
    """The matrix of a node: its own matrix (column-major), or translation * rotation * scale."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    matrix[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64)
    return matrix


def _moved(points: NDArray, matrix: NDArray[np.float64]) -> NDArray:
    """Transformed positions, float64; unchanged if the transform is the identity."""
    if np.array_equal(matrix, np.eye(4)):
        return points
    with np.errstate(over="ignore", invalid="ignore"):
        return points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def _by_mesh(head: dict[str, Any], decoded: list[dict[str, Any]]) -> list[list[tuple[NDArray, NDArray]]]:
    """Positions and faces of the triangle primitives of each mesh. trimesh returns the primitives of all meshes in one
    list.
    """
    result, left = [], iter(decoded)
    for mesh in head.get("meshes", []):
        parts = []
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            entry = next(left) if mode in (_POINTS, _LINES, _TRIANGLES, _STRIP) else {}
            if mode in (_TRIANGLES, _STRIP):
                parts.append((np.asarray(entry["vertices"]), np.asarray(entry["faces"])))
        result.append(parts)
    return result


def _primitive(path: Path, head: dict[str, Any], primitive: dict[str, Any]) -> int:
    """Number of triangles of a primitive."""
    accessors = head.get("accessors", [])
    mode = primitive.get("mode", _TRIANGLES)
    vertices = accessors[_whole(path, primitive["attributes"], "POSITION")]
    if mode == _FAN:
        raise broken(path, "holds triangle fans", "export it as triangles")
    if mode not in (_TRIANGLES, _STRIP):
        return 0
    if vertices["componentType"] != 5126 or vertices["type"] != "VEC3":
        raise broken(path, "its positions are not vectors of three floats", "export it without quantisation")
    entry = accessors[_whole(path, primitive, "indices")] if "indices" in primitive else vertices
    count = entry["count"]
    if "indices" in primitive and (
        entry["type"] != "SCALAR" or entry["componentType"] not in (5121, 5123, 5125)
    ):
        raise broken(path, "its indices are not unsigned integers")
    if mode == _STRIP:
        return max(0, count - 2)
    if count % 3:
        raise broken(path, f"a primitive has {count} corners, not a multiple of 3")
    return count // 3
