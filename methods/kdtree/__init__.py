"""A kd-tree by the surface area heuristic, built on the device in every frame: Zhou et al. 2008.

Zhou, Hou, Wang & Guo 2008, "Real-Time KD-Tree Construction on Graphics Hardware" (ACM TOG 27): large nodes breadth first,
small nodes by the surface area heuristic, then rays. Memory is a fixed reserve that is never exceeded: a frame that needs
more is repeated with more room, up to the limit (Hou et al. 2009, "Memory-Scalable GPU Spatial Hierarchy Construction",
bound it by building parts of the tree one after another).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.schedule.passes import Pass
from ..common.bounds import launch_bounds
from ..common.pairs import zeroed
from ..gpu.reserve import BEYOND
from ..rays.structure import Built, RayStructure
from ..trees.quality import counters_of, surface
from .large import advance_kernel, distribute_kernel, divide_kernel, gather_kernel, list_kernel, root_kernel
from .nodes import LARGE_DEPTH, LEAF, SMALL, Count, Large, Refs, Roots, Scratch, Tree, Work
from .small import CANDIDATES, MEMBER_CHUNK, NODE_CHUNK, WIDTH, finish_kernel, small_kernel
from .traversal import make_kernels

ENTRY_BYTES = (36, 80, 8, 4)
"""Of each of the buffers that may overflow."""

BLOCKS = 32
"""Blocks of a multiprocessor that build small nodes."""

MOST_CHILDREN = 2**29
"""A node's child is a number of 29 bits."""


@dataclass(frozen=True)
class Build:
    """How the tree is built. None of this changes an answer.

    small      nodes of at most this many triangles are split by the surface area heuristic, larger ones at the middle
               of their longest side (1 to 64)
    empty      share of a large node's side: as much empty space is cut off first
    traversal_cost  of an inner node, in triangle tests: C_t / C_i of the heuristic
    capacity   initial capacity, (triangle, node) pairs of a level; 0: three per triangle. All capacities grow when a
               frame needs more
    """

    small: int = SMALL
    empty: float = 0.25
    traversal_cost: float = 4.0
    capacity: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.small <= SMALL:
            raise ValueError(f"small must be in 1..{SMALL}")
        if not 0.05 <= self.empty <= 1.0:
            raise ValueError("empty must lie between 0.05 and 1 (never)")
        if not 0.0 < self.traversal_cost <= 100.0:
            raise ValueError("traversal_cost must lie between 0 and 100 triangle tests")
        if self.capacity < 0:
            raise ValueError("capacity must be 0 (automatic) or more pairs")


def most_depth(triangles: int) -> int:
    """Levels of large nodes: 8 + 1.3 log2 n, after Havran (2000)."""
    return min(LARGE_DEPTH, 8 + int(1.3 * math.log2(max(2, triangles))))


