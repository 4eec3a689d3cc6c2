"""The box of a frame's triangles, and the padding of the boxes in it (``trees/nodes.py``)."""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.frame import Frame
from shadowbench.methods.trees.builders.scene_box import BLOCK, BLOCKS, SceneBox
from shadowbench.methods.trees.nodes import padding


def check_box(points: np.ndarray, device: str) -> None:
    """Of triangles with these corners, found twice: it holds those that are finite, and no more."""
    prepared = make_scene(points, np.arange(len(points)).reshape(-1, 3), [(5.0, 4.0, 3.0)])
    frame, moment = Frame(prepared, 8, 8, 1, device), prepared.moment(0, 8, 8)
    frame.load(moment)
    extent, cleared = wp.zeros(1, dtype=wp.float32, device=device), wp.ones(1000, dtype=wp.int32, device=device)
    box = SceneBox(frame, extent, cleared)
    finite = moment.points[np.isfinite(moment.points).all(axis=1)]
    for _ in range(2):
        box.launch()
        found = box.box.numpy()
        np.testing.assert_array_equal(found[:3], finite.min(axis=0, initial=np.inf))
        np.testing.assert_array_equal(-found[3:], finite.max(axis=0, initial=-np.inf))
        assert extent.numpy()[0] == (np.abs(finite).max() if len(finite) else np.inf)
    assert not cleared.numpy().any()


@pytest.mark.parametrize("vertices", [3, BLOCK - 1, BLOCK + 2, 2 * BLOCK + 1, BLOCK * BLOCKS + 3])
def test_the_box_holds_what_triangles_use(vertices, device):
    check_box(soup(vertices, vertices // 3)[0], device)


def test_what_is_not_finite_is_left_out(device):
    points = soup(3, 400)[0]
    points[7] = np.nan
    points[8, 1] = np.inf
    check_box(points, device)
    check_box(np.full((9, 3), np.nan), device)


@wp.kernel
def padding_kernel(max_coordinate: wp.array(dtype=wp.float32), result: wp.array(dtype=wp.float32)):
    result[0] = padding(max_coordinate[0])


@pytest.mark.parametrize("size", [1e-38, 1e-30, 1e-3, 1.0, 1.1, 1e10, 1e30, 1e37, 3e38])
@pytest.mark.parametrize("eye", [(0.0, 0.5, 3.0), (0.0, 0.5, 3e6)])
def test_boxes_are_padded_by_more_than_their_bound(size, eye, device):
    """Of scenes of any size, seen from near and far: 5 units of what bounds the rays' origins and 8 of the scene's box."""
    points, faces = soup(4, 20)
    points *= size / np.abs(points).max()
    prepared = make_scene(points, faces, [(5.0, 4.0, 3.0)], tuple(min(size * x, 3e38) for x in eye))
    moment = prepared.moment(0, 8, 8)
    bound, extent = float(moment.max_coordinate[0]), float(np.abs(moment.points).max())
    ((found,),) = launched(padding_kernel, 1, [np.float32([bound])], [1], device)
    assert found > 2.0**-24 * (5.0 * bound + 8.0 * extent)
