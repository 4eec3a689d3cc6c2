"""The nodes of a glTF scene: their order, their transforms to the scene, which are shown, and the instances of a node."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....arrays import F64, I64, Bools
from .accessors import Accessors
from .document import Document, Entry
from .extensions import refuse_unknown

Matrices = F64
"""Transforms of column vectors, [..., 4, 4]."""

TRANSLATION, ROTATION, SCALE = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0)
"""The transform of a node that says nothing."""

_PARTS = {"translation": TRANSLATION, "rotation": ROTATION, "scale": SCALE}

_AFFINE = 1e-4
"""Largest part of the last row of a matrix that counts as rounding."""

ONCE = np.eye(4)[None]
"""The transform of a node that is there once."""


def composed(translation: NDArray, rotation: NDArray, scale: NDArray) -> Matrices:
    """translation * rotation * scale, [..., 4, 4]. ``rotation``: quaternions (x, y, z, w) of any length."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        length = np.sqrt((rotation * rotation).sum(axis=-1, keepdims=True))
        x, y, z, w = np.moveaxis(np.where(length > 0.0, rotation / length, ROTATION), -1, 0)
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        turned = np.moveaxis(np.array(rows, dtype=np.float64), (0, 1), (-2, -1))
        result = np.zeros((*turned.shape[:-2], 4, 4))
        result[..., :3, :3] = turned * np.asarray(scale, dtype=np.float64)[..., None, :]
    result[..., :3, 3] = translation
    result[..., 3, 3] = 1.0
    return result


def affine(document: Document, matrices: Matrices, where: str) -> Matrices:
    """The transforms, which must keep parallel lines parallel."""
    if not (np.abs(matrices[..., 3, :] - (0.0, 0.0, 0.0, 1.0)) <= _AFFINE).all():
        raise document.error(f"{where} has a matrix whose last row is not 0, 0, 0, 1")
    return matrices


def mirrored(matrices: Matrices) -> Bools:
    """Whether each transform turns what is counterclockwise into clockwise, [...]."""
    with np.errstate(over="ignore", invalid="ignore"):
        x, y, z = np.moveaxis(matrices[..., :3, :3], -1, 0)
        return (np.cross(x, y) * z).sum(axis=-1) < 0.0


class Tree:
    """The nodes of the default scene, depth first from its roots, children in the order of the file.

    nodes    index of each node in the file's list
    place    where each of them stands in ``nodes``
    parents  the place of each one's parent, -1 for a root
    shown    whether it and all above it are visible
    parts    its translation, rotation and scale, [node_count, 3 or 4]
    local    its transform to its parent, [node_count, 4, 4]
    world    its transform to the scene
    """

    def __init__(self, document: Document) -> None:
        self.document = document
        self.nodes, self.parents = _ordered(document)
        self.place = {node: i for i, node in enumerate(self.nodes)}
        self.parts = self._parts()
        self.local = self._locals()
        self.levels = self._levels(range(len(self.nodes)))
        self.world = self.posed(self.local, self.levels)
        self.shown: list[bool] = []
        for i, above in enumerate(self.parents):
            self.shown.append(self._visible(self.nodes[i]) and (above < 0 or self.shown[above]))

    def entry(self, place: int) -> Entry:
        """The JSON entry of the node at a place."""
        return self.document.all("nodes")[self.nodes[place]]

    def moved(self, places: set[int]) -> list[I64]:
        """These places and all below them, by depth: for :meth:`posed`."""
        found: set[int] = set()
        for i, above in enumerate(self.parents):
            if i in places or above in found:
                found.add(i)
        return self._levels(sorted(found))

    def above(self, places: set[int]) -> set[int]:
        """These places and all above them."""
        found = set(places)
        for i in range(len(self.parents) - 1, -1, -1):
            if i in found and self.parents[i] >= 0:
                found.add(self.parents[i])
        return found

    def posed(self, local: Matrices, levels: list[I64]) -> Matrices:
        """The transforms to the scene with these transforms to the parents, where only the nodes of ``levels`` move."""
        world = self.world.copy() if levels is not self.levels else np.empty_like(local)
        parents = np.array(self.parents, dtype=np.int64)
        with np.errstate(over="ignore", invalid="ignore"):
            for places in levels:
                roots = parents[places] < 0
                world[places[roots]] = local[places[roots]]
                below = places[~roots]
                world[below] = world[parents[below]] @ local[below]
        return world

    def _levels(self, places: Sequence[int]) -> list[I64]:
        """Places by their depth, the roots first."""
        depths: list[int] = []
        for above in self.parents:
            depths.append(0 if above < 0 else depths[above] + 1)
        levels: dict[int, list[int]] = {}
        for i in places:
            levels.setdefault(depths[i], []).append(i)
        return [np.array(levels[depth]) for depth in sorted(levels)]

    def _visible(self, node: int) -> bool:
        where = f"node {node}"
        said = self.document.extension(self.document.all("nodes")[node], "KHR_node_visibility", where)
        shown = True if said is None else said.get("visible", True)
        if not isinstance(shown, bool):
            raise self.document.error(f"{where}: visible is {shown!r}, not true or false")
        return shown

    def _parts(self) -> dict[str, F64]:
        columns = {}
        for key, default in _PARTS.items():
            rows = [
                self.document.numbers(self.entry(i), key, f"node {node}", default) for i, node in enumerate(self.nodes)
            ]
            columns[key] = np.array(rows, dtype=np.float64).reshape(-1, len(default))
        return columns

    def _locals(self) -> Matrices:
        result = composed(**self.parts)
        for i, node in enumerate(self.nodes):
            if "matrix" in self.entry(i):
                numbers = self.document.numbers(self.entry(i), "matrix", f"node {node}", (0.0,) * 16)
                columns = np.array(numbers).reshape(4, 4)
                result[i] = affine(self.document, columns.T, f"node {node}")
                for key, default in _PARTS.items():
                    if not np.array_equal(self.parts[key][i], default):
                        raise self.document.error(f"node {node} has both a matrix and a {key}")
        return result


