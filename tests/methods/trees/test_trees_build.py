"""The tree itself (``keys.py``, ``builders/sort.py``, ``climb.py``, ``refit.py``): every triangle once, boxes that hold
their children, the same on every device; and its quality (``trees/quality.py``), as it grows worse while it is kept.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp
from helpers.small_scenes import make_scene, soup
from helpers.tuned_trees import built, children
from numpy.typing import NDArray
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Geometry
from shadowbench.methods.trees import constants
from shadowbench.methods.trees.builders.sah import DEEP, sah_topology
from shadowbench.methods.trees.builders.sort import Sort, count_digits
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


BLOCK = 256


@wp.kernel(enable_backward=False, grid_stride=False)
def count_kernel(
    count: wp.int32, passes: wp.int32, nothing: wp.int32, keys: wp.array(dtype=wp.int32),
    state: wp.array(dtype=wp.int32),
):  # fmt: skip
    i = wp.tid()
    key = nothing
    if i < count:
        key = keys[i]
    count_digits(key, nothing, nothing, passes, state)


@pytest.mark.parametrize("count", [1, 31, 2047, 2048, 2049, 70_000, 450_000])
@pytest.mark.parametrize("bits", [24, 30])
def test_sorting_is_stable(count, bits, device):
    random = np.random.default_rng(count)
    keys = random.integers(0, 2**bits if count % 2 else 300, count).astype(np.int32)
    nothing = 2**bits - 1
    keys[random.random(count) < 0.4] = nothing
    sort = Sort(count, bits, nothing, device)
    for _ in range(2):
        sort.unsorted.keys.assign(keys)
        sort.unsorted.values.assign(np.arange(count, dtype=np.int32))
        sort.state.zero_()
        inputs = [count, sort.passes, nothing, sort.unsorted.keys]
        threads = -(-count // BLOCK) * BLOCK
        wp.launch(count_kernel, threads, inputs, [sort.state], device=device, block_dim=BLOCK)
        sort.launch()
        wanted = np.argsort(keys, kind="stable")[: (keys < nothing).sum()]
        assert sort.held.numpy()[0] == len(wanted)
        np.testing.assert_array_equal(sort.sorted.values.numpy()[: len(wanted)], wanted)
        np.testing.assert_array_equal(sort.sorted.keys.numpy()[: len(wanted)], keys[wanted])


NODES, TESTS = "expected nodes a hundred rays", "expected tests a hundred rays"


def swirling(frames: int = 5) -> Prepared:
    """A soup whose inner parts turn about the vertical, ever further."""
    points, faces = soup(4, 900)
    scene = make_scene(points, faces, [(5.0, 4.0, 3.0)]).scene

    def positions(frame: int) -> np.ndarray:
        angle = 2.0 * frame / np.maximum(0.2, np.linalg.norm(points, axis=1))
        x, y, z = points.T
        return np.stack([np.cos(angle) * x + np.sin(angle) * z, y, np.cos(angle) * z - np.sin(angle) * x], axis=1)

    return prepare(replace(scene, geometry=lambda: Geometry(faces, positions, frames)))


def cost(prepared: Prepared, frame: int, settings: dict[str, str]) -> int:
    session = Session(make_method("bvh2", settings), prepared, 8, 8, "cpu")
    session.answers(prepared.moment(frame, 8, 8))
    counters = session.method.counters()
    return 120 * counters[NODES] + 100 * counters[TESTS]


@pytest.mark.parametrize("settings", [{}, {"update": "refit"}], ids=str)
def test_random_lines_meet_as_many_boxes_as_is_expected(settings):
    """Lines of all directions through the scene's box, from a sphere about it."""
    session = built(make_scene(*soup(5, 100), [(5.0, 4.0, 3.0)]), settings)
    centres, extents, refs, root = children(session)
    low, high = centres - extents, centres + extents
    boxes = [(low[root].min(axis=0), high[root].max(axis=0), 1, 0)]
    todo = [root]
    for node in iter(todo):
        for side in (0, 1):
            ref = int(refs[node, side])
            leaf = bool(ref & LEAF)
            boxes.append((low[node, side], high[node, side], not leaf, (1 + bool(ref & PAIR)) * leaf))
            todo += [] if leaf else [ref]
    lows, highs = (np.array([box[k] for box in boxes]) for k in (0, 1))
    random = np.random.default_rng(3)
    directions, points = random.normal(size=(2, 40_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    # On a disc across each direction, evenly, that covers the whole box.
    across = points - (points * directions).sum(axis=1, keepdims=True) * directions
    across *= np.sqrt(random.uniform(size=(len(points), 1))) / np.linalg.norm(across, axis=1, keepdims=True)
    origins = 0.5 * (lows[0] + highs[0]) + across * 0.5 * np.linalg.norm(highs[0] - lows[0])
    near, far = np.full((2, len(boxes), len(points)), -np.inf)
    far[:] = np.inf
    for axis in range(3):
        ends = [(end[:, axis, None] - origins[:, axis]) / directions[:, axis] for end in (lows, highs)]
        near, far = np.maximum(near, np.minimum(*ends)), np.minimum(far, np.maximum(*ends))
    met = (near <= far)[:, (near <= far)[0]].mean(axis=1)
    counters = session.method.counters()
    assert counters[NODES] / 100 == pytest.approx((met * [box[2] for box in boxes]).sum(), rel=0.03)
    assert counters[TESTS] / 100 == pytest.approx((met * [box[3] for box in boxes]).sum(), rel=0.03)


def test_trees_of_little(device):
    for points, tests in (
        (np.full((3, 3), np.nan), (0,)),
        (np.eye(3), (100,)),
        (np.eye(3).repeat(2, axis=0)[:3], (0,)),
    ):
        for settings in ({}, {"update": "refit"}):
            session = built(make_scene(points, np.array([[0, 1, 2]]), [(5.0, 4.0, 3.0)]), settings, device)
            counters = session.method.counters()
            assert (counters[NODES], counters[TESTS]) in [(0, n) for n in tests], (points, settings)


def test_a_kept_tree_is_the_best_at_its_own_frame_and_worse_the_longer_it_is_kept():
    prepared = swirling()
    costs = [
        [cost(prepared, frame, {"update": "refit", "tree_frame": str(own)}) for frame in (0, 2, 4)] for own in (0, 2)
    ]
    assert costs[0] == sorted(costs[0])
    assert costs[0][2] > 1.2 * costs[0][0]
    assert costs[1][1] < costs[0][1]
    assert costs[1][1] < min(costs[1][0], costs[1][2])


def test_a_tree_of_a_frame_that_is_not_there_is_refused():
    with pytest.raises(UserError, match=r"^tree_frame=5: .* has 5 frames$"):
        Session(make_method("bvh2", {"update": "refit", "tree_frame": "5"}), swirling(), 8, 8, "cpu")
    for settings in ({"tree_frame": "1"}, {"update": "refit", "tree_frame": "-1"}):
        with pytest.raises(UserError, match="tree_frame must be 0 or more, and 0 unless update=refit"):
            make_method("bvh2", settings)
