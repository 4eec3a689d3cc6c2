"""The leaves of a tree and their keys."""

from typing import Any

import numpy as np
from helpers.brute_force import make_scene
from helpers.tuned_trees import built, children
from numpy.typing import NDArray
from shadowbench.methods.trees.native import LEAF


def test_neighbours_of_the_mesh_share_a_leaf_where_their_common_box_is_small(device):
    quad = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0.0, 0, 0], [1, 0, 1], [0, 0, 1]])
    corners = np.concatenate([quad + [k % 10, 0.1 * k, k // 10] for k in range(60)]).reshape(-1, 3, 3)
    apart = np.stack([corners[:60], corners[60:]], axis=1).reshape(-1, 3, 3)

    def leaves(triangles: NDArray, settings: dict[str, Any]) -> int:
        points = triangles.reshape(-1, 3)
        prepared = make_scene(points, np.arange(len(points)).reshape(-1, 3), [(5.0, 4.0, 3.0)])
        _, _, refs, _ = children(built(prepared, settings, device))
        return int(((refs & LEAF) != 0).sum())

    assert leaves(corners, {}) == 60
    assert leaves(corners[:-1], {}) == 60
    assert leaves(corners, {"SHARED_AREA": 0.0}) == 120
    assert leaves(apart, {}) == 120
    assert leaves(apart, {"SHARED_AREA": 1000.0}) == 60
