"""The kd-tree as a method: large nodes breadth first, small nodes by the surface area heuristic, then rays.

Zhou, Hou, Wang & Guo 2008, "Real-Time KD-Tree Construction on Graphics Hardware" (ACM TOG 27). Memory is a fixed reserve
that is never exceeded: a frame that needs more is repeated with more room, up to the limit (Hou et al. 2009,
"Memory-Scalable GPU Spatial Hierarchy Construction", bound it by building parts of the tree one after another).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.errors import CapacityRejected
from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ...harness.frame.method import BaseMethod
from ...harness.frame.schedule.passes import Pass
from ...harness.scene.effects import Effects, Limits
from ..common.bounds import launch_bounds
from ..common.misses import miss_passes
from ..common.ray_launches import PixelRays
from ..gpu.reserve import BEYOND
from .large import advance_kernel, distribute_kernel, divide_kernel, gather_kernel, list_kernel, root_kernel
from .nodes import COUNTERS, LONGEST, MEMBERS_USED, NODES_USED, Large, Refs, Roots, Tree
from .parameters import LARGE_DEPTH, Build, Trace
from .small import (
    CANDIDATES,
    MEMBER_CHUNK,
    NODE_CHUNK,
    SMALL,
    WIDTH,
    Scratch,
    finish_kernel,
    small_kernel,
)
from .traversal import make_kernels

NEEDS = (
    ("(triangle, node) pairs", 36),
    ("large nodes", 80),
    ("nodes", 8),
    ("members of leaves", 4),
)
"""The buffers that may overflow, and the bytes of one entry."""

BLOCKS = 32
"""Blocks of a multiprocessor that build small nodes."""

MOST_CHILDREN = 2**29
"""A node's child is a number of 29 bits."""


def most_depth(triangles: int) -> int:
    """Levels of large nodes: 8 + 1.3 log2 n, after Havran (2000)."""
    return min(LARGE_DEPTH, 8 + int(1.3 * math.log2(max(2, triangles))))