class KdTree(RayStructure):
    """See the package."""

    name = "kdtree"
    title = "kd-tree"
    ROOMS = ("(triangle, node) pairs", "large nodes", "nodes", "members of leaves")
    BUILT = ("small", "traversal_cost")
    Build = Build

    def first_capacity(self, frame: Frame) -> list[int]:
        count, blocks = frame.triangle_count, self._blocks(frame)
        large = 256 + 16 * count // self.build.small
        members = 6 * count + MEMBER_CHUNK * blocks
        return [self.build.capacity or 3 * count, large, large + 6 * count + NODE_CHUNK * blocks, members]

    def structure(self, frame: Frame) -> Built:
        pairs, large, nodes, members = self._capacity
        device, blocks = wp.get_device(frame.device), self._blocks(frame)
        self._threads = 1 if device.is_cpu else 1024 * device.sm_count
        self._work: Any = None  # what a smaller capacity held is not needed beside the new
        with wp.ScopedDevice(device):
            self._work = work = filled(
                Work,
                refs=zeroed(Refs, pairs),
                large=zeroed(Large, large, tight=6 * large),
                roots=zeroed(Roots, large, listed=pairs),
                scratch=zeroed(Scratch, blocks * CANDIDATES, triangles=blocks * SMALL),
                tree=zeroed(Tree, nodes=nodes, members=members, box=6),
                counters=wp.zeros(len(Count), dtype=wp.int32),
                going=wp.zeros(1, dtype=wp.int32),
                need=self._need,
            )
        geometry = ("points", "triangles")
        passes = [
            Pass("root", "build", geometry, ("pairs",), self._root),
            Pass("large nodes", "build", (*geometry, "pairs"), ("small roots",), self._divide, loops=True),
            Pass("small nodes", "build", ("pairs", "small roots"), ("kd-tree",), self._small),
        ]
        return Built(passes, work.tree, ("kd-tree",), make_kernels())

    def _blocks(self, frame: Frame) -> int:
        device = wp.get_device(frame.device)
        return 1 if device.is_cpu else BLOCKS * device.sm_count

    def grow(self, needed: NDArray[np.int64]) -> bool:
        before = list(self._capacity)
        for slot, (what, size) in enumerate(zip(self.ROOMS, ENTRY_BYTES, strict=True)):
            need = int(needed[slot])
            if need <= before[slot]:
                continue
            # A level without room was not divided further, so the need is a lower bound: at least double the capacity.
            most = min(self._memory // size, MOST_CHILDREN, BEYOND)
            if need > most:
                raise CapacityRejected(f"needs {need:,} {what} ({need * size / 2**30:.1f} GiB)")
            self._capacity[slot] = min(most, max(2 * before[slot], need + need // 3 + 1024))
        self._capacity[2] = max(self._capacity[2], self._capacity[1])  # large nodes are nodes
        return self._capacity != before

    def counted(self) -> dict[str, int]:
        pairs, large = (int(n) for n in self._work.need.numpy()[:2])
        counted = self._work.counters.numpy()
        return {
            "pairs": pairs,
            "large nodes": large,
            "nodes": large + int(counted[Count.NODES_USED]),
            "leaf members": int(counted[Count.MEMBERS_USED]),
            "longest list": int(counted[Count.LONGEST]),
            **self._expected(),
        }

    def _expected(self) -> dict[str, int]:
        """How good the tree is (:mod:`..trees.quality`): nodes and triangles that a hundred rays meet."""
        inner, tested, whole = 0.0, 0.0, 0.0
        for sides, members in levels(self._work.tree):
            areas, leaf = surface(sides), members >= 0
            whole = whole or float(areas[0])
            inner += float(areas[~leaf].sum())
            tested += float((areas * members)[leaf].sum())
        return counters_of(inner, tested, whole)

    def _root(self) -> None:
        launch_bounds(self._frame, self._work.tree.box)
        self._work.counters.zero_()
        self._frame.launch(gather_kernel, self._frame.triangle_count, [self._frame.mesh, self._work])
        self._frame.launch(root_kernel, 1, [self._work])

    def _divide(self) -> None:
        wp.capture_while(self._work.going, self._level)
        self._frame.launch(list_kernel, self._threads, [self._threads, self._work])

    def _level(self) -> None:
        frame, work, build, threads = self._frame, self._work, self.build, self._threads
        inputs = [threads, build.small, build.empty, most_depth(frame.triangle_count), work]
        frame.launch(divide_kernel, threads, inputs)
        frame.launch(distribute_kernel, threads, [threads, frame.mesh, work])
        frame.launch(advance_kernel, 1, [work])

    def _small(self) -> None:
        blocks = self._blocks(self._frame)
        inputs = [blocks, self.build.traversal_cost, self._work]
        wp.launch_tiled(small_kernel, dim=[blocks], inputs=inputs, block_dim=WIDTH, device=self._frame.device)
        self._frame.launch(finish_kernel, 1, [self._work])


def levels(tree: Tree) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int64]]]:
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


METHOD = KdTree
