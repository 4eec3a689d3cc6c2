"""How good a tree is, by the areas of its boxes: the nodes and triangles that a random ray meets.

A ray that meets the box of the scene meets a box in it with the probability of the ratio of their surfaces (MacDonald and
Booth, "Heuristics for ray tracing using space subdivision", 1990). Boxes are those that rays meet: padded, with extents
rounded up. Computed on the host, outside a frame.
"""

import numpy as np
from numpy.typing import NDArray

from .native import INDEX, LEAF, NONE, PAIR
from .nodes import NODE_BYTES, Tree

F64 = NDArray[np.float64]
TINY = 1e-300
"""In place of the area of a scene that has none."""


def surface(sides: F64) -> F64:
    """The surface of boxes by their sides, [..., 3], over 2; 0 of a box that holds nothing."""
    x, y, z = np.moveaxis(np.maximum(sides, 0.0), -1, 0)
    return np.asarray(x * y + y * z + z * x)


def counters_of(inner: float, tested: float, whole: float) -> dict[str, int]:
    """Nodes and triangles that a hundred rays meet, as counters of a method: from the areas of all inner nodes, of leaves
    times their triangles, and of the box of the scene.
    """
    nodes, tests = (round(100 * area / max(whole, TINY)) for area in (inner, tested))
    return {"expected nodes a hundred rays": nodes, "expected tests a hundred rays": tests}


def expected(tree: Tree) -> dict[str, int]:
    """Nodes and triangles that a hundred rays meet, as counters of a method."""
    centres, extents, refs = children(tree.nodes.numpy().reshape(-1, NODE_BYTES // 4))
    areas = surface(2.0 * extents)
    root = int(tree.root.numpy().view(np.uint32)[0])
    bodies = tree.bodies.numpy().view(np.uint32)[3::4, 0] if tree.bodies else np.zeros(0, dtype=np.uint32)
    if len(bodies) and root & LEAF and root != NONE:
        root = int(bodies[root & INDEX])
    if root & LEAF:
        return counters_of(0.0, 0.0 if root == NONE else 1.0 + ((root & PAIR) != 0), 1.0)
    some = areas[root] > 0
    if not some.any():
        return counters_of(0.0, 0.0, 0.0)
    low, high = ((centres + sign * extents)[root, some] for sign in (-1.0, 1.0))
    whole = float(surface(high.max(axis=0) - low.min(axis=0)))
    inner, tested = whole, 0.0
    level = np.array([root], dtype=np.uint32)
    while len(level):
        own, area = refs[level].ravel(), areas[level].ravel()
        if len(bodies):  # a leaf of the first level is the root of a body's tree
            outer = np.repeat(level < len(bodies), 2) & ((own & np.uint32(LEAF)) != 0)
            own[outer] = bodies[own[outer] & np.uint32(INDEX)]
        leaf = (own & np.uint32(LEAF)) != 0
        held = 1 + ((own & np.uint32(PAIR)) != 0)
        tested += float((area * held)[leaf].sum())
        further = ~leaf & (area > 0)
        inner += float(area[further].sum())
        level = own[further]
    return counters_of(inner, tested, whole)


def children(nodes: NDArray[np.float32]) -> tuple[F64, F64, NDArray[np.uint32]]:
    """Centres and extents of both children, [nodes, 2, 3], and the references to them, [nodes, 2]."""
    words = nodes[:, :8].reshape(-1, 2, 4)
    packed = np.ascontiguousarray(nodes[:, 8:11]).view(np.uint16).reshape(-1, 2, 3)
    extents = (packed.astype(np.uint32) << 16).view(np.float32)
    refs = np.ascontiguousarray(words[..., 3]).view(np.uint32)
    return words[..., :3].astype(np.float64), extents.astype(np.float64), refs
