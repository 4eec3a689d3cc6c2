"""The nodes of a glTF scene: order, transforms to the scene, which are shown, their instances, and the skins of joints."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....arrays import F64, I64, Bools
from .accessors import Accessors
from .container import Entry, File

Matrices = F64  # transforms of column vectors, [..., 4, 4]

REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}
"""The transform of a node that says nothing."""

_AFFINE = 1e-4  # largest part of the last row of a matrix that counts as rounding
ONCE = np.eye(4)[None]  # the transform of a node that is there once


def composed(translation: NDArray, rotation: NDArray, scale: NDArray) -> Matrices:
    """translation * rotation * scale, [..., 4, 4]. ``rotation``: quaternions (x, y, z, w) of any length."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        length = np.sqrt((rotation * rotation).sum(axis=-1, keepdims=True))
        x, y, z, w = np.moveaxis(np.where(length > 0.0, rotation / length, REST["rotation"]), -1, 0)
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


def affine(columns: F64, entry: Entry) -> Matrices:
    """The transforms of an entry that are stored by columns, [..., 16]. They must keep parallel lines parallel."""
    matrices = np.swapaxes(columns.reshape(*columns.shape[:-1], 4, 4), -1, -2)
    if not (np.abs(matrices[..., 3, :] - (0.0, 0.0, 0.0, 1.0)) <= _AFFINE).all():
        raise entry.error("has a matrix whose last row is not 0, 0, 0, 1")
    return matrices


def mirrored(matrices: Matrices) -> Bools:
    """Whether each transform turns what is counterclockwise into clockwise, [...]."""
    with np.errstate(over="ignore", invalid="ignore"):
        x, y, z = np.moveaxis(matrices[..., :3, :3], -1, 0)
        return (np.cross(x, y) * z).sum(axis=-1) < 0.0


class Tree:
    """The nodes of the default scene, depth first from its roots, children in the order of the file.

    entries  what the file says of each
    place    where the node of an index stands among them
    parents  the place of each one's parent, -1 for a root
    shown    whether it and all above it are visible
    parts    its translation, rotation and scale, [node_count, 3 or 4]
    local    its transform to its parent, [node_count, 4, 4]
    world    its transform to the scene
    """

    def __init__(self, file: File) -> None:
        self.entries: list[Entry] = []
        self.place: dict[int, int] = {}
        self.parents: list[int] = []
        self._walk(file)
        self.parts = {
            key: np.array([entry.numbers(key, rest) for entry in self.entries]).reshape(-1, len(rest))
            for key, rest in REST.items()
        }
        self.local = self._locals()
        self.shown: list[bool] = []
        self._depths: list[int] = []
        for entry, above in zip(self.entries, self.parents, strict=True):
            self.shown.append(_visible(entry) and (above < 0 or self.shown[above]))
            self._depths.append(0 if above < 0 else self._depths[above] + 1)
        self.world = np.empty_like(self.local)
        self.world = self.posed(self.local, self.levels(range(len(self.entries))))

    def _walk(self, file: File) -> None:
        """Find the nodes of the default scene. They must form trees."""
        if not file.all("scenes"):
            raise file.error("has no scene", "export with a default scene")
        scene = Entry(file.path, "the scene", file.named(file.head, file.head.get("scene", 0), "scenes").values)
        scene.refuse_unknown()
        waiting = [(node, -1, scene) for node in reversed(scene.items("nodes"))]
        while waiting:
            node, parent, above = waiting.pop()
            entry = file.named(above, node, "nodes")
            if node in self.place:
                raise file.error(f"node {node} has two parents", "its nodes must form trees")
            entry.refuse_unknown()
            here = self.place[node] = len(self.entries)
            waiting += [(child, here, entry) for child in reversed(entry.items("children"))]
            self.entries.append(entry)
            self.parents.append(parent)

    def _locals(self) -> Matrices:
        result = composed(**self.parts)
        for i, entry in enumerate(self.entries):
            if "matrix" in entry:
                result[i] = affine(np.array(entry.numbers("matrix", (0.0,) * 16)), entry)
                for key, rest in REST.items():
                    if not np.array_equal(self.parts[key][i], rest):
                        raise entry.error(f"has both a matrix and a {key}")
        return result

    def moved(self, places: set[int]) -> list[I64]:
        """These places and all below them, by depth: for :meth:`posed`."""
        found: set[int] = set()
        for i, above in enumerate(self.parents):
            if i in places or above in found:
                found.add(i)
        return self.levels(sorted(found))

    def above(self, places: set[int]) -> set[int]:
        """These places and all above them."""
        found = set(places)
        for i in range(len(self.parents) - 1, -1, -1):
            if i in found and self.parents[i] >= 0:
                found.add(self.parents[i])
        return found

    def posed(self, local: Matrices, levels: list[I64]) -> Matrices:
        """The transforms to the scene with these transforms to the parents, where only the nodes of ``levels`` move."""
        world, parents = self.world.copy(), np.array(self.parents, dtype=np.int64)
        with np.errstate(over="ignore", invalid="ignore"):
            for places in levels:
                roots = parents[places] < 0
                world[places[roots]] = local[places[roots]]
                below = places[~roots]
                world[below] = world[parents[below]] @ local[below]
        return world

    def levels(self, places: Sequence[int]) -> list[I64]:
        """Places by their depth, the roots first."""
        levels: dict[int, list[int]] = {}
        for i in places:
            levels.setdefault(self._depths[i], []).append(i)
        return [np.array(levels[depth]) for depth in sorted(levels)]


