"""A tree by the surface area heuristic, made on the host: the topology of refitted trees.

Binned splits (Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007), all nodes of a level at
once. A node whose triangles fall into one bin, or that lies :data:`DEEP` levels down, is halved; so no tree is deeper
than DEEP and the bits of the number of triangles.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..native import INDEX, LEAF

BINS = 16
DEEP = 64
AT_ONCE = 65536
"""Nodes whose bins are held at once."""


@dataclass(frozen=True)
class Topology:
    """A tree without its boxes.

    order        int32 [triangles]: the triangle at each place
    refs         uint32 [2 * nodes]: children, 2 * node and the next; a place with :data:`..native.LEAF`, or a node
    leaf_parent  int32 [triangles]: where a place is referred to; -1: it is the root
    node_parent  int32 [nodes]: where a node is referred to; -1: it is the root

    A node is numbered by the last place of its left child.
    """

    order: NDArray[np.int32]
    refs: NDArray[np.uint32]
    leaf_parent: NDArray[np.int32]
    node_parent: NDArray[np.int32]

    def leaves(self) -> NDArray[np.uint32]:
        """``refs`` with the index of each leaf's triangle instead of its place."""
        leaf = (self.refs & np.uint32(LEAF)) != 0
        triangles = self.order[np.where(leaf, self.refs & np.uint32(INDEX), 0)].astype(np.uint32)
        return np.where(leaf, np.uint32(LEAF) | triangles, self.refs)


def sah_topology(
    corners: NDArray[np.float32], valid: NDArray[np.uint8], bodies: NDArray[np.int32] | None = None
) -> Topology:
    """The tree of triangles with these corners, [triangles, 3, 3], or one for each of the ``bodies`` that they belong to,
    [triangles] (0, 1, 2, ...). A triangle that is left out is placed in the scene's middle.
    """
    count = len(corners)
    bodies = np.zeros(count, dtype=np.int32) if bodies is None else bodies
    low, high = boxes(corners, valid)
    centre = 0.5 * (low + high)
    order = np.argsort(bodies, kind="stable")
    refs = np.zeros(2 * max(1, count - 1), dtype=np.uint32)
    leaf_parent = np.full(count, -1, dtype=np.int32)
    node_parent = np.full(max(1, count - 1), -1, dtype=np.int32)
    # Ranges of places that are nodes of this level, and where their parents refer to them.
    end = np.cumsum(np.bincount(bodies))
    begin, slot = np.concatenate([[0], end[:-1]]), np.full(len(end), -1)
    for depth in range(DEEP + 32):
        single = end - begin == 1
        places, above = begin[single], slot[single]
        leaf_parent[places] = above
        refs[above[above >= 0]] = np.uint32(LEAF) | places[above >= 0].astype(np.uint32)
        begin, end, slot = begin[~single], end[~single], slot[~single]
        if not len(begin):
            break
        middle = begin + 1  # of two triangles
        larger = np.flatnonzero(end - begin > 2)
        for first in range(0, len(larger), AT_ONCE):
            part = larger[first : first + AT_ONCE]
            middle[part] = divide(order, begin[part], end[part], low, high, centre, depth >= DEEP)
        nodes = middle - 1
        node_parent[nodes] = slot
        refs[slot[slot >= 0]] = nodes[slot >= 0].astype(np.uint32)
        begin = np.stack([begin, middle], axis=1).ravel()
        end = np.stack([middle, end], axis=1).ravel()
        slot = np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()
    return Topology(order.astype(np.int32), refs, leaf_parent, node_parent)


def boxes(corners: NDArray[np.float32], valid: NDArray[np.uint8]) -> tuple[NDArray, NDArray]:
    """Low and high corner of each triangle, float64 [triangles, 3]."""
    low, high = corners.min(axis=1).astype(np.float64), corners.max(axis=1).astype(np.float64)
    left_out = valid == 0
    middle = 0.5 * (low[~left_out].min(axis=0) + high[~left_out].max(axis=0)) if valid.any() else 0.0
    low[left_out] = high[left_out] = middle
    return low, high


def divide(
    order: NDArray, begin: NDArray, end: NDArray, low: NDArray, high: NDArray, centre: NDArray, halve: bool
) -> NDArray:
    """Sort the places of each range by the side of its split that they lie on; where the second sides begin."""
    length = end - begin
    node = np.repeat(np.arange(len(begin)), length)
    starts = np.cumsum(length) - length
    place = np.arange(len(node)) - np.repeat(starts, length) + np.repeat(begin, length)
    triangle = order[place]
    best = np.full(len(begin), np.inf)
    side = np.zeros(len(node), dtype=bool)
    for axis in range(3):
        x = centre[triangle, axis]
        least, most = np.minimum.reduceat(x, starts), np.maximum.reduceat(x, starts)
        wide = most > least
        scale = np.where(wide, BINS / np.where(wide, most - least, 1.0), 0.0)
        bin_of = np.minimum(((x - least[node]) * scale[node]).astype(np.int64), BINS - 1)
        cost, at = best_split(node * BINS + bin_of, len(begin), low[triangle], high[triangle])
        better = (cost < best) & (not halve)
        best[better] = cost[better]
        side = np.where(better[node], bin_of > at[node], side)
    second = np.add.reduceat(side.astype(np.int64), starts)
    whole = ~np.isfinite(best) | (second == 0) | (second == length)
    upper_half = place - begin[node] >= (length // 2)[node]
    side = np.where(whole[node], upper_half, side)
    second = np.where(whole, length - length // 2, second)
    order[place] = triangle[np.lexsort((side, node))]
    return end - second


def best_split(bins: NDArray, nodes: int, low: NDArray, high: NDArray) -> tuple[NDArray, NDArray]:
    """The least cost (area times triangles, of both sides) of each node, inf: none; and the last bin of its first side."""
    sequence = np.argsort(bins, kind="stable")
    kept = bins[sequence]
    firsts = np.flatnonzero(np.concatenate([[True], kept[1:] != kept[:-1]]))
    used = kept[firsts]
    counts = np.zeros(nodes * BINS)
    counts[used] = np.diff(np.append(firsts, len(kept)))
    least, most = np.full((nodes * BINS, 3), np.inf), np.full((nodes * BINS, 3), -np.inf)
    least[used] = np.minimum.reduceat(low[sequence], firsts, axis=0)
    most[used] = np.maximum.reduceat(high[sequence], firsts, axis=0)
    number = counts.reshape(nodes, BINS)
    lows, highs = least.reshape(nodes, BINS, 3), most.reshape(nodes, BINS, 3)
    cost = swept(lows, highs, number)[:, :-1] + swept(lows[:, ::-1], highs[:, ::-1], number[:, ::-1])[:, -2::-1]
    at = cost.argmin(axis=1)
    return cost[np.arange(nodes), at], at


def swept(lows: NDArray, highs: NDArray, number: NDArray) -> NDArray:
    """Area times triangles of bins 0..k, for each k; inf where there are none."""
    count = np.cumsum(number, axis=1)
    size = np.maximum.accumulate(highs, axis=1) - np.minimum.accumulate(lows, axis=1)
    size = np.where(count[..., None] > 0, size, 0.0)
    area = size[..., 0] * size[..., 1] + size[..., 1] * size[..., 2] + size[..., 2] * size[..., 0]
    return np.where(count > 0, area * count, np.inf)
