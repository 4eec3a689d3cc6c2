"""The vertices of a glTF scene at a time, and in the frames of its animation."""

from collections.abc import Mapping

import numpy as np

from ....arrays import F64, I32, Floats
from .animation import Animation
from .deformation import bent, displaced, transformed
from .model import Block, Model
from .nodes import Matrices, Tree

MOST_POSITIONS = 1 << 27
"""Largest number of vertices of all frames together: 3 GiB."""

MOST_FRAMES = 1 << 14
"""Largest number of frames that are read: each takes about half a millisecond, however little moves."""


class Frames:
    """Positions at any time. What no animation moves is computed once.

    first  the transforms of all nodes to the scene at the first time
    """

    def __init__(self, model: Model, tree: Tree, animation: Animation | None, time: float) -> None:
        self._tree, self._animation = tree, animation
        self._levels = tree.moved(animation.moving if animation else set())
        moved = {int(place) for places in self._levels for place in places}
        bending = set(animation.weights(time)) if animation else set()
        self._bent = bending | {block.place for block in model.blocks if block.skin is not None}
        self._moving = [one for one in model.blocks if one.place in bending or not moved.isdisjoint(one.movers)]
        self.first, weights = self._pose(time)
        stored = animation is None and all(self._as_stored(block) for block in model.blocks)
        self.points: Floats = np.empty((model.vertex_count, 3), np.float32 if stored else np.float64)
        _write(self.points, model.blocks, self.first, weights)

    def at(self, time: float) -> Floats:
        """Positions [vertex_count, 3] at a time."""
        result = self.points.copy()
        _write(result, self._moving, *self._pose(time))
        return result

    def bodies(self) -> I32 | None:
        """What each vertex moves with: 0, the scene, or its node's number; None where skins or morph targets bend one."""
        if any(block.place in self._bent for block in self._moving):
            return None
        result = np.zeros(len(self.points), dtype=np.int32)
        for block in self._moving:
            result[block.start : block.start + block.count] = 1 + block.place
        return result

    def _pose(self, time: float) -> tuple[Matrices, Mapping[int, F64]]:
        """The transforms of all nodes to the scene, and the weights of morph targets that are animated."""
        if self._animation is None:
            return self._tree.world, {}
        local = self._animation.local(self._tree, time)
        return self._tree.posed(local, self._levels), self._animation.weights(time)

    def _as_stored(self, block: Block) -> bool:
        """Whether the positions of a block are those of the file."""
        plain = block.skin is None and not any(block.weights) and block.vertices.positions.dtype == np.float32
        return plain and bool((block.matrices(self._tree.world) == np.eye(4)).all())


def _write(result: Floats, blocks: list[Block], world: Matrices, weights: Mapping[int, F64]) -> None:
    """Write the positions of some blocks into ``result`` [vertex_count, 3]."""
    for block in blocks:
        points = displaced(block.vertices, weights.get(block.place, block.weights))
        part = result[block.start : block.start + block.count]
        if block.skin is not None:
            bent(points, block.vertices, block.skin.matrices(world), part)
        else:
            transformed(points, block.matrices(world), part.reshape(len(block.instances), -1, 3))
