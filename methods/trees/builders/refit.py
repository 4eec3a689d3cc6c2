"""A tree of one frame, its boxes refitted each frame.

One thread per triangle climbs: the second thread to arrive at a node writes it and continues (as in :mod:`.lbvh`,
but with a known tree). Counters of arrivals are never reset: an even count means that both have arrived. A triangle that
is left out in a frame has no box in it, as it has no place in a tree that is rebuilt.
"""

from __future__ import annotations

import warp as wp

from ....harness.errors import UserError
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import Mesh, filled
from ....harness.frame.schedule.passes import Pass
from ...gpu.entries import entry
from ..constants import BLOCK
from ..native import BASICS
from ..nodes import WRITE, Tree, empty_tree, padding
from .boxes import BOXES, EXCHANGED
from .keys import SceneBox, extent_of
from .sah import sah_topology


@wp.struct
class Topology:
    """:class:`.sah.Topology` on the device; ``refs`` with triangles instead of places."""

    order: wp.array(dtype=wp.int32)
    refs: wp.array(dtype=wp.int32)
    leaf_parent: wp.array(dtype=wp.int32)
    node_parent: wp.array(dtype=wp.int32)


REFIT = """
int triangle = topology.order.data[i];
float box[6];
clear(box);
bool counts = mesh.valid.data[triangle] != 0;
if (counts) box_of_triangle(triangle, box);
int slot = topology.leaf_parent.data[i];
if (slot < 0) tree.root.data[0] = counts ? (int)LEAF : (int)NONE;
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
    float sibling_box[6];
    take_box(2 * other, sibling_box);
    unsigned int own = (unsigned int)topology.refs.data[slot], sibling = (unsigned int)topology.refs.data[other];
    if (slot < other) put_node((float*)tree.nodes.data, node, pad, box, own, sibling_box, sibling);
    else put_node((float*)tree.nodes.data, node, pad, sibling_box, sibling, box, own);
    join(box, sibling_box);
    slot = topology.node_parent.data[node];
}
"""


@wp.func_native(BASICS + BOXES + EXCHANGED + "constexpr bool SOME_EMPTY = true;" + WRITE + REFIT)
def refit(
    i: wp.int32,
    pad: wp.float32,
    topology: Topology,
    mesh: Mesh,
    scratch: wp.array(dtype=wp.vec4f),
    flags: wp.array(dtype=wp.int32),
    tree: Tree,
): ...


@wp.kernel(enable_backward=False, grid_stride=False)
def refit_kernel(
    count: wp.int32,
    topology: Topology,
    mesh: Mesh,
    scratch: wp.array(dtype=wp.vec4f),
    flags: wp.array(dtype=wp.int32),
    tree: Tree,
):
    """One thread per place in the tree's order."""
    i = wp.tid()
    if i < count:
        pad = padding(entry(tree.max_coordinate, 0), entry(tree.extent, 0))
        refit(i, pad, topology, mesh, scratch, flags, tree)


@wp.kernel(enable_backward=False)
def extent_kernel(box: wp.array(dtype=wp.float32), extent: wp.array(dtype=wp.float32)):
    extent[0] = extent_of(box)


class Refitted:
    """A SAH tree of a frame of the animation, ``made_of`` (:class:`.sah.Topology`), with boxes of each.

    scratch vec4f [4 * triangles]; flags int32 [triangles]: arrivals. ``still``: whether the mesh does not move
    """

    def __init__(self, frame: Frame, still: bool, made_of: int = 0):
        self.frame, self.still = frame, still
        prepared = frame.prepared
        if made_of >= prepared.frame_count:
            raise UserError(f"tree_frame={made_of}: {prepared.scene.name} has {prepared.frame_count} frames")
        points, valid = prepared.points(made_of)
        topology = sah_topology(points[prepared.faces], valid)
        with wp.ScopedDevice(frame.device):
            self.box = SceneBox(frame)
            self.topology = filled(
                Topology,
                order=wp.array(topology.order, dtype=wp.int32),
                refs=wp.array(topology.leaves().view("int32"), dtype=wp.int32),
                leaf_parent=wp.array(topology.leaf_parent, dtype=wp.int32),
                node_parent=wp.array(topology.node_parent, dtype=wp.int32),
            )
            self.scratch = wp.zeros(4 * frame.triangle_count, dtype=wp.vec4f)
            self.flags = wp.zeros(frame.triangle_count, dtype=wp.int32)
        self.tree = empty_tree(frame)

    def passes(self) -> tuple[list[Pass], Pass]:
        """The passes before the records of triangles, and the refit, which runs concurrently with those."""
        reads = ("triangles", "max_coordinate") if self.still else ("points", "triangles", "max_coordinate")
        box = Pass("box", "build", reads, ("extent",), self._box)
        return [box], Pass("refit", "build", (*reads, "extent"), ("bvh",), self._refit)

    def _box(self) -> None:
        box = self.box.launch()
        self.frame.launch(extent_kernel, 1, [box], [self.tree.extent])

    def _refit(self) -> None:
        f = self.frame
        inputs = [f.triangle_count, self.topology, f.mesh]
        outputs = [self.scratch, self.flags, self.tree]
        f.launch(refit_kernel, f.triangle_count, inputs, outputs, BLOCK)
