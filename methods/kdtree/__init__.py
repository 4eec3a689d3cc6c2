"""A kd-tree by the surface area heuristic, built on the device in every frame: Zhou et al. 2008.

Zhou, Hou, Wang & Guo 2008, "Real-Time KD-Tree Construction on Graphics Hardware" (ACM TOG 27): large nodes breadth first,
small nodes by the surface area heuristic, then rays. Memory is a fixed reserve that is never exceeded: a frame that needs
more is repeated with more room, up to the limit (Hou et al. 2009, "Memory-Scalable GPU Spatial Hierarchy Construction",
bound it by building parts of the tree one after another).
"""

import math
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
from ..gpu.reserve import BEYOND
from ..rays.structure import Built, RayStructure
from .large import advance_kernel, distribute_kernel, divide_kernel, gather_kernel, list_kernel, root_kernel
from .nodes import COUNTERS, LARGE_DEPTH, LONGEST, MEMBERS_USED, NODES_USED, SMALL, Large, Refs, Roots, Tree
from .quality import expected
from .small import CANDIDATES, MEMBER_CHUNK, NODE_CHUNK, WIDTH, Scratch, finish_kernel, small_kernel
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
        device = wp.get_device(frame.device)
        blocks = self._blocks(frame)
        self._threads = 1 if device.is_cpu else 1024 * device.sm_count

        def zeros(size: int, dtype: Any = wp.int32) -> wp.array:
            return wp.zeros(size, dtype=dtype, device=frame.device)

        def vectors(size: int) -> wp.array:
            return zeros(size, wp.vec3f)

        self._counters, self._going = zeros(COUNTERS), zeros(1)
        self._box, self._nodes, self._members = zeros(6, wp.float32), zeros(nodes, wp.vec2i), zeros(members)
        self._refs = filled(Refs, triangle=zeros(pairs), node=zeros(pairs), low=vectors(pairs), high=vectors(pairs))
        self._large = filled(
            Large, low=vectors(large), high=vectors(large), tight=zeros(6 * large), count=zeros(large),
            parent=zeros(large), depth=zeros(large), growth=zeros(large, wp.float32), target=zeros(large),
        )  # fmt: skip
        self._roots = filled(
            Roots, node=zeros(large), begin=zeros(large), count=zeros(large), cursor=zeros(large), listed=zeros(pairs)
        )  # fmt: skip
        self._scratch = filled(
            Scratch, planes=zeros(blocks * CANDIDATES, wp.float32), triangles=zeros(blocks * SMALL),
            below=zeros(blocks * CANDIDATES, wp.uint64), above=zeros(blocks * CANDIDATES, wp.uint64),
        )  # fmt: skip
        geometry = ("points", "triangles")
        passes = [
            Pass("root", "build", geometry, ("pairs",), self._root),
            Pass("large nodes", "build", (*geometry, "pairs"), ("small roots",), self._divide, loops=True),
            Pass("small nodes", "build", ("pairs", "small roots"), ("kd-tree",), self._small),
        ]
        self._built = tree = filled(Tree, nodes=self._nodes, members=self._members, box=self._box)
        return Built(passes, tree, ("kd-tree",), make_kernels())

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
        assert self._need is not None
        pairs, large = (int(n) for n in self._need.numpy()[:2])
        counted = self._counters.numpy()
        return {
            "pairs": pairs,
            "large nodes": large,
            "nodes": large + int(counted[NODES_USED]),
            "leaf members": int(counted[MEMBERS_USED]),
            "longest list": int(counted[LONGEST]),
            **expected(self._built),
        }

    def _root(self) -> None:
        frame = self._frame
        launch_bounds(frame, self._box)
        self._counters.zero_()
        inputs = [frame.mesh, self._refs, self._large, self._counters]
        self._launch(gather_kernel, inputs, frame.triangle_count)
        self._launch(root_kernel, [self._refs, self._large, self._box, self._counters, self._going], 1)

    def _divide(self) -> None:
        wp.capture_while(self._going, self._level)
        self._launch(list_kernel, [self._threads, self._refs, self._large, self._roots, self._counters])

    def _level(self) -> None:
        build, threads, counters = self.build, self._threads, self._counters
        depth = most_depth(self._frame.triangle_count)
        inputs = [threads, build.small, build.empty, depth, self._large, self._roots, self._nodes, counters]
        self._launch(divide_kernel, inputs)
        inputs = [threads, self._frame.mesh, self._refs, self._large, self._nodes, counters]
        self._launch(distribute_kernel, inputs)
        self._launch(advance_kernel, [self._refs, self._large, counters, self._going], 1)

    def _small(self) -> None:
        blocks = self._blocks(self._frame)
        tree = [self._nodes, self._members, self._counters]
        inputs = [blocks, self.build.traversal_cost, self._refs, self._large, self._roots, self._scratch, *tree]
        wp.launch_tiled(small_kernel, dim=[blocks], inputs=inputs, block_dim=WIDTH, device=self._frame.device)
        self._launch(finish_kernel, [self._refs, self._large, *tree, self._need], 1)

    def _launch(self, kernel: wp.Kernel, inputs: list[Any], threads: int = 0) -> None:
        self._frame.launch(kernel, threads or self._threads, inputs)


METHOD = KdTree
