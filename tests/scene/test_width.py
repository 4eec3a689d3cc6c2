"""Which frames are wide: where float64 leaves signs open that float32 inputs decide."""

import numpy as np
import pytest
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.hardcases.shapes import sheet
from shadowbench.harness.scene.prepared import Prepared
from shadowbench.harness.scene.scene import Light
from shadowbench.harness.scene.width import MANY, Sizes, is_wide

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
    assert not wide(make_scene(*soup(3, 400), [LIGHT], (0.0, 0.0, 0.0), (0.0, 0.0, -1.0))), "for an eye at the origin"


@pytest.mark.parametrize(("size", "expected"), [(2.0**8, False), (2.0**14, True), (2.0**40, True)])
def test_a_triangle_far_larger_than_the_eyes_distance_is_wide(size, expected) -> None:
    assert wide(with_triangle(ROOF * size + (0, 0, 0.37))) is expected


def test_a_sliver_is_wide_only_if_it_is_very_thin() -> None:
    thin = np.array([(1, 0, 0.3), (-1, 0.2, 0.1), (-1, 0.2, 0.1)])
    for width, expected in ((2.0**-12, False), (2.0**-26, True)):
        corners = thin.copy()
        corners[2, 1] += width
        assert wide(with_triangle(corners)) is expected


@pytest.mark.parametrize(("power", "expected"), [(0, False), (-8, False), (-20, True), (-40, True)])
def test_an_axis_of_its_own_scale_is_wide(power, expected) -> None:
    x = np.linspace(-3, 3, 5)
    points, faces = sheet(x, x, np.arange(5))
    points[:, :2] = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)  # no triangle is steep
    assert wide(make_scene(points * (1, 1, 2.0**power), faces, [(1.0, 2.5, 2.0**power)])) is expected


@pytest.mark.parametrize(
    ("light", "expected"),
    [
        ((0, 0, 0), False),
        ((0, 0, 1e-17), True),
        ((0, 0, 1e-44), True),
        ((0, 0, 1e-9), False),
        ((0, 1, 1), False),
        ((1e-30, 1, 1), True),  # float64 takes it for a point of the plane
    ],
)
def test_a_light_beside_a_plane_by_less_than_float64_knows_is_wide(light, expected) -> None:
    tilted = np.array([(8, 1, 9), (-8, 7, -1), (-7, -9, -16)], dtype=np.float64)  # z = x + y
    assert wide(with_triangle(tilted, lights=[light])) is expected


def test_planes_of_two_axes_that_hold_the_eye_are_not_wide_however_many_they_are() -> None:
    x = np.linspace(-3, 3, 40)
    points, faces = sheet(x, x, 1.0)
    assert len(faces) > 2 * MANY
    assert not wide(make_scene(points, faces, [(0.1, 0.2, -3.0)], (0.3, 0.2, -1.0), (0.3, 0.2, -2.0)))


def test_a_sun_lies_beside_all_planes_along_it_and_makes_no_frame_wide() -> None:
    wall = np.array([(2, -1, -1), (2, 5, -1), (2, 0, 4)], dtype=np.float64)
    assert not wide(with_triangle(wall, lights=[Light((0.0, 1.0, 0.0), directional=True)]))
