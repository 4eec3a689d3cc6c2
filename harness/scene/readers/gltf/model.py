"""What a glTF scene draws: which vertices stand where in the result, what moves them, and the triangles of all."""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....arrays import I32, Bools
from .accessors import Accessors
from .container import Container, MissingError
from .deformation import Skin, check_influences
from .document import counted
from .nodes import ONCE, Instances, Matrices, Tree, mirrored
from .primitives import Meshes, Primitive, Vertices

_DRAWN = 1 << 25
"""Largest number of triangles and of vertices with instances, unless the file itself has as many bytes: through instances
a small file could have any number."""

_DRAWS = 1 << 21
"""Largest number of primitives and of instances over all nodes."""


@dataclass(frozen=True, eq=False)
class Block:
    """Vertices of the result that move together: those of one or more primitives, in every instance of a node.

    start      the first of them
    place      of the node in the tree
    instances  the transforms of its instances to the node, [instance_count, 4, 4]
    turned     whether each of them is mirrored in the scene, so that its triangles face the other way
    skin       what bends them instead of the node's transform, or None
    weights    of their morph targets, where no animation says otherwise
    """

    start: int
    vertices: Vertices
    place: int
    instances: Matrices
    turned: Bools
    skin: Skin | None
    weights: list[float]

    @property
    def count(self) -> int:
        return len(self.instances) * len(self.vertices.positions)

    def matrices(self, world: Matrices) -> Matrices:
        """The transforms of its instances to the scene."""
        own = world[self.place]
        if self.instances is ONCE:
            return own[None]
        with np.errstate(over="ignore", invalid="ignore"):
            return own @ self.instances


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What the node at a place draws; ``weights`` of its morph targets."""

    place: int
    primitives: list[Primitive]
    skin: Skin | None
    instances: Instances
    weights: list[float]

    @property
    def triangle_count(self) -> int:
        return self.instances.count * sum(len(primitive.corners) for primitive in self.primitives)


class Model:
    """Everything that the default scene draws.

    Order: nodes depth first; the primitives of a mesh in the order of the file, each in all instances of the node in turn.
    Vertices that several primitives have in common at one place are there once.

    blocks        all vertices
    vertex_count  of all blocks
    materials     the indices of the materials that are drawn
    """

    def __init__(self, file: Container, accessors: Accessors, tree: Tree, allow_missing: bool) -> None:
        self.blocks: list[Block] = []
        self.vertex_count = 0
        self.materials: set[int] = set()
        self._file, self._document = file, file.document
        self._accessors, self._tree = accessors, tree
        self._meshes = Meshes(self._document, accessors)
        self._mirrored = mirrored(tree.world)
        self._skins: dict[str, Skin] = {}
        self._blocks: dict[Hashable, Block] = {}
        self._parts: list[tuple[Block, Primitive]] = []
        self._missing = self._doubtful = 0
        shown = [i for i in range(len(tree.nodes)) if tree.shown[i] and "mesh" in tree.entry(i)]
        drawn = [found for place in shown if (found := self._read(place, allow_missing)) is not None]
        self._triangle_count = sum(one.triangle_count for one in drawn)
        self._refuse_more(self._triangle_count, max(_DRAWN, file.size), "triangles")
        self._refuse_more(sum(len(one.primitives) + one.instances.count for one in drawn), _DRAWS, "primitives")
        if not self._triangle_count:
            raise self._document.error("holds no triangles", "give a triangle mesh")
        for one in drawn:
            self._add(one)
            self._refuse_more(self.vertex_count, max(_DRAWN, file.size), "vertices")

    def _refuse_more(self, count: int, most: int, what: str) -> None:
        if count > most:
            problem = f"has {count} {what} with instances, more than {most}"
            raise self._document.error(problem, "export a part of it")

    def _read(self, place: int, allow_missing: bool) -> _Drawn | None:
        """What a node draws; None where its data are in a file that is missing, if that is allowed."""
        entry, name = self._tree.entry(place), f"node {self._tree.nodes[place]}"
        try:
            skin = self._skin(entry["skin"], name) if "skin" in entry else None
            placed = Instances(self._document, self._accessors, entry, name)
            if skin is not None and placed.given:
                raise self._document.error(f"{name} has both a skin and instances", "leave one of them out")
            primitives = self._meshes.primitives(entry["mesh"], name, skin is not None)
            return _Drawn(place, primitives, skin, placed, self._meshes.weights(entry["mesh"], entry, name))
        except MissingError:
            if not allow_missing:
                raise
            self._missing += 1
            return None

    def _add(self, drawn: _Drawn) -> None:
        """Add what a node draws."""
        place, each = drawn.place, drawn.instances.matrices()
        turned = self._mirrored[place : place + 1] & (drawn.skin is None)
        if drawn.instances.given:
            turned = mirrored(each) ^ turned
        for primitive in drawn.primitives:
            weights = drawn.weights if primitive.vertices.targets else []
            block = Block(self.vertex_count, primitive.vertices, place, each, turned, drawn.skin, weights)
            self._parts.append((self._shared(block), primitive))
            self.materials.update([] if primitive.material is None else [primitive.material])

    def _shared(self, block: Block) -> Block:
        """The block of the same vertices at the same place if there is one, else this one, which is then added."""
        if self._document.all("animations"):
            where: Hashable = block.place
        elif block.skin is None:  # without animation, what stands at the same place stays there
            where = block.matrices(self._tree.world).tobytes()
        else:
            where = id(block.skin)  # kept in _skins
        key = (block.vertices.key, where, tuple(block.weights))
        if key not in self._blocks:
            self._blocks[key] = block
            self.blocks.append(block)
            self.vertex_count += block.count
            if block.skin is not None:
                name = f"node {self._tree.nodes[block.place]}"
                self._doubtful += check_influences(self._document, block.skin, block.vertices, name)
        return self._blocks[key]

    def _skin(self, index: Any, name: str) -> Skin:
        if str(index) not in self._skins:
            self._skins[str(index)] = Skin.of(self._document, self._accessors, self._tree, index, name)
        return self._skins[str(index)]

    def notes(self) -> list[str]:
        """What was left out or is doubtful."""
        left, found = self._meshes.left_out, []
        if left["no surface"]:
            found.append(f"{counted(left['no surface'], 'primitive')} of points or lines left out")
        if left["no positions"]:
            found.append(f"{counted(left['no positions'], 'primitive')} without positions left out")
        if self._missing:
            found.append(f"{counted(self._missing, 'node')} left out, whose data are in a missing file")
        if self._doubtful:
            vertices = counted(self._doubtful, "vertex", "vertices")
            found.append(f"{vertices} without joint weights follow their first joint")
        return found

    def carrying(self) -> set[int]:
        """The places of the nodes whose transforms move what is drawn."""
        found: set[int] = set()
        for block in self.blocks:
            found.update([block.place] if block.skin is None else block.skin.joints.tolist())
        return self._tree.above(found)

    def targets(self) -> dict[int, int]:
        """Of the nodes that draw vertices with morph targets: how many targets."""
        found: dict[int, int] = {}
        for block in self.blocks:
            if block.vertices.targets:
                found[block.place] = max(found.get(block.place, 0), len(block.vertices.targets))
        return found

    def faces(self) -> I32:
        """All triangles, int32 [triangle_count, 3]. Where a transform mirrors, the last two corners change places."""
        result, at = np.empty((self._triangle_count, 3), dtype=np.int32), 0
        for block, primitive in self._parts:
            corners, placed = primitive.corners, len(block.instances)
            starts = block.start + len(block.vertices.positions) * np.arange(placed)
            part = result[at : at + placed * len(corners)].reshape(placed, -1, 3)
            np.add(corners, starts[:, None, None], out=part, dtype=np.int64, casting="unsafe")
            if block.turned.any():
                part[block.turned] = part[block.turned][:, :, [0, 2, 1]]
            at += placed * len(corners)
        return result
