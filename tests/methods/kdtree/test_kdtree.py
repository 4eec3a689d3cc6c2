"""The kd-tree (``large.py``, ``small.py``, ``clip.py``, ``kdtree/nodes.py``, ``kdtree/traversal.py``): short stacks
miss nothing, nor do leaves; bounded depth and memory.
"""

import numpy as np
import pytest
from helpers.method_trials import TRIALS, random_trial
from helpers.small_scenes import assert_same, make_scene, soup, trace
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.methods import kdtree
from shadowbench.methods.kdtree.nodes import LARGE_DEPTH, SMALL_DEPTH
from shadowbench.methods.kdtree.traversal import make_kernels
from tools.kernel_report import uses_of

NAME = "kdtree"
LEAF = 3


@pytest.mark.parametrize("distance", [3.0, 1e7], ids=["near", "far"])
def test_settings_and_stacks_agree_bit_for_bit(distance, device, monkeypatch):
    """From 1e7 radii away both sides of a plane have the same times, within rounding: all of them must be visited."""
    vertices, faces = soup(7, 400)
    eye = tuple(distance * np.array([0.3, 0.4, 0.85]))
    prepared = make_scene(vertices, faces, [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)], eye, fov=140.0 / distance)
    reference = trace("uniform_grid", {}, prepared, 33, 21, device)[2]
    assert (reference["triangle"] >= 0).sum() > 100
    for settings in ({}, {}, {"small": "5"}, {"traversal_cost": "20"}):
        assert_same(trace(NAME, settings, prepared, 33, 21, device)[2], reference)
    for stack in (1, 2):
        monkeypatch.setattr(kdtree, "make_kernels", lambda stack=stack: make_kernels(stack))
        assert_same(trace(NAME, {}, prepared, 33, 21, device)[2], reference)


def test_what_does_not_suffice_grows_and_gives_the_same_tree():
    prepared = make_scene(*soup(7, 3000, size=0.1), [(5.0, 4.0, 3.0)])
    session = Session(make_method(NAME), prepared, 20, 20, "cpu")
    session.method._capacity = [10, 5, 5, 5]
    session._plan()
    session.answers(prepared.moment(0, 20, 20))
    assert session.regrown > 1
    ample = trace(NAME, {"capacity": "90000"}, prepared, 20, 20)[0]
    assert (ample.regrown, session.method.counters()) == (0, ample.method.counters())


def leaves_around(nodes: np.ndarray, point: np.ndarray) -> list[np.ndarray]:
    """The records of all leaves whose closed region holds a point."""
    found, todo = [], [0]
    while todo:
        split, word = nodes[todo.pop()]
        axis, child = word & 3, word >> 2
        if axis == LEAF:
            found.append((split, split + child))
            continue
        plane = np.int32(split).view(np.float32)
        todo += [child] * bool(point[axis] <= plane) + [child + 1] * bool(point[axis] >= plane)
    return found


@pytest.mark.parametrize("trial", ["random", "teapot in a stadium", "triangles through every cell"])
def test_a_leaf_around_each_point_of_a_triangle_lists_it(trial):
    """Corners and the middle of edges are exact here; a point inside is within rounding, far from any plane."""
    prepared, width, height = random_trial(5) if trial == "random" else TRIALS[trial]
    session, moment, _ = trace(NAME, {"small": "8"}, prepared, width, height)
    method = session.method
    nodes, members = method._work.tree.nodes.numpy(), method._work.tree.members.numpy()
    random = np.random.default_rng(0)
    weights = np.concatenate([random.dirichlet([0.4] * 3, 60), np.eye(3)])
    missed = 0
    for i in np.nonzero(moment.valid)[0]:
        for p in weights @ moment.points[prepared.faces[i]].astype(np.float64):
            missed += not any(i in members[b:e] for b, e in leaves_around(nodes, p))
    assert missed == 0


def depth_of(nodes: np.ndarray) -> int:
    deepest, todo = 0, [(0, 1)]
    while todo:
        node, depth = todo.pop()
        word = nodes[node, 1]
        deepest = max(deepest, depth)
        if word & 3 != LEAF:
            todo += [(word >> 2, depth + 1), ((word >> 2) + 1, depth + 1)]
    return deepest


def around_the_origin(sizes: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """One triangle of each size, turned anyhow, all with their centroid at the origin."""
    corners = np.random.default_rng(seed).normal(size=(len(sizes), 3, 3))
    corners -= corners.mean(axis=1, keepdims=True)
    return (corners * sizes[:, None, None]).reshape(-1, 3), np.arange(3 * len(sizes)).reshape(-1, 3)


@pytest.mark.parametrize("sizes", [np.ones(1500), 0.5 ** (np.arange(1500) / 15.0)], ids=["one size", "halving"])
def test_triangles_that_no_plane_parts_end_in_few_large_leaves(sizes):
    """They would be doubled at each level: what is listed stays within a bound, and so does the depth."""
    prepared = make_scene(*around_the_origin(sizes, 1), [(3.0, 4.0, 5.0)], (0.0, 0.0, 4.0))
    session, _, got = trace(NAME, {}, prepared, 16, 16)
    need = session.method.needs().numpy()
    assert need[0] <= 16 * len(sizes)
    assert need[3] <= 32 * len(sizes)
    assert depth_of(session.method._work.tree.nodes.numpy()) <= LARGE_DEPTH + SMALL_DEPTH + 1
    assert_same(got, trace("uniform_grid", {"density": "0.01"}, prepared, 16, 16)[2])


@pytest.mark.parametrize("kernel", make_kernels(), ids=["primary", "shadow"])
def test_kernels_compile_for_cuda(kernel):
    (use,) = uses_of(kernel.module).values()
    assert use.registers <= 128
