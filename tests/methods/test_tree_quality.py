"""How good trees of Warp (``warp_bvh/quality.py``) and the kd-tree are said to be: against sums over triangles' own
boxes, and over regions.
"""

import numpy as np
import pytest
from helpers.devices import DEVICES
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.methods.kdtree import levels

NODES, TESTS = "expected nodes a hundred rays", "expected tests a hundred rays"
POINTS, FACES = soup(5, 700)


def session_of(name: str, settings: dict[str, str], device: str = "cpu") -> Session:
    prepared = make_scene(POINTS, FACES, [(5.0, 4.0, 3.0)])
    session = Session(make_method(name, settings), prepared, 8, 8, device)
    session.answers(prepared.moment(0, 8, 8))
    return session


def own_tests(points: np.ndarray) -> float:
    """Triangles whose own boxes a random ray through the box of all meets: what any tree of single triangles tests."""
    corners = points[FACES].astype(np.float64)

    def area(low, high):
        x, y, z = np.moveaxis(high - low, -1, 0)
        return x * y + y * z + z * x

    return area(corners.min(1), corners.max(1)).sum() / area(points.min(0), points.max(0))


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("settings", [
    {"update": "bvh_rebuild"}, {"leaf_size": "1"}, {"leaf_size": "1", "constructor": "sah"},
    {"update": "refit", "leaf_size": "1", "constructor": "median"},
], ids=str)  # fmt: skip
def test_a_tree_of_single_triangles_tests_those_whose_boxes_are_met(settings, device):
    session = session_of("warp_bvh", settings, device)
    counters, points = session.method.counters(), session.frame.points.numpy()
    assert counters[TESTS] / 100 == pytest.approx(own_tests(points), rel=0.01)
    assert counters[NODES] > 100


def test_larger_leaves_test_more_triangles_and_have_fewer_nodes():
    few, many = (session_of("warp_bvh", {"constructor": "sah", "leaf_size": n}).method.counters() for n in ("1", "8"))
    assert many[TESTS] > few[TESTS]
    assert many[NODES] < few[NODES]


def test_regions_of_leaves_fill_the_box():
    method = session_of("kdtree", {}).method
    found = list(levels(method._work.tree))
    (whole,), filled = (sides.prod(axis=1) for sides, _ in found[:1]), 0.0
    for sides, members in found:
        filled += sides[members >= 0].prod(axis=1).sum()
    assert filled == pytest.approx(float(whole[0]))
    counters = method.counters()
    assert sum(members[members > 0].sum() for _, members in found) == counters["leaf members"]
    assert 100 < counters[NODES] < 100 * counters["nodes"]
    assert counters[TESTS] > 0
