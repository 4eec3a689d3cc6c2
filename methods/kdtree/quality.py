"""How good a kd-tree is (:mod:`..trees.quality`), by the regions of its nodes: computed on the host."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..trees.quality import counters_of, surface
from .nodes import LEAF, Tree

F64 = NDArray[np.float64]


def expected(tree: Tree) -> dict[str, int]:
    """Nodes and triangles that a hundred rays meet, as counters of a method."""
    inner, tested, whole = 0.0, 0.0, 0.0
    for sides, members in levels(tree):
        areas, leaf = surface(sides), members >= 0
        whole = whole or float(areas[0])
        inner += float(areas[~leaf].sum())
        tested += float((areas * members)[leaf].sum())
    return counters_of(inner, tested, whole)


def levels(tree: Tree) -> Iterator[tuple[F64, NDArray[np.int64]]]:
    """Level by level, the sides of nodes' regions, [nodes, 3], and how many triangles a leaf has; -1: an inner node."""
    words = tree.nodes.numpy()
    box = tree.box.numpy().astype(np.float64)
    low, high, level = box[None, :3], -box[None, 3:], np.zeros(1, dtype=np.int64)
    while len(level):
        first, second = words[level, 0], words[level, 1].astype(np.int64)
        axis, rest = second & int(LEAF), second >> 2
        leaf = axis == int(LEAF)
        yield high - low, np.where(leaf, rest, -1)
        low, high, axis, plane = low[~leaf], high[~leaf], axis[~leaf], first[~leaf].view(np.float32)
        below, above = high.copy(), low.copy()
        np.put_along_axis(below, axis[:, None], plane[:, None].astype(np.float64), axis=1)
        np.put_along_axis(above, axis[:, None], plane[:, None].astype(np.float64), axis=1)
        low, high = np.concatenate([low, above]), np.concatenate([below, high])
        level = np.concatenate([rest[~leaf], rest[~leaf] + 1])
