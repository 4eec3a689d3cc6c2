"""What a glTF scene draws: which vertices stand where in the result, what moves them, and the triangles of all."""

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

from ....arrays import I32, Bools
from .accessors import Accessors
from .container import Entry, MissingError, counted
from .nodes import ONCE, Instances, Matrices, Skin, Tree, mirrored
from .primitives import Meshes, Primitive, Vertices

_DRAWN = 1 << 25
"""Largest number of triangles and of vertices with instances, unless the file itself has as many bytes: through instances
a small file could have any number.
"""

_DRAWS = 1 << 21  # largest number of primitives and of instances over all nodes


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

    @property
    def movers(self) -> list[int]:
        """The places of the nodes whose transforms move it."""
        return [self.place] if self.skin is None else self.skin.joints.tolist()

    def matrices(self, world: Matrices) -> Matrices:
        """The transforms of its instances to the scene."""
        own = world[self.place]
        if self.instances is ONCE:
            return own[None]
        with np.errstate(over="ignore", invalid="ignore"):
            return own @ self.instances


_Drawn = tuple[int, list[Primitive], Skin | None, Instances, list[float]]
"""What the node at a place draws, and the weights of its morph targets."""


class Model:
    """Everything that the default scene draws.

    Order: nodes depth first; the primitives of a mesh in the order of the file, each in all instances of the node in turn.
    Vertices that several primitives have in common at one place are there once.

    blocks        all vertices
    vertex_count  of all blocks
    materials     the indices of the materials that are drawn
    notes         what was left out or is doubtful
    """

    def __init__(self, accessors: Accessors, tree: Tree, allow_missing: bool) -> None:
        self.blocks: list[Block] = []
        self.vertex_count = self._doubtful = missing = 0
        self.materials: set[int] = set()
        self._file, self._accessors, self._tree = accessors.file, accessors, tree
        self._meshes = Meshes(accessors)
        self._skins: dict[str, Skin] = {}
        self._blocks: dict[Hashable, Block] = {}
        self._parts: list[tuple[Block, Primitive]] = []
        drawn: list[_Drawn] = []
        for place, node in enumerate(tree.entries):
            if tree.shown[place] and "mesh" in node:
                try:
                    drawn.append(self._read(place, node))
                except MissingError:
                    if not allow_missing:
                        raise
                    missing += 1
        most = max(_DRAWN, self._file.size)
        self._triangle_count = sum(
            instances.count * sum(len(one.corners) for one in primitives) for _, primitives, _, instances, _ in drawn
        )
        self._refuse_more(self._triangle_count, most, "triangles")
        draws = sum(len(primitives) + instances.count for _, primitives, _, instances, _ in drawn)
        self._refuse_more(draws, _DRAWS, "primitives")
        if not self._triangle_count:
            raise self._file.error("holds no triangles", "give a triangle mesh")
        turned = mirrored(tree.world)
        for one in drawn:
            self._add(one, turned[one[0] : one[0] + 1])
            self._refuse_more(self.vertex_count, most, "vertices")
        surfaceless, placeless = (self._meshes.left_out[why] for why in ("no surface", "no positions"))
        vertices = counted(self._doubtful, "vertex", "vertices")
        told = {
            f"{counted(surfaceless, 'primitive')} of points or lines left out": surfaceless,
            f"{counted(placeless, 'primitive')} without positions left out": placeless,
            f"{counted(missing, 'node')} left out, whose data are in a missing file": missing,
            f"{vertices} without joint weights follow their first joint": self._doubtful,
        }
        self.notes = [note for note, count in told.items() if count]

    def _refuse_more(self, count: int, most: int, what: str) -> None:
        if count > most:
            raise self._file.error(f"has {count} {what} with instances, more than {most}", "export a part of it")

    def _read(self, place: int, node: Entry) -> _Drawn:
        skin = None
        if "skin" in node:
            entry = self._file.named(node, node.get("skin"), "skins")
            if entry.name not in self._skins:
                self._skins[entry.name] = Skin(self._accessors, self._tree, entry)
            skin = self._skins[entry.name]
        instances = Instances(self._accessors, node)
        if skin is not None and instances.given:
            raise node.error("has both a skin and instances", "leave one of them out")
        mesh = self._file.named(node, node.get("mesh"), "meshes")
        primitives = self._meshes.primitives(mesh, skin is not None)
        weighted = next((entry for entry in (node, mesh) if "weights" in entry), None)
        weights = weighted.numbers("weights", [0.0] * len(weighted.items("weights"))) if weighted else []
        return place, primitives, skin, instances, weights

    def _add(self, drawn: _Drawn, turned: Bools) -> None:
        """Add what a node draws. ``turned``: whether its transform mirrors, [1]."""
        place, primitives, skin, instances, weights = drawn
        each = instances.matrices()
        turned = mirrored(each) ^ turned if instances.given else turned & (skin is None)
        for primitive in primitives:
            vertices, own = primitive.vertices, weights if primitive.vertices.targets else []
            block = self._shared(Block(self.vertex_count, vertices, place, each, turned, skin, own))
            self._parts.append((block, primitive))
            self.materials.update([] if primitive.material is None else [primitive.material])

    def _shared(self, block: Block) -> Block:
        """The block of the same vertices at the same place if there is one, else this one, which is then added."""
        if self._file.all("animations"):
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
                self._doubtful += self._unweighted(block.vertices, len(block.skin.joints), block.place)
        return self._blocks[key]

    def _unweighted(self, vertices: Vertices, joints: int, place: int) -> int:
        """The number of vertices without any weight. Raises :class:`UserError` for a joint that is not there."""
        wrong = (vertices.joints >= joints) & (vertices.weights != 0)
        if wrong.any():
            problem = f"names joint {vertices.joints[wrong].max()}, but its skin has {joints}"
            raise self._tree.entries[place].error(problem)
        return int(np.count_nonzero(~vertices.weights.any(axis=1)))

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
