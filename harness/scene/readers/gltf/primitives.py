"""The triangles of a glTF mesh: each primitive's corners, and the vertices that they are of.

Primitives whose attributes are the same accessors share their vertices: some files have one array for many parts.
Strips and fans are cut as the specification says; points and lines are counted and left out.
"""

from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....arrays import Floats, Ints
from .accessors import Accessors
from .compressed import DRACO, Draco
from .document import Document, Entry
from .extensions import refuse_unknown

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_NO_SURFACE = (0, 1, 2, 3)
"""Modes: points, lines, a closed line, a line."""


@dataclass(frozen=True, eq=False)
class Vertices:
    """The vertices of one or more primitives.

    key        equal for the same vertices
    positions  [count, 3]
    targets    the displacements [count, 3] of each morph target, None where it moves nothing
    joints     indices into the joints of a skin, [count, influences]; no influences without a skin
    weights    of these joints
    """

    key: Hashable
    positions: Floats
    targets: tuple[Floats | None, ...]
    joints: NDArray[np.unsignedinteger]
    weights: Floats


@dataclass(frozen=True, eq=False)
class Primitive:
    """Triangles [triangle_count, 3] of some vertices, and the index of their material or None."""

    vertices: Vertices
    corners: Ints
    material: int | None


class Meshes:
    """The meshes of a file, each read once.

    left_out  of the meshes that were read: how many primitives hold "no surface", and how many "no positions"
    """

    def __init__(self, document: Document, accessors: Accessors) -> None:
        self._document = document
        self._accessors = accessors
        self._read: dict[tuple[int, bool], list[Primitive]] = {}
        self._vertices: dict[Hashable, Vertices] = {}
        self._corners: dict[Hashable, tuple[Ints, int]] = {}
        self.left_out: Counter[str] = Counter()

    def primitives(self, mesh: Any, where: str, skinned: bool) -> list[Primitive]:
        """The primitives of a mesh that have triangles. ``skinned``: whether joints and weights are needed."""
        entry, name = self._document.get("meshes", mesh, where), f"mesh {mesh}"
        if (mesh, skinned) not in self._read:
            refuse_unknown(self._document, entry, name)
            read = [
                self._primitive(primitive, name, skinned)
                for primitive in self._document.items(entry, "primitives", name)
            ]
            self._read[mesh, skinned] = [one for one in read if one is not None and len(one.corners)]
        return self._read[mesh, skinned]

    def weights(self, mesh: Any, node: Entry, where: str) -> list[float]:
        """The weights of the morph targets of a mesh at a node: those of the node, else of the mesh, else none."""
        for entry in (node, self._document.get("meshes", mesh, where)):
            if "weights" in entry:
                count = len(self._document.items(entry, "weights", where))
                return self._document.numbers(entry, "weights", where, (0.0,) * count)
        return []

    def _primitive(self, entry: Any, name: str, skinned: bool) -> Primitive | None:
        document = self._document
        if not isinstance(entry, dict):
            raise document.error(f"{name}: a primitive is not an object")
        mode = entry.get("mode", _TRIANGLES)
        attributes = document.object(entry, "attributes", name)
        if mode in _NO_SURFACE:
            self.left_out["no surface"] += 1
            return None
        refuse_unknown(document, entry, name)
        if "POSITION" not in attributes:
            self.left_out["no positions"] += 1
            return None
        if mode not in (_TRIANGLES, _STRIP, _FAN):
            raise document.error(f"{name}: a primitive has the mode {mode!r}")
        draco = self._compressed(entry, attributes, name)
        vertices = self._vertices_of(entry, attributes, draco, name, skinned)
        count = len(vertices.positions)
        corners: Ints
        if draco is not None:
            corners, most = draco.faces, int(draco.faces.max(initial=0))
        elif "indices" in entry:
            corners, most = self._indexed(entry["indices"], mode, name)
        else:
            corners, most = self._cut(np.arange(count, dtype=np.uint32), mode, name), 0
        if len(corners) and most >= count:
            raise document.error(f"{name} names vertex {most}, but there are {count}")
        material = entry.get("material")
        return Primitive(vertices, corners, material if type(material) is int else None)

    def _compressed(self, entry: Entry, attributes: Entry, name: str) -> Draco | None:
        """The Draco data of a primitive whose accessors have none of their own."""
        said = self._document.extension(entry, DRACO, name)
        position = self._document.get("accessors", attributes["POSITION"], name)
        if said is None or "bufferView" in position:
            return None
        return Draco(self._document, name, said, self._accessors.view(said.get("bufferView"), name))

    def _vertices_of(self, entry: Entry, attributes: Entry, draco: Draco | None, name: str, skinned: bool) -> Vertices:
        document = self._document
        targets = [
            document.object({"target": target}, "target", name).get("POSITION")
            for target in document.items(entry, "targets", name)
        ]
        influences = sorted(key for key in attributes if key.startswith("JOINTS_")) if skinned else []
        if skinned and not influences:
            raise document.error(f"{name} has a skin, but a primitive has no joints")
        sets = [(key, key.replace("JOINTS_", "WEIGHTS_")) for key in influences]
        if any(weights not in attributes for _, weights in sets):
            raise document.error(f"{name}: a primitive has joints without weights")
        used = [attributes[name] for pair in sets for name in pair]
        key = (str(attributes["POSITION"]), str(targets), str(used), draco and draco.key)
        if key not in self._vertices:
            positions = self._attribute("POSITION", attributes, draco, name, 3)
            self._vertices[key] = Vertices(
                key,
                positions,
                tuple(None if index is None else self._target(index, len(positions), name) for index in targets),
                *self._influences(sets, attributes, draco, name, len(positions)),
            )
        return self._vertices[key]

    def _attribute(
        self, key: str, attributes: Entry, draco: Draco | None, name: str, width: int, whole: bool = False
    ) -> NDArray:
        """One attribute [count, width]: floats, or with ``whole`` unsigned integers."""
        layout = self._accessors.layout(attributes[key], name)
        if draco is None or not draco.has(key):
            read = self._accessors.indices if whole else self._accessors.floats
            return read(attributes[key], name, width)
        values = draco.attribute(key, layout.count, width)
        if layout.normalized:
            return np.maximum(values / np.float64(np.iinfo(values.dtype).max), -1.0)
        return values if whole else values.astype(np.float32, copy=False)

    def _target(self, index: Any, count: int, name: str) -> Floats:
        """The displacements of a morph target."""
        found = self._accessors.layout(index, name).count
        if found != count:
            raise self._document.error(f"{name}: a morph target has {found} vertices, its primitive {count}")
        return self._accessors.floats(index, name, 3)

    def _influences(
        self, sets: list[tuple[str, str]], attributes: Entry, draco: Draco | None, name: str, count: int
    ) -> tuple[NDArray, NDArray]:
        """Joints and weights [count, influences], four of each set."""
        joints = [self._attribute(key, attributes, draco, name, 4, whole=True) for key, _ in sets]
        weights = [self._attribute(key, attributes, draco, name, 4) for _, key in sets]
        if any(len(values) != count for values in (*joints, *weights)):
            raise self._document.error(f"{name}: joints, weights and positions differ in number")
        if not sets:
            return np.zeros((count, 0), np.uint8), np.zeros((count, 0), np.float32)
        return np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)

    def _indexed(self, index: Any, mode: int, name: str) -> tuple[Ints, int]:
        """The triangles that an accessor of indices makes, and its largest index; once for all that use it."""
        key = (str(index), mode)
        if key not in self._corners:
            corners = self._accessors.indices(index, name)[:, 0]
            self._corners[key] = self._cut(corners, mode, name), int(corners.max(initial=0))
        return self._corners[key]

    def _cut(self, corners: Ints, mode: int, name: str) -> Ints:
        """The triangles [triangle_count, 3] of a list, a strip or a fan of corners."""
        if mode == _TRIANGLES:
            if len(corners) % 3:
                problem = f"{name}: a primitive has {len(corners)} corners, not a multiple of 3"
                raise self._document.error(problem)
            return corners.reshape(-1, 3)
        i = np.arange(max(0, len(corners) - 2))
        if mode == _FAN:
            return np.stack([corners[i + 1], corners[i + 2], corners[i * 0]], axis=1)
        odd = i % 2  # every second triangle of a strip is turned the other way round
        return np.stack([corners[i], corners[i + 1 + odd], corners[i + 2 - odd]], axis=1)
