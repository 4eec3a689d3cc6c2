"""The triangles of a glTF mesh: each primitive's corners, and the vertices that they are of. Primitives whose
attributes are the same accessors share their vertices: some files have one array for many parts. Strips and fans are
cut as the specification says; points and lines are counted and left out.
"""

from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....arrays import Floats, Ints
from .accessors import Accessors, Draco, normal
from .container import DRACO, Entry

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_NO_SURFACE = (0, 1, 2, 3)  # modes: points, lines, a closed line, a line


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

    def __init__(self, accessors: Accessors) -> None:
        self._accessors = accessors
        self._read: dict[tuple[str, bool], list[Primitive]] = {}
        self._vertices: dict[Hashable, Vertices] = {}
        self._corners: dict[Hashable, tuple[Ints, int]] = {}
        self.left_out: Counter[str] = Counter()

    def primitives(self, mesh: Entry, skinned: bool) -> list[Primitive]:
        """The primitives of a mesh that have triangles. ``skinned``: whether joints and weights are needed."""
        key = mesh.name, skinned
        if key not in self._read:
            mesh.refuse_unknown()
            read = [self._primitive(primitive, skinned) for primitive in mesh.entries("primitives", "a primitive")]
            self._read[key] = [one for one in read if one is not None and len(one.corners)]
        return self._read[key]

    def _primitive(self, entry: Entry, skinned: bool) -> Primitive | None:
        mode, attributes = entry.get("mode", _TRIANGLES), entry.object("attributes")
        if mode in _NO_SURFACE:
            self.left_out["no surface"] += 1
            return None
        entry.refuse_unknown()
        if "POSITION" not in attributes:
            self.left_out["no positions"] += 1
            return None
        if mode not in (_TRIANGLES, _STRIP, _FAN):
            raise entry.error(f": a primitive has the mode {mode!r}")
        said = entry.extension(DRACO)
        draco = None  # of a primitive whose accessors have no data of their own
        if "bufferView" not in self._accessors.file.named(entry, attributes.get("POSITION"), "accessors") and said:
            draco = Draco(said, self._accessors.view(said))
        vertices = self._vertices_of(entry, attributes, draco, skinned)
        count = len(vertices.positions)
        corners: Ints
        if draco is not None:
            corners, most = draco.faces, int(draco.faces.max(initial=0))
        elif "indices" in entry:
            corners, most = self._indexed(entry, mode)
        else:
            corners, most = _cut(entry, np.arange(count, dtype=np.uint32), mode), 0
        if len(corners) and most >= count:
            raise entry.error(f"names vertex {most}, but there are {count}")
        material = entry.get("material")
        return Primitive(vertices, corners, material if type(material) is int else None)

    def _vertices_of(self, entry: Entry, attributes: Entry, draco: Draco | None, skinned: bool) -> Vertices:
        targets = entry.entries("targets", "target")
        influences = sorted(key for key in attributes.values if key.startswith("JOINTS_")) if skinned else []
        if skinned and not influences:
            raise entry.error("has a skin, but a primitive has no joints")
        sets = [(key, key.replace("JOINTS_", "WEIGHTS_")) for key in influences]
        if any(weights not in attributes for _, weights in sets):
            raise entry.error(": a primitive has joints without weights")
        used = [attributes.get(name) for name in ("POSITION", *(name for pair in sets for name in pair))]
        key = (str(used), str([target.get("POSITION") for target in targets]), draco and draco.key)
        if key not in self._vertices:
            positions = self._attribute("POSITION", attributes, draco, 3)
            count = len(positions)
            moves = tuple(self._target(target, count) for target in targets)
            joints = [self._attribute(key, attributes, draco, 4, whole=True) for key, _ in sets]
            weights = [self._attribute(key, attributes, draco, 4) for _, key in sets]
            if any(len(values) != count for values in (*joints, *weights)):
                raise entry.error(": joints, weights and positions differ in number")
            none: list[NDArray[Any]] = [np.zeros((count, 0), np.uint8)]
            both = (np.concatenate(values or none, axis=1) for values in (joints, weights))
            self._vertices[key] = Vertices(key, positions, moves, *both)
        return self._vertices[key]

    def _attribute(
        self, key: str, attributes: Entry, draco: Draco | None, width: int, whole: bool = False
    ) -> NDArray[Any]:
        """One attribute [count, width]: floats, or with ``whole`` unsigned integers."""
        layout = self._accessors.layout(attributes, key)
        if draco is None or not draco.has(key):
            read = self._accessors.indices if whole else self._accessors.floats
            return read(attributes, key, width)
        values = draco.attribute(key, layout.count, width)
        if layout.normalized:
            return normal(values)
        return values if whole else values.astype(np.float32, copy=False)

    def _target(self, target: Entry, count: int) -> Floats | None:
        if target.get("POSITION") is None:
            return None
        found = self._accessors.layout(target, "POSITION").count
        if found != count:
            raise target.error(f": a morph target has {found} vertices, its primitive {count}")
        return self._accessors.floats(target, "POSITION", 3)

    def _indexed(self, entry: Entry, mode: int) -> tuple[Ints, int]:
        """The triangles that an accessor of indices makes, and its largest index; once for all that use it."""
        key = (str(entry.get("indices")), mode)
        if key not in self._corners:
            corners = self._accessors.indices(entry, "indices")[:, 0]
            self._corners[key] = _cut(entry, corners, mode), int(corners.max(initial=0))
        return self._corners[key]


def _cut(entry: Entry, corners: Ints, mode: int) -> Ints:
    """The triangles [triangle_count, 3] of a list, a strip or a fan of corners."""
    if mode == _TRIANGLES:
        if len(corners) % 3:
            raise entry.error(f": a primitive has {len(corners)} corners, not a multiple of 3")
        return corners.reshape(-1, 3)
    i = np.arange(max(0, len(corners) - 2))
    if mode == _FAN:
        return np.stack([corners[i + 1], corners[i + 2], corners[i * 0]], axis=1)
    odd = i % 2  # every second triangle of a strip is turned the other way round
    return np.stack([corners[i], corners[i + 1 + odd], corners[i + 2 - odd]], axis=1)
