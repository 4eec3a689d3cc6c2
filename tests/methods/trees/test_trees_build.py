"""The tree itself (``keys.py``, ``climb.py``, ``refit.py``): every triangle once, boxes that hold their children,
depth, leaves, the same tree on every device.
"""

from typing import Any

import numpy as np
import pytest
from helpers.small_scenes import make_scene, soup
from helpers.tuned_trees import built, children
from numpy.typing import NDArray
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.methods.trees import constants
from shadowbench.methods.trees.builders.sah import DEEP, sah_topology
from shadowbench.methods.trees.native import INDEX, LEAF, NONE, PAIR, STACK

BUILDS = [
    {"builder": "lbvh", "SHARED_AREA": 0.0},
    {"builder": "lbvh", "SHARED_AREA": 1000.0},
    {"builder": "hploc", "RADIUS": 1, "SHARED_AREA": 0.6},
    {"builder": "hploc", "RADIUS": 2, "SHARED_AREA": 0.0},
    {"builder": "hploc", "RADIUS": 8},
    {"update": "refit"},
]
LIGHTS = [(5.0, 4.0, 3.0)]


def checked_depth(session: Session, prepared: Prepared) -> int:
    """The tree's depth, once it is known to hold every valid triangle once, each in all boxes above it."""
    points, valid = prepared.points(0)
    corners = points[prepared.faces].astype(np.float64)
    centres, extents, refs, root = children(session)
    low, high = centres - extents, centres + extents
    found, deepest = [], 0
    now = np.array([root] if root != NONE else [], dtype=np.int64)
    inside = np.array([[[-np.inf] * 3, [np.inf] * 3]])[: len(now)]
    while len(now):
        leaf = (now & LEAF) != 0
        first, pair = now[leaf] & INDEX, (now[leaf] & PAIR) != 0
        triangles = np.stack([first, first + 1], axis=1)
        counted = np.stack([valid[first] != 0, pair], axis=1)
        found += triangles[counted].tolist()
        held, box = corners[triangles[counted]], np.repeat(inside[leaf], counted.sum(axis=1), axis=0)
        assert (held.min(axis=1) > box[:, 0]).all()
        assert (held.max(axis=1) < box[:, 1]).all()
        nodes, above = now[~leaf], inside[~leaf]
        if not len(nodes):
            break
        deepest += 1
        # What a triangle must lie in: the boxes of all its ancestors.
        inner = np.stack(
            [np.maximum(above[:, None, 0], low[nodes]), np.minimum(above[:, None, 1], high[nodes])], axis=2
        )
        now, inside = refs[nodes].ravel().astype(np.int64), inner.reshape(-1, 2, 3)
    assert sorted(found) == np.flatnonzero(valid).tolist()
    return deepest


def scenes() -> dict[str, tuple[NDArray, NDArray]]:
    one = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    halved = np.concatenate([one * 2.0**-k for k in range(120)])
    # Boxes that share their middle, ever smaller: neighbours in every order are one inside the other.
    nested = np.concatenate([(one - [0.5, 0.5, 0.0]) * 0.98**k for k in range(3000)])
    same = np.concatenate([one + 1e-7 * (k % 7) for k in range(8000)])
    broken = soup(3, 400)[0].copy()
    broken[::21] = np.nan
    sets = {"soup": soup(5, 5000)[0], "one": one, "two": np.concatenate([one, one + 1.0])}
    block = constants.BLOCK
    sets |= {f"{count}": soup(count, count)[0] for count in (3, block - 1, block, block + 1, 2 * block + 1)}
    sets |= {"few": soup(6, 17)[0], "halved": halved, "nested": nested, "one centroid": same, "broken": broken}
    sets["nothing"] = np.full((9, 3), np.nan)
    return {name: (points, np.arange(len(points)).reshape(-1, 3)) for name, points in sets.items()}


SCENES = scenes()


@pytest.mark.parametrize("settings", BUILDS, ids=str)
@pytest.mark.parametrize("name", SCENES)
def test_every_triangle_once_in_boxes_that_hold_it(name, settings, device):
    """A radix tree is no deeper than the bits of a key and of a number of triangles."""
    prepared = make_scene(*SCENES[name], LIGHTS)
    depth = checked_depth(built(prepared, settings, device), prepared)
    assert depth <= (constants.KEY_BITS + 13 if settings.get("builder") == "lbvh" else STACK)


@pytest.mark.parametrize(("count", "builder"), [(1, "lbvh"), (39, "lbvh"), (40, "hploc")])
def test_the_builder_follows_the_number_of_triangles(count, builder, device):
    prepared = make_scene(*soup(count, count), LIGHTS)
    assert built(prepared, {"MANY_TRIANGLES": 40}, device).method.built()["tree"] == builder


@pytest.mark.parametrize("settings", BUILDS, ids=str)
def test_devices_and_runs_make_the_same_tree(settings, device):
    prepared = make_scene(*soup(9, 3000), LIGHTS)
    trees = [built(prepared, settings, where) for where in ("cpu", device, device)]
    nodes = [session.method._rays.tree.nodes.numpy().view(np.uint32) for session in trees]
    for other in nodes[1:]:
        np.testing.assert_array_equal(other, nodes[0])


def test_deep_sah_trees_are_halved():
    """Each triangle is larger than all before it together: binned splits take one off at a time."""
    one = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    corners = np.stack([one * 1.4**k for k in range(220)]).astype(np.float32)
    topology = sah_topology(corners, np.ones(len(corners), dtype=np.uint8))
    depth, above = 0, topology.leaf_parent
    while (above >= 0).any():
        depth += 1
        above = np.where(above >= 0, topology.node_parent[above >> 1], -1)
    assert depth <= DEEP + 8
    assert sorted(topology.order) == list(range(len(corners)))


def test_neighbours_of_the_mesh_share_a_leaf_where_their_common_box_is_small(device):
    quad = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0.0, 0, 0], [1, 0, 1], [0, 0, 1]])
    corners = np.concatenate([quad + [k % 10, 0.1 * k, k // 10] for k in range(60)]).reshape(-1, 3, 3)
    apart = np.stack([corners[:60], corners[60:]], axis=1).reshape(-1, 3, 3)

    def leaves(triangles: NDArray, settings: dict[str, Any]) -> int:
        points = triangles.reshape(-1, 3)
        _, _, refs, _ = children(
            built(make_scene(points, np.arange(len(points)).reshape(-1, 3), LIGHTS), settings, device)
        )
        return int(((refs & LEAF) != 0).sum())

    assert leaves(corners, {}) == leaves(corners[:-1], {}) == leaves(apart, {"SHARED_AREA": 1000.0}) == 60
    assert leaves(corners, {"SHARED_AREA": 0.0}) == leaves(apart, {}) == 120
