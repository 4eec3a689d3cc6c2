"""How good a tree is, by the areas of its boxes: the nodes and triangles that a random ray meets.

A ray that meets the box of the scene meets a box in it with the probability of the ratio of their surfaces (MacDonald and
Booth, "Heuristics for ray tracing using space subdivision", 1990). Boxes are those that rays meet: padded, with extents
rounded up (:mod:`.nodes`). Computed on the host, outside a frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .native import LEAF, NONE, PAIR
from .nodes import NODE_BYTES, Tree

F64 = NDArray[np.float64]
TINY = 1e-300
"""In place of the area of a scene that has none."""


def expected(tree: Tree) -> dict[str, int]:
    """Nodes and triangles that a hundred rays meet, as counters of a method."""
    nodes = tree.nodes.numpy().reshape(-1, NODE_BYTES // 4)
    centres, extents, refs = children(nodes)
    areas = surface(extents)
    root = int(tree.root.numpy().view(np.uint32)[0])
    if root & LEAF:
        met, tests = 0.0, 0.0 if root == NONE else 1.0 + ((root & PAIR) != 0)
    else:
        some = areas[root] > 0
        ends = (centres[root, some] - extents[root, some], centres[root, some] + extents[root, some])
        whole = float(surface(0.5 * (ends[1].max(axis=0) - ends[0].min(axis=0)))) if some.any() else 0.0
        met, tests = (total / max(whole, TINY) for total in met_areas(areas, refs, root, whole))
    return {"expected nodes a hundred rays": round(100 * met), "expected tests a hundred rays": round(100 * tests)}


def met_areas(areas: F64, refs: NDArray[np.uint32], root: int, whole: float) -> tuple[float, float]:
    """The sum of the areas of all nodes, that of the root being ``whole``, and of leaves times their triangles."""
    inner, tested = whole, 0.0
    level = np.array([root], dtype=np.uint32)
    while len(level):
        own, area = refs[level].ravel(), areas[level].ravel()
        leaf = (own & np.uint32(LEAF)) != 0
        held = 1 + ((own & np.uint32(PAIR)) != 0)
        tested += float((area * held)[leaf].sum())
        further = ~leaf & (area > 0)
        inner += float(area[further].sum())
        level = own[further]
    return inner, tested


def children(nodes: NDArray[np.float32]) -> tuple[F64, F64, NDArray[np.uint32]]:
    """Centres and extents of both children, [nodes, 2, 3], and the references to them, [nodes, 2]."""
    words = nodes[:, :8].reshape(-1, 2, 4)
    packed = np.ascontiguousarray(nodes[:, 8:11]).view(np.uint16).reshape(-1, 2, 3)
    extents = (packed.astype(np.uint32) << 16).view(np.float32)
    refs = np.ascontiguousarray(words[..., 3]).view(np.uint32)
    return words[..., :3].astype(np.float64), extents.astype(np.float64), refs


def surface(extents: F64) -> F64:
    """The surface of boxes by their half sides, [..., 3], over 8; 0 of a box that holds nothing."""
    x, y, z = np.moveaxis(np.maximum(extents, 0.0), -1, 0)
    return np.asarray(x * y + y * z + z * x)
