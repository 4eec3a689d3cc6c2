"""Duplicates list their corners in the order of the first, and what belongs to the corners follows."""

import itertools

import numpy as np
import pytest
from shadowbench.harness.scene.corner_order import follow, in_order_of_duplicates
from shadowbench.harness.scene.prepared import prepare, under
from shadowbench.harness.scene.scene import AlphaMask, Camera, Geometry, Scene

ORDERS = list(itertools.permutations(range(3)))
WELD = np.array([0, 1, 2, 3, 0, 1, 2], dtype=np.int32)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("closed", [False, True])
def test_a_duplicate_takes_the_order_of_the_first(order, closed) -> None:
    faces = np.array([[2, 0, 1], [0, 1, 3], [0, 0, 0]], dtype=np.int32)
    faces[2] = np.array([6, 4, 5])[list(order)]
    found = in_order_of_duplicates(faces, WELD, closed)
    rotated = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    np.testing.assert_array_equal(found[:2], faces[:2])
    expected = [6, 4, 5] if rotated or not closed else faces[2]
    np.testing.assert_array_equal(found[2], expected)


def test_a_mesh_without_duplicates_stays_and_so_does_an_empty_one() -> None:
    faces = np.array([[2, 0, 1], [0, 1, 3]], dtype=np.int32)
    np.testing.assert_array_equal(in_order_of_duplicates(faces, WELD, False), faces)
    none = np.zeros((0, 3), dtype=np.int32)
    assert in_order_of_duplicates(none, none[:, 0], False).shape == (0, 3)


def test_values_follow_their_corners() -> None:
    before = np.array([[0, 1, 2], [3, 4, 5]], dtype=np.int32)
    after = np.array([[0, 1, 2], [5, 3, 4]], dtype=np.int32)
    values = np.arange(12.0).reshape(2, 3, 2)
    np.testing.assert_array_equal(follow(values, before, after), [values[0], values[1][[2, 0, 1]]])


def test_texture_coordinates_follow_on_another_scene_too() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [5, 3, 4]])
    coordinates = points[faces][..., :2].astype(np.float32)
    mask = AlphaMask(np.ones(2, dtype=np.uint8), coordinates, np.eye(2, dtype=np.uint8))
    scene = Scene("x", "X", lambda: Geometry.static(points, faces), Camera((0, 0, 2), (0, 0, 0)), ())
    masked = Scene("x", "X", scene.geometry, scene.camera, (), alpha=lambda geometry: mask)
    for prepared in (prepare(masked), under(prepare(scene), masked)):
        assert prepared.faces.tolist() == [[0, 1, 2], [3, 4, 5]]
        assert prepared.alpha is not None
        np.testing.assert_array_equal(prepared.alpha.coordinates, points[prepared.faces][..., :2])
