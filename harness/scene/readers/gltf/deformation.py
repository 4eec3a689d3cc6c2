"""Where the vertices of a glTF mesh are: displaced by morph targets, then moved by their node or bent by a skin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....arrays import Floats
from .accessors import Accessors
from .entries import Entry
from .nodes import Matrices, Tree, affine
from .primitives import Vertices

_BLOCK = 1 << 16
"""Vertices that are bent at a time."""


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

    def unweighted(self, vertices: Vertices, node: Entry) -> int:
        """The number of vertices without any weight. Raises :class:`UserError` for a joint that is not there."""
        wrong = (vertices.joints >= len(self.joints)) & (vertices.weights != 0)
        if wrong.any():
            raise node.error(f"names joint {vertices.joints[wrong].max()}, but its skin has {len(self.joints)}")
        return int(np.count_nonzero(~vertices.weights.any(axis=1)))


def displaced(vertices: Vertices, weights: Sequence[float] | NDArray) -> Floats:
    """Positions [count, 3] with each target's displacement times its weight; float64 where there is one."""
    result: Floats = vertices.positions
    with np.errstate(over="ignore", invalid="ignore"):
        for target, weight in zip(vertices.targets, weights, strict=False):
            if target is not None and weight:
                result = result + np.multiply(target, weight, dtype=np.float64)
    return result


def transformed(points: Floats, matrices: Matrices, result: Floats) -> None:
    """Write each transform of the points into ``result`` [matrix_count, point_count, 3].

    Points that no transform moves stay as they are stored, bit for bit.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        if (matrices == np.eye(4)).all():
            result[:] = points
            return
        exact = points.astype(np.float64)
        for k in range(0, len(matrices), step := max(1, _BLOCK // max(1, len(points)))):
            some = matrices[k : k + step]
            result[k : k + step] = exact @ some[:, :3, :3].transpose(0, 2, 1) + some[:, None, :3, 3]


def bent(points: Floats, vertices: Vertices, joints: Matrices, result: Floats) -> None:
    """Write the points, each moved by the weighted mean of its joints' transforms, into ``result`` [count, 3].

    Weights need not add up to 1: in homogeneous coordinates, as renderers have them, their sum divides out. A point
    without any weight follows its first joint.
    """
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
