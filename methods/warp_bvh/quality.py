"""How good a tree of Warp is (:mod:`..trees.quality`): its nodes are copied out, since Warp shows none."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..trees.quality import counters_of, surface

DEEP = 1024
"""More levels than any tree has."""


@wp.func_native("""
wp::BVH bvh = wp::bvh_get(of_mesh ? wp::mesh_get_bvh(tree) : tree);
if (i >= bvh.max_nodes) return;
wp::BVHPackedNodeHalf low = bvh.node_lowers[i], high = bvh.node_uppers[i];
lows.data[i] = wp::vec3(low.x, low.y, low.z);
highs.data[i] = wp::vec3(high.x, high.y, high.z);
refs.data[i] = wp::vec3i((int)low.i, (int)high.i, (int)low.b);
if (i == 0) root.data[0] = *bvh.root;
""")
def node_of(
    tree: wp.uint64,
    of_mesh: wp.bool,
    i: wp.int32,
    lows: wp.array(dtype=wp.vec3f),
    highs: wp.array(dtype=wp.vec3f),
    refs: wp.array(dtype=wp.vec3i),
    root: wp.array(dtype=wp.int32),
): ...


@wp.kernel(enable_backward=False)
def nodes_kernel(
    tree: wp.uint64,
    of_mesh: wp.bool,
    lows: wp.array(dtype=wp.vec3f),
    highs: wp.array(dtype=wp.vec3f),
    refs: wp.array(dtype=wp.vec3i),
    root: wp.array(dtype=wp.int32),
):
    """The nodes of a wp.Bvh: boxes; both children or, of a leaf, the range of its triangles, and whether it is one."""
    node_of(tree, of_mesh, wp.tid(), lows, highs, refs, root)


def expected(tree: wp.Bvh | wp.Mesh) -> dict[str, int]:
    """Nodes and triangles that a hundred rays meet; nothing if another version of Warp lays its nodes out otherwise."""
    of_mesh = isinstance(tree, wp.Mesh)
    most = 2 * (len(tree.indices) // 3 if of_mesh else len(tree.lowers))
    with wp.ScopedDevice(tree.device):
        made = [wp.zeros(most, dtype=kind) for kind in (wp.vec3f, wp.vec3f, wp.vec3i)]
        root = wp.zeros(1, dtype=wp.int32)
        wp.launch(nodes_kernel, most, [tree.id, of_mesh, *made, root])
        lows, highs, refs = (array.numpy() for array in made)
        level = root.numpy()
    inner, tested, whole = 0.0, 0.0, 0.0
    for _ in range(DEEP):
        if not len(level):
            return counters_of(inner, tested, whole)
        if len(level) > len(refs) or level.max() >= len(refs):
            break
        area, leaf = surface(highs[level].astype(np.float64) - lows[level]), refs[level, 2] != 0
        whole = whole or float(area[0])
        begin, end = refs[level[leaf], 0], refs[level[leaf], 1]
        tested += float((area[leaf] * (end - begin)).sum())
        inner += float(area[~leaf].sum())
        level = refs[level[~leaf], :2].ravel()
    return {}
