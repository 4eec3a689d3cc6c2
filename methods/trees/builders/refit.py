"""A tree of one frame, its boxes refitted each frame.

One thread per triangle climbs: the second thread to arrive at a node writes it and continues (as in :mod:`.lbvh`,
but with a known tree). Counters of arrivals are never reset: an even count means that both have arrived. A triangle that
is left out in a frame has no box in it, as it has no place in a tree that is rebuilt.
"""

from typing import Any

import numpy as np
import warp as wp

from ....harness.errors import UserError
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import Mesh, filled
from ....harness.frame.schedule.passes import Pass
from ...gpu.entries import entry
from ..constants import BLOCK
from ..native import BASICS
from ..nodes import WRITE, Tree, empty_tree, padding
from .climb import BOXES, EXCHANGED, NEAR
from .sah import sah_topology
from .scene_box import SceneBox


@wp.struct
class Topology:
    """:class:`.sah.Topology` on the device; ``refs`` with triangles instead of places."""

    order: wp.array[wp.int32]
    refs: wp.array[wp.int32]
    leaf_parent: wp.array[wp.int32]
    node_parent: wp.array[wp.int32]


START = """
if (i >= count) return;
int triangle = topology.order.data[i], slot = topology.leaf_parent.data[i];
bool counts = mesh.valid.data[triangle] != 0;
float box[6];
clear(box);
if (counts) box_of_triangle(triangle, box);
if (slot < 0) tree.root.data[0] = counts ? (int)LEAF : (int)NONE;
// Read before the sibling is waited for.
int above = -1;
unsigned int own = NONE, sibling = NONE;
auto look_up = [&]() {
    above = topology.node_parent.data[slot >> 1];
    own = (unsigned int)topology.refs.data[slot];
    sibling = (unsigned int)topology.refs.data[slot ^ 1];
};
if (slot >= 0) look_up();
auto join_sibling = [&](const float* sibling_box) {
    int node = slot >> 1;
    put_node((float*)tree.nodes.data, node, pad, slot & 1, box, own, sibling_box, sibling);
    join(box, sibling_box);
    slot = above;
    if (slot < 0) tree.root.data[0] = node;
    else look_up();
};
"""

CLIMB_NEAR = """
int waits = -1;
while (waits < 0 && slot >= 0 && is_near(slot >> 1)) {
    int node = slot >> 1, side = slot & 1;
    put_near_box(node, side, box);
    if (is_first(node)) {
        waits = node - begin;
    } else {
        float sibling_box[6];
        take_near_box(node, !side, sibling_box);
        join_sibling(sibling_box);
    }
}
__syncthreads();
if (waits >= 0 && arrived[waits] == 2) return;
auto peek = [&](int node) {
    int count;
    asm volatile("ld.acquire.gpu.global.s32 %0, [%1];" : "=r"(count) : "l"(flags.data + node) : "memory");
    return count;
};
auto arrive = [&](int node) {
    int count;
    asm volatile("atom.acq_rel.gpu.global.add.s32 %0, [%1], 1;" : "=r"(count) : "l"(flags.data + node) : "memory");
    return count;
};
"""

ALONE = """
auto peek = [&](int node) { return flags.data[node]; };
auto arrive = [&](int node) { return flags.data[node]++; };
"""

CLIMB_ON = """
while (slot >= 0) {
    int node = slot >> 1, arrivals = peek(node);
    if (arrivals & 1) {
        // Of this frame nobody else reads it: a store without an order is not waited for.
        flags.data[node] = arrivals + 1;
    } else {
        put_box(2 * slot, box, 0u);
        if (!(arrive(node) & 1)) return;
    }
    float sibling_box[6];
    take_box(2 * (slot ^ 1), sibling_box);
    join_sibling(sibling_box);
}
"""

REFIT = f"{START}\n#if defined(__CUDA_ARCH__)\n{NEAR}{CLIMB_NEAR}\n#else\n{ALONE}\n#endif\n{CLIMB_ON}"


@wp.func_native(BASICS + BOXES + EXCHANGED + "constexpr bool SOME_EMPTY = true;" + WRITE + REFIT)
def refit(
    i: wp.int32,
    count: wp.int32,
    pad: wp.float32,
    topology: Topology,
    mesh: Mesh,
    scratch: wp.array[wp.vec4f],
    flags: wp.array[wp.int32],
    tree: Tree,
): ...


@wp.kernel(enable_backward=False, grid_stride=False)
def refit_kernel(
    count: wp.int32, topology: Topology, mesh: Mesh, scratch: wp.array[wp.vec4f], flags: wp.array[wp.int32], tree: Tree
):
    """One thread per place in the tree's order, in blocks of :data:`..constants.BLOCK` on a GPU."""
    refit(wp.tid(), count, padding(entry(tree.max_coordinate, 0)), topology, mesh, scratch, flags, tree)


class Refitted:
    """A SAH tree of a frame of the animation, ``made_of`` (:class:`.sah.Topology`), with boxes of each.

    scratch vec4f [4 * triangles]; flags int32 [triangles]: arrivals. ``still``: whether the mesh does not move
    """

    def __init__(self, frame: Frame, still: bool, made_of: int = 0):
        self.frame, self.still, self.made_of = frame, still, made_of
        prepared = frame.prepared
        if made_of >= prepared.frame_count:
            raise UserError(f"tree_frame={made_of}: {prepared.scene.name} has {prepared.frame_count} frames")
        points, valid = prepared.points(made_of)
        topology = sah_topology(points[prepared.faces], valid)
        with wp.ScopedDevice(frame.device):
            host = {**vars(topology), "refs": topology.leaves().view(np.int32)}
            self.topology = filled(Topology, **{name: wp.array(of, dtype=wp.int32) for name, of in host.items()})
            self.scratch = wp.zeros(4 * frame.triangle_count, dtype=wp.vec4f)
            self.flags = wp.zeros(frame.triangle_count, dtype=wp.int32)
        self.tree = empty_tree(frame)
        self.box = SceneBox(frame, self.tree.extent)

    def built(self) -> dict[str, Any]:
        """For :meth:`....harness.frame.method.Method.built`."""
        which = f"frame {self.made_of}" if self.made_of else "the first frame"
        return {"update": "static" if self.still else "refit", "tree": f"SAH of {which}, on the host"}

    def passes(self) -> tuple[list[Pass], Pass, list[Pass]]:
        """The passes before all others, the refit, and those that run concurrently with it."""
        reads = ("triangles",) if self.still else ("points", "triangles")
        refit = Pass("refit", "build", (*reads, "max_coordinate"), ("bvh",), self._refit)
        return [], refit, [Pass("box", "build", reads, ("extent",), self.box.launch)]

    def _refit(self) -> None:
        f = self.frame
        inputs = [f.triangle_count, self.topology, f.mesh]
        outputs = [self.scratch, self.flags, self.tree]
        threads = -(-f.triangle_count // BLOCK) * BLOCK
        f.launch(refit_kernel, threads, inputs, outputs, BLOCK)
