"""A tree of the first frame, its boxes refitted each frame.

One thread per triangle climbs: the second thread to arrive at a node writes it and continues (as in :mod:`.lbvh`,
but with a known tree). Counters of arrivals are never reset: an even count means that both have arrived. A triangle that
is left out in a frame has no box in it, as it has no place in a tree that is rebuilt.
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ....harness.errors import UserError
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass
from ..native import BASICS
from ..nodes import ROUNDED_UP, WRITE, Tree, padding
from ..parameters import Build
from .keys import extent_of, launch_box, used_vertices
from .lbvh import EXCHANGED
from .sah import sah_topology

BLOCK = 128

CLIMB = """
int triangle = order.data[i];
float box[6] = {3.0e38f, 3.0e38f, 3.0e38f, -3.0e38f, -3.0e38f, -3.0e38f};
bool counts = valid.data[triangle] != 0;
if (counts) {
    wp::vec3i face = triangles.data[triangle];
    const float* a = (const float*)(points.data + face[0]);
    const float* b = (const float*)(points.data + face[1]);
    const float* c = (const float*)(points.data + face[2]);
    for (int axis = 0; axis < 3; axis++) {
        box[axis] = low(a[axis], low(b[axis], c[axis]));
        box[axis + 3] = high(a[axis], high(b[axis], c[axis]));
    }
}
int slot = leaf_parent.data[i];
if (slot < 0) root.data[0] = counts ? (int)LEAF : (int)NONE;
while (slot >= 0) {
    int node = slot >> 1, other = slot ^ 1;
    put_box(2 * slot, box, 0u);
#if defined(__CUDA_ARCH__)
    int arrived;
    asm volatile("atom.acq_rel.gpu.global.add.s32 %0, [%1], 1;" : "=r"(arrived) : "l"(flags.data + node) : "memory");
#else
    int arrived = flags.data[node]++;
#endif
    if ((arrived & 1) == 0) return;
    float beside[6];
    take_box(2 * other, beside);
    unsigned int own = (unsigned int)refs.data[slot], sibling = (unsigned int)refs.data[other];
    if (slot < other) put_node((float*)nodes.data, node, pad, box, own, beside, sibling);
    else put_node((float*)nodes.data, node, pad, beside, sibling, box, own);
    for (int axis = 0; axis < 3; axis++) {
        box[axis] = low(box[axis], beside[axis]);
        box[axis + 3] = high(box[axis + 3], beside[axis + 3]);
    }
    slot = node_parent.data[node];
}
"""


@functools.cache
def make_refit_kernel(node_bytes: int) -> wp.Kernel:
    """One thread per place in the tree's order."""

    @wp.func_native(BASICS + EXCHANGED + ROUNDED_UP + WRITE[node_bytes] + CLIMB)
    def refit(
        i: wp.int32,
        pad: wp.float32,
        order: wp.array(dtype=wp.int32),
        refs: wp.array(dtype=wp.int32),
        leaf_parent: wp.array(dtype=wp.int32),
        node_parent: wp.array(dtype=wp.int32),
        points: wp.array(dtype=wp.vec3f),
        triangles: wp.array(dtype=wp.vec3i),
        valid: wp.array(dtype=wp.uint8),
        scratch: wp.array(dtype=wp.vec4f),
        flags: wp.array(dtype=wp.int32),
        nodes: wp.array(dtype=wp.vec4f),
        root: wp.array(dtype=wp.int32),
    ): ...

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def refit_kernel(
        count: wp.int32,
        reach: wp.array(dtype=wp.float32),
        extent: wp.array(dtype=wp.float32),
        order: wp.array(dtype=wp.int32),
        refs: wp.array(dtype=wp.int32),
        leaf_parent: wp.array(dtype=wp.int32),
        node_parent: wp.array(dtype=wp.int32),
        points: wp.array(dtype=wp.vec3f),
        triangles: wp.array(dtype=wp.vec3i),
        valid: wp.array(dtype=wp.uint8),
        scratch: wp.array(dtype=wp.vec4f),
        flags: wp.array(dtype=wp.int32),
        nodes: wp.array(dtype=wp.vec4f),
        root: wp.array(dtype=wp.int32),
    ):
        i = wp.tid()
        if i < count:
            refit(
                i, padding(reach[0], extent[0]), order, refs, leaf_parent, node_parent, points, triangles, valid,
                scratch, flags, nodes, root,
            )  # fmt: skip

    kernel: Any = refit_kernel
    return kernel


@wp.kernel(enable_backward=False)
def extent_kernel(box: wp.array(dtype=wp.float32), extent: wp.array(dtype=wp.float32)):
    extent[0] = extent_of(box)


class Refitted:
    """A SAH tree of the animation's first frame (:class:`.sah.Topology`), with boxes of each.

    nodes vec4f [triangles * node_bytes / 16]; scratch vec4f [4 * triangles]; flags int32 [triangles]: arrivals
    """

    def __init__(self, frame: Frame, build: Build):
        self.frame, self.build = frame, build
        prepared = frame.prepared
        if build.update == "static" and prepared.frame_count > 1:
            raise UserError(
                f"bvh2.update=static: {prepared.scene.name} moves over {prepared.frame_count} frames; "
                "choose rebuild or refit"
            )
        count = frame.triangle_count
        points, valid = prepared.points(0)
        topology = sah_topology(points[prepared.faces], valid)
        with wp.ScopedDevice(frame.device):
            self.box = wp.zeros(6, dtype=wp.float32)
            self.used = wp.array(used_vertices(prepared.faces, frame.vertex_count), dtype=wp.uint8)
            self.extent = wp.zeros(1, dtype=wp.float32)
            self.order = wp.array(topology.order, dtype=wp.int32)
            self.refs = wp.array(topology.leaves().view("int32"), dtype=wp.int32)
            self.leaf_parent = wp.array(topology.leaf_parent, dtype=wp.int32)
            self.node_parent = wp.array(topology.node_parent, dtype=wp.int32)
            self.scratch = wp.zeros(4 * count, dtype=wp.vec4f)
            self.flags = wp.zeros(count, dtype=wp.int32)
            nodes = wp.zeros(count * build.node_bytes // 16, dtype=wp.vec4f)
            self.tree = filled(Tree, nodes=nodes, root=wp.zeros(1, dtype=wp.int32), masked=frame.alpha.masked)

    def passes(self) -> tuple[list[Pass], Pass]:
        """The passes before the records of triangles, and the refit, which runs concurrently with those."""
        reads = (
            ("triangles", "max_coordinate")
            if self.build.update == "static"
            else ("points", "triangles", "max_coordinate")
        )
        box = Pass("box", "build", reads, ("extent",), self._box)
        return [box], Pass("refit", "build", (*reads, "extent"), ("bvh",), self._refit)

    def _box(self) -> None:
        launch_box(self.frame, self.used, self.box)
        wp.launch(extent_kernel, dim=1, inputs=[self.box], outputs=[self.extent], device=self.frame.device)

    def _refit(self) -> None:
        f = self.frame
        wp.launch(
            make_refit_kernel(self.build.node_bytes),
            dim=f.triangle_count,
            inputs=[
                f.triangle_count, f.max_coordinate, self.extent, self.order, self.refs, self.leaf_parent, self.node_parent,
                f.points, f.triangles, f.valid,
            ],
            outputs=[self.scratch, self.flags, self.tree.nodes, self.tree.root],
            device=f.device,
            block_dim=BLOCK,
        )  # fmt: skip