class KdTree(BaseMethod):
    """See the module. Exact: float32 rejects, float64 decides, and no ray can miss a leaf of a triangle it hits.

    Needs: see :data:`NEEDS`.
    """

    name = "kdtree"
    title = "kd-tree"
    simulates = frozenset({"shadows", "receivers", "directional", "alpha", "mirror", "orthographic"})
    Build = Build
    Trace = Trace

    def __init__(self, build: Build | None = None, trace: Trace | None = None):
        super().__init__(build, trace)
        self._capacity: list[int] = []
        self._need: wp.array | None = None
        self._workers: dict[str, int] = {}

    def plan(self, frame: Frame, effects: Effects, limits: Limits) -> list[Pass]:
        self._frame, self._limits = frame, limits
        count = frame.triangle_count
        if count == 0:
            self._need = None
            return miss_passes(frame, effects)
        if not self._capacity:
            pairs = self.build.capacity or 3 * count
            large = 256 + 16 * count // self.build.small
            blocks = self._blocks_on(frame)
            nodes = large + 6 * count + NODE_CHUNK * blocks
            self._capacity = [pairs, large, nodes, 6 * count + MEMBER_CHUNK * blocks]
        self._allocate(frame)
        tree = filled(Tree, nodes=self._nodes, members=self._members, box=self._box)
        kernels = make_kernels(self.trace.stack, self.trace.registers)
        self._rays = PixelRays(frame, effects, tree, *kernels, self.trace.swizzle, threads=self.trace.threads)
        self._workers = self._rays.bands.built()
        return [
            Pass("root", "build", ("points", "triangles"), ("pairs",), self._root),
            Pass(
                "large nodes",
                "build",
                ("points", "triangles", "pairs"),
                ("small roots",),
                self._divide,
                loops=True,
            ),
            Pass("small nodes", "build", ("pairs", "small roots"), ("kd-tree",), self._small),
            *self._rays.passes(("kd-tree",)),
        ]

    def _allocate(self, frame: Frame) -> None:
        pairs, large, nodes, members = self._capacity
        device = wp.get_device(frame.device)
        self._threads = 1 if device.is_cpu else 1024 * device.sm_count
        self._blocks = self._blocks_on(frame)

        def ints(size: int) -> wp.array:
            return wp.zeros(size, dtype=wp.int32)

        def vectors(size: int) -> wp.array:
            return wp.zeros(size, dtype=wp.vec3f)

        with wp.ScopedDevice(frame.device):
            self._need = wp.zeros(len(NEEDS), dtype=wp.int64)
            self._counters = ints(COUNTERS)
            self._going = ints(1)
            self._box = wp.zeros(6, dtype=wp.float32)
            self._nodes = wp.zeros(nodes, dtype=wp.vec2i)
            self._members = ints(members)
            self._refs = filled(
                Refs, triangle=ints(pairs), node=ints(pairs), low=vectors(pairs), high=vectors(pairs)
            )
            self._large = filled(
                Large, low=vectors(large), high=vectors(large), tight=ints(6 * large), count=ints(large),
                parent=ints(large), depth=ints(large), growth=wp.zeros(large, dtype=wp.float32), target=ints(large),
            )  # fmt: skip
            self._roots = filled(
                Roots, node=ints(large), begin=ints(large), count=ints(large), cursor=ints(large), listed=ints(pairs)
            )  # fmt: skip
            self._scratch = filled(
                Scratch,
                planes=wp.zeros(self._blocks * CANDIDATES, dtype=wp.float32),
                triangles=ints(self._blocks * SMALL),
                below=wp.zeros(self._blocks * CANDIDATES, dtype=wp.uint64),
                above=wp.zeros(self._blocks * CANDIDATES, dtype=wp.uint64),
            )

    def _blocks_on(self, frame: Frame) -> int:
        device = wp.get_device(frame.device)
        return 1 if device.is_cpu else BLOCKS * device.sm_count

    def needs(self) -> wp.array | None:
        return self._need

    def grow(self, needed: NDArray[np.int64]) -> bool:
        before = list(self._capacity)
        for slot, (what, size) in enumerate(NEEDS):
            need = int(needed[slot])
            if need <= before[slot]:
                continue
            # A level without room was not divided further, so the need is a lower bound: at least double the capacity.
            most = min(self._limits.memory // size, MOST_CHILDREN, BEYOND)
            if need > most:
                raise CapacityRejected(f"needs {need:,} {what} ({need * size / 2**30:.1f} GiB)")
            self._capacity[slot] = min(most, max(2 * before[slot], need + need // 3 + 1024))
        self._capacity[2] = max(self._capacity[2], self._capacity[1])  # large nodes are nodes
        return self._capacity != before

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary ray and of its shadow rays. The last frame is traced again to count
        them."""
        return self._rays.tests_per_pixel()

    def counters(self) -> dict[str, int]:
        if self._need is None:
            return {}
        pairs, large = (int(n) for n in self._need.numpy()[:2])
        counted = self._counters.numpy()
        return {
            "pairs": pairs,
            "large nodes": large,
            "nodes": large + int(counted[NODES_USED]),
            "leaf members": int(counted[MEMBERS_USED]),
            "longest list": int(counted[LONGEST]),
            **self._rays.counters(),
        }

    def built(self) -> dict[str, Any]:
        return {"small": self.build.small, "traversal_cost": self.build.traversal_cost, **self._workers}

    def _root(self) -> None:
        frame = self._frame
        launch_bounds(frame, self._box)
        self._counters.zero_()
        wp.launch(
            gather_kernel,
            dim=frame.triangle_count,
            inputs=[frame.mesh],
            outputs=[self._refs, self._large, self._counters],
            device=frame.device,
        )
        wp.launch(
            root_kernel,
            dim=1,
            inputs=[self._refs, self._large, self._box],
            outputs=[self._counters, self._going],
            device=frame.device,
        )

    def _divide(self) -> None:
        wp.capture_while(self._going, self._level)
        self._launch(list_kernel, [self._threads, self._refs, self._large, self._roots, self._counters])

    def _level(self) -> None:
        depth = most_depth(self._frame.triangle_count)
        self._launch(
            divide_kernel,
            [
                self._threads, self.build.small, self.build.empty, depth, self._large, self._roots, self._nodes,
                self._counters,
            ],
        )  # fmt: skip
        self._launch(
            distribute_kernel,
            [self._threads, self._frame.mesh, self._refs, self._large, self._nodes, self._counters],
        )
        self._launch(advance_kernel, [self._refs, self._large, self._counters, self._going], 1)

    def _launch(self, kernel: wp.Kernel, inputs: list[Any], threads: int = 0) -> None:
        wp.launch(kernel, dim=threads or self._threads, inputs=inputs, device=self._frame.device)

    def _small(self) -> None:
        wp.launch_tiled(
            small_kernel,
            dim=[self._blocks],
            inputs=[
                self._blocks, self.build.traversal_cost, self._refs, self._large, self._roots, self._scratch,
                self._nodes, self._members, self._counters,
            ],
            block_dim=WIDTH,
            device=self._frame.device,
        )  # fmt: skip
        self._launch(
            finish_kernel,
            [self._refs, self._large, self._nodes, self._members, self._counters, self._need],
            1,
        )
