"""The vertices of a glTF scene at a time: displaced by morph targets, then moved by their node or bent by a skin."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ....arrays import F64, I32, Floats
from .animation import Animation
from .model import Block, Model
from .nodes import Matrices, Tree
from .primitives import Vertices

MOST_POSITIONS = 1 << 27  # largest number of vertices of all frames together: 3 GiB

MOST_FRAMES = 1 << 14
"""Largest number of frames that are read: each takes about half a millisecond, however little moves."""

_BLOCK = 1 << 16  # vertices that are bent at a time


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
        plain = block.skin is None and not any(block.weights) and block.vertices.positions.dtype == np.float32
        return plain and bool((block.matrices(self._tree.world) == np.eye(4)).all())


def _write(result: Floats, blocks: list[Block], world: Matrices, weights: Mapping[int, F64]) -> None:
    for block in blocks:
        points = _displaced(block.vertices, weights.get(block.place, block.weights))
        part = result[block.start : block.start + block.count]
        if block.skin is not None:
            _bent(points, block.vertices, block.skin.matrices(world), part)
        else:
            _transformed(points, block.matrices(world), part.reshape(len(block.instances), -1, 3))


def _displaced(vertices: Vertices, weights: Sequence[float] | NDArray) -> Floats:
    """Positions [count, 3] with each target's displacement times its weight; float64 where there is one."""
    result: Floats = vertices.positions
    with np.errstate(over="ignore", invalid="ignore"):
        for target, weight in zip(vertices.targets, weights, strict=False):
            if target is not None and weight:
                result = result + np.multiply(target, weight, dtype=np.float64)
    return result


def _transformed(points: Floats, matrices: Matrices, result: Floats) -> None:
    """Write each transform of the points into ``result`` [matrix_count, point_count, 3]. Points that no transform moves
    stay as they are stored, bit for bit."""
    with np.errstate(over="ignore", invalid="ignore"):
        if (matrices == np.eye(4)).all():
            result[:] = points
            return
        exact = points.astype(np.float64)
        for k in range(0, len(matrices), step := max(1, _BLOCK // max(1, len(points)))):
            some = matrices[k : k + step]
            result[k : k + step] = exact @ some[:, :3, :3].transpose(0, 2, 1) + some[:, None, :3, 3]


def _bent(points: Floats, vertices: Vertices, joints: Matrices, result: Floats) -> None:
    """Write the points, each moved by the weighted mean of its joints' transforms, into ``result`` [count, 3]. Weights
    need not add up to 1: in homogeneous coordinates, as renderers have them, their sum divides out. A point without any
    weight follows its first joint."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for k in range(0, len(points), _BLOCK):
            some = slice(k, k + _BLOCK)
            weights = vertices.weights[some].astype(np.float64)
            weights[~weights.any(axis=1), :1] = 1.0
            places = np.where(weights != 0.0, vertices.joints[some], 0)
            sums = np.zeros((len(weights), 3, 4))
            for i in range(weights.shape[1]):
                sums += weights[:, i, None, None] * joints[places[:, i], :3]
            own = points[some].astype(np.float64)
            moved = np.einsum("vij,vj->vi", sums[:, :, :3], own) + sums[:, :, 3]
            result[some] = moved / weights.sum(axis=1, keepdims=True)
