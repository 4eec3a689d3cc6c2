"""A tree rebuilt each frame: arrays, and launches of its build."""

from __future__ import annotations

import warp as wp

from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass
from ..nodes import Tree
from ..parameters import Build
from .hploc import BLOCK, make_hploc_kernel
from .keys import key_kernel, launch_box, used_vertices
from .lbvh import make_lbvh_kernel
from .sort import Sort

LBVH_BLOCK = 128


class Rebuilt:
    """Boxes, keys, a sort, and the tree.

    keys, order  int32 [2 * triangles]: sorted keys and references of their leaves, and room for the sort
    extent       float32 [1]: the largest coordinate of the scene's box
    nodes        vec4f [triangles * node_bytes / 16]; scratch vec4f [4 * triangles]; flags uint64 [triangles]; root int32 [1]
    """

    def __init__(self, frame: Frame, build: Build):
        self.frame, self.build = frame, build
        count = frame.triangle_count
        with wp.ScopedDevice(frame.device):
            self.box = wp.zeros(6, dtype=wp.float32)
            self.used = wp.array(used_vertices(frame.prepared.faces, frame.vertex_count), dtype=wp.uint8)
            self.keys = wp.zeros(2 * count, dtype=wp.int32)
            self.order = wp.zeros(2 * count, dtype=wp.int32)
            self.sort = Sort(self.keys, self.order, count, build.key_bits, (1 << build.key_bits) - 1)
            self.flags = wp.zeros(count, dtype=wp.uint64)
            self.scratch = wp.zeros(4 * count, dtype=wp.vec4f)
            self.nodes = wp.zeros(count * build.node_bytes // 16, dtype=wp.vec4f)
            self.root = wp.zeros(1, dtype=wp.int32)
            self.extent = wp.zeros(1, dtype=wp.float32)
        self.tree = filled(Tree, nodes=self.nodes, root=self.root, masked=frame.alpha.masked)

    def passes(self) -> tuple[list[Pass], Pass]:
        """The passes before the records of triangles, and the one that makes the tree, concurrently with those."""
        first = [
            Pass("keys", "build", ("points", "triangles", "max_coordinate"), ("keys", "extent"), self._keys),
            Pass("sort", "build", ("keys",), ("order",), self.sort.launch),
        ]
        reads = ("points", "triangles", "max_coordinate", "order", "extent")
        return first, Pass("tree", "build", reads, ("bvh",), self._tree)

    def _keys(self) -> None:
        f = self.frame
        launch_box(f, self.used, self.box)
        wp.launch(
            key_kernel,
            dim=-(-f.triangle_count // 2),
            inputs=[
                f.mesh,
                f.triangle_count,
                self.build.key_bits,
                self.build.pair,
                self.box,
            ],
            outputs=[*self.sort.half(self.sort.begin), self.flags, self.root, self.extent, self.sort.state],
            device=f.device,
        )

    def _tree(self) -> None:
        f, b = self.frame, self.build
        if b.builder == "hploc":
            kernel, block = make_hploc_kernel(b.radius, b.node_bytes), BLOCK
        else:
            kernel, block = make_lbvh_kernel(b.node_bytes), LBVH_BLOCK
        wp.launch(
            kernel,
            dim=-(-f.triangle_count // block) * block,
            inputs=[
                self.sort.held, f.max_coordinate, self.extent, self.keys, self.order, f.points, f.triangles,
            ],
            outputs=[self.scratch, self.flags, self.nodes, self.root],
            device=f.device,
            block_dim=block,
        )  # fmt: skip