def _ordered(document: Document) -> tuple[list[int], list[int]]:
    """The nodes of the default scene and the places of their parents. They must form trees."""
    if not document.all("scenes"):
        raise document.error("has no scene", "export with a default scene")
    scene = document.get("scenes", document.head.get("scene", 0), "the file")
    refuse_unknown(document, scene, "the scene")
    nodes: list[int] = []
    parents: list[int] = []
    waiting = [(node, -1, "the scene") for node in reversed(document.items(scene, "nodes", "the scene"))]
    seen: set[int] = set()
    while waiting:
        node, parent, where = waiting.pop()
        entry = document.get("nodes", node, where)
        if node in seen:
            raise document.error(f"node {node} has two parents", "its nodes must form trees")
        seen.add(node)
        where = f"node {node}"
        refuse_unknown(document, entry, where)
        children = document.items(entry, "children", where)
        waiting.extend((child, len(nodes), where) for child in reversed(children))
        nodes.append(node)
        parents.append(parent)
    return nodes, parents


class Instances:
    """The transforms of a node's instances to it (EXT_mesh_gpu_instancing); itself alone without the extension.

    count  number of instances
    given  whether there is the extension
    """

    def __init__(self, document: Document, accessors: Accessors, entry: Entry, where: str) -> None:
        said = document.extension(entry, "EXT_mesh_gpu_instancing", where)
        self.given = said is not None
        self._accessors, self._where = accessors, where
        refuse_unknown(document, said or {}, where)
        self._attributes = document.object(said or {}, "attributes", where)
        counts = {len(accessors.raw(index, where)) for index in self._attributes.values()}
        if self.given and len(counts) != 1:
            raise document.error(f"{where}: the attributes of its instances have the counts {sorted(counts)}")
        self.count = counts.pop() if self.given else 1

    def matrices(self) -> Matrices:
        """The transforms, [instance_count, 4, 4]; :data:`ONCE` for the node alone."""
        if not self.given:
            return ONCE
        columns = [
            self._accessors.floats(self._attributes[name], self._where, len(default)).astype(np.float64)
            if name in self._attributes
            else np.broadcast_to(np.array(default), (self.count, len(default)))
            for name, default in (("TRANSLATION", TRANSLATION), ("ROTATION", ROTATION), ("SCALE", SCALE))
        ]
        return composed(*columns)
