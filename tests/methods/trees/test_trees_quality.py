"""The quality of a tree: what a random ray meets in it, and how it grows worse while the tree is kept."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.small_scenes import make_scene, soup
from helpers.tuned_trees import built, children
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Geometry
from shadowbench.methods.trees.native import LEAF, PAIR

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
