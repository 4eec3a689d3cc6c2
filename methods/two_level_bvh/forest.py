"""The trees of all bodies in one array, made on the host once, of the first frame.

Topologies are by the surface area heuristic (:mod:`..trees.builders.sah`), all bodies at once. Boxes hold the triangles
whose corners are finite there, also those without an area, which may have one after a rotation has been rounded.
"""

import numpy as np
from numpy.typing import NDArray

from ..trees.builders.sah import boxes, sah_topology
from ..trees.native import INDEX, LEAF, NONE
from ..trees.nodes import EMPTY_EXTENT

U32 = NDArray[np.uint32]


class Forest:
    """The trees of the ``bodies`` (0, 1, 2, ...) of triangles with these corners, float32 [triangles, 3, 3].

    first      the number of the first node: those before are of the first level
    refs       uint32 [nodes, 2]: the references to both children (:mod:`..trees.native`)
    low, high  float64 [nodes, 2, 3]: of the boxes of both children
    roots      uint32 [bodies]: the reference to each root
    """

    def __init__(self, corners: NDArray[np.float32], bodies: NDArray[np.int32], first: int):
        finite = np.asarray(np.isfinite(corners).all(axis=(1, 2)))
        low, high = boxes(np.where(finite[:, None, None], corners, np.float32(0.0)), finite.astype(np.uint8))
        low[~finite], high[~finite] = np.inf, -np.inf
        made = sah_topology(corners, finite.astype(np.uint8), bodies)
        refs = made.leaves().reshape(-1, 2)
        leaf = (refs & np.uint32(LEAF)) != 0
        triangles = np.where(leaf, refs & np.uint32(INDEX), 0)
        self.low = np.where(leaf[..., None], low[triangles], np.inf)
        self.high = np.where(leaf[..., None], high[triangles], -np.inf)
        is_root = (made.node_parent < 0) & refs.any(axis=1)
        levels = [np.flatnonzero(is_root)]
        while len(levels[-1]):
            levels.append(refs[levels[-1]][~leaf[levels[-1]]].astype(np.int64))
        for level in levels[:0:-1]:
            slot = made.node_parent[level]
            self.low.reshape(-1, 3)[slot] = self.low[level].min(axis=1)
            self.high.reshape(-1, 3)[slot] = self.high[level].max(axis=1)
        self.refs = np.where(leaf, refs, refs + np.uint32(first))
        single = made.order[made.leaf_parent < 0]
        self.roots = np.full(bodies.max() + 1, NONE, dtype=np.uint32)
        self.roots[bodies[single]] = np.where(
            finite[single], np.uint32(LEAF) | single.astype(np.uint32), np.uint32(NONE)
        )
        self.roots[bodies[made.order[levels[0]]]] = (levels[0] + first).astype(np.uint32)

    def packed(self, pad: float) -> NDArray[np.float32]:
        """The nodes as rays read them (:mod:`..trees.nodes`), float32 [nodes, 12], boxes padded by ``pad``."""
        some = self.low <= self.high
        with np.errstate(invalid="ignore", over="ignore"):
            centre = np.where(some, 0.5 * self.low + 0.5 * self.high, 0.0).astype(np.float32)
            away = np.maximum(self.high - centre, centre - self.low)
            # Rounded up to 16 bits, and before that to 24: enlarged by more than half a unit of these.
            extent = np.where(some, (away + pad) * (1.0 + 2.0**-22), EMPTY_EXTENT).astype(np.float32)
        halves = ((extent.view(np.uint32) + np.uint32(0xFFFF)) >> np.uint32(16)).reshape(-1, 6)
        nodes = np.zeros((len(self.refs), 12), dtype=np.uint32)
        words = nodes[:, :8].reshape(-1, 2, 4)
        words[..., :3], words[..., 3] = centre.view(np.uint32), self.refs
        nodes[:, :8] = words.reshape(-1, 8)
        nodes[:, 8:11] = halves[:, 0::2] | halves[:, 1::2] << np.uint32(16)
        return nodes.view(np.float32)


def references(points: NDArray[np.float32], faces: NDArray[np.int32], bodies: NDArray[np.int32]) -> NDArray[np.int32]:
    """Three vertices of each body that tell how it has turned, int32 [bodies, 3], as far apart as they come: a far from the
    body's middle, b far from a, c far from their line.

    An error of the place of one then moves no vertex of the body by more than a few times as much.
    """
    count = int(bodies.max()) + 1
    of, vertex = used_vertices(faces, bodies)
    at = points[vertex].astype(np.float64)
    finite = np.isfinite(at).all(axis=1)
    at[~finite] = 0.0
    number = np.maximum(np.bincount(of, finite, count), 1.0)
    middle = np.stack([np.bincount(of, at[:, axis], count) for axis in range(3)], axis=-1) / number[:, None]

    def farthest(size: NDArray[np.float64]) -> NDArray[np.int64]:
        order = np.lexsort((np.where(finite, size, -1.0), of))
        return order[np.searchsorted(of[order], np.arange(count), side="right") - 1]

    a = farthest(np.abs(at - middle[of]).max(axis=1))
    from_a = at - at[a][of]
    b = farthest(np.abs(from_a).max(axis=1))
    along = from_a[b] / np.maximum(np.abs(from_a[b]).max(axis=1, keepdims=True), 1e-300)
    c = farthest(np.abs(np.cross(along[of], from_a)).max(axis=1))
    return vertex[np.stack([a, b, c], axis=1)].astype(np.int32)


def used_vertices(faces: NDArray[np.int32], bodies: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The vertices that each body's triangles use: the body and the vertex of each, sorted by both."""
    count = int(faces.max(initial=0)) + 1
    return np.divmod(np.unique(bodies[:, None].astype(np.int64) * count + faces), count)
