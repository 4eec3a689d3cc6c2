"""Which frames are wide: where float64 leaves signs open that float32 inputs decide."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.harness.scene.scene import Light
from shadowbench.harness.scene.width import Sizes, is_wide

EYE = (0.3, 0.2, 3.0)
LIGHT = (1.0, 2.5, 0.5)
ROOF = np.array([(8, 1, 0), (-8, 7, 0), (-7, -9, 0)], dtype=np.float64)


def wide(prepared: Prepared) -> bool:
    moment = prepared.moment(0, 8, 8)
    return is_wide(moment, Sizes(moment.points, prepared.faces, moment.valid))


def with_triangle(corners: np.ndarray, **given) -> Prepared:
    """A triangle beside an ordinary mesh."""
    points, faces = soup(3, 40)
    mesh = np.concatenate([points, corners]), np.concatenate([faces, [[120, 121, 122]]])
    return make_scene(*mesh, given.pop("lights", [LIGHT]), **given)


def test_ordinary_frames_are_not_and_neither_is_an_empty_one() -> None:
    assert not wide(make_scene(*soup(3, 400), [LIGHT]))
    assert not wide(with_triangle(ROOF + (0.1, 0.2, 0.3)))
    assert not wide(make_scene(np.zeros((0, 3)), np.zeros((0, 3)), [LIGHT]))


@pytest.mark.parametrize(("size", "expected"), [(2.0**8, False), (2.0**14, True), (2.0**40, True)])
def test_a_triangle_far_larger_than_the_eyes_distance_is_wide(size, expected) -> None:
    assert wide(with_triangle(ROOF * size + (0, 0, 0.37))) is expected


def test_a_sliver_is_wide_only_if_it_is_very_thin() -> None:
    thin = np.array([(1, 0, 0.3), (-1, 0.2, 0.1), (-1, 0.2, 0.1)])
    for width, expected in ((2.0**-12, False), (2.0**-26, True)):
        corners = thin.copy()
        corners[2, 1] += width
        assert wide(with_triangle(corners)) is expected


def test_an_axis_of_its_own_scale_is_wide() -> None:
    points, faces = soup(3, 400)
    assert wide(make_scene(points * (1, 1, 2.0**-40), faces, [(1.0, 2.5, 2.0**-40)]))


@pytest.mark.parametrize(("height", "expected"), [(0.0, False), (1e-17, True), (1e-9, False)])
def test_a_light_beside_a_plane_by_less_than_float64_knows_is_wide(height, expected) -> None:
    tilted = np.array([(8, 1, 3), (-8, 7, -3), (-7, -9, 11)], dtype=np.float64)
    tilted[:, 2] = tilted[:, 0] + tilted[:, 1]  # a plane through 0 in which rounding shows
    assert wide(with_triangle(tilted, lights=[(0.0, 0.0, height)])) is expected


def test_an_eye_at_the_origin_is_not_wide_for_that() -> None:
    assert not wide(make_scene(*soup(3, 400), [LIGHT], (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)))


def test_a_sun_lies_beside_all_planes_along_it_and_makes_no_frame_wide() -> None:
    wall = np.array([(2, -1, -1), (2, 5, -1), (2, 0, 4)], dtype=np.float64)
    assert not wide(with_triangle(wall, lights=[Light((0.0, 1.0, 0.0), directional=True)]))