def _visible(node: Entry) -> bool:
    said = node.extension("KHR_node_visibility")
    shown = True if said is None else said.get("visible", True)
    if not isinstance(shown, bool):
        raise node.error(f": visible is {shown!r}, not true or false")
    return shown


class Instances:
    """The transforms of a node's instances to it (EXT_mesh_gpu_instancing); itself alone without the extension.

    count  number of instances
    given  whether there is the extension
    """

    def __init__(self, accessors: Accessors, node: Entry) -> None:
        said = node.extension("EXT_mesh_gpu_instancing")
        self.given, self.count = said is not None, 1
        if said is not None:
            said.refuse_unknown()
            self._accessors, self._attributes = accessors, said.object("attributes")
            counts = {len(accessors.raw(self._attributes, name)) for name in self._attributes.values}
            if len(counts) != 1:
                raise node.error(f": the attributes of its instances have the counts {sorted(counts)}")
            self.count = counts.pop()

    def matrices(self) -> Matrices:
        """The transforms, [instance_count, 4, 4]; :data:`ONCE` for the node alone."""
        if not self.given:
            return ONCE
        columns = {
            part: self._accessors.floats(self._attributes, part.upper(), len(rest)).astype(np.float64)
            if part.upper() in self._attributes
            else np.broadcast_to(np.array(rest), (self.count, len(rest)))
            for part, rest in REST.items()
        }
        return composed(**columns)


class Skin:
    """The joints that bend a mesh: their places in the tree, and the transforms of a mesh to each of them."""

    def __init__(self, accessors: Accessors, tree: Tree, entry: Entry) -> None:
        entry.refuse_unknown()
        nodes = entry.items("joints")
        if not nodes:
            raise entry.error("has no joints")
        for node in nodes:
            if type(node) is not int or node not in tree.place:
                raise entry.error(f": its joint {node!r} is no node of the scene")
        self.joints = np.array([tree.place[node] for node in nodes], dtype=np.int64)
        self.inverse = np.broadcast_to(np.eye(4), (len(nodes), 4, 4))
        if "inverseBindMatrices" in entry:
            stored = accessors.floats(entry, "inverseBindMatrices", 16)
            if len(stored) < len(nodes):
                raise entry.error(f"has {len(nodes)} joints, but {len(stored)} matrices")
            self.inverse = affine(stored[: len(nodes)].astype(np.float64), entry)

    def matrices(self, world: Matrices) -> Matrices:
        """The transforms of a mesh to the scene by each joint, [joint_count, 4, 4]."""
        with np.errstate(over="ignore", invalid="ignore"):
            return world[self.joints] @ self.inverse
