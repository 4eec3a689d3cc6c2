"""Light paths: where the lights are at each share of an animation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shadowbench.harness.scene.light_paths import Orbit, spread
from shadowbench.harness.scene.scene import Light

LIGHT = Light((3.0, 2.0, 1.0), shadows=False, color=(1.0, 0.5, 0.25), intensity=4.0)
finite = st.floats(-100, 100)


def at(path, share, light=LIGHT):
    (moved,) = path.at((light,), share)
    return np.array(moved.position)


def test_a_quarter_of_an_orbit_is_right_handed():
    assert np.allclose(at(Orbit((0.0, 0.0, 0.0)), 0.25, Light((1.0, 5.0, 0.0))), [0, 5, -1])


@given(st.tuples(finite, finite, finite), st.tuples(finite, finite, finite), st.floats(0, 1), st.floats(-3, 3))
@settings(derandomize=True, max_examples=60, deadline=None)
def test_an_orbit_keeps_radius_and_height(centre, axis, share, turns):
    if np.linalg.norm(axis) < 1e-3:
        return
    before, after = np.array(LIGHT.position) - centre, at(Orbit(centre, axis, turns), share) - centre
    unit = np.array(axis) / np.linalg.norm(axis)
    assert np.linalg.norm(after) == pytest.approx(np.linalg.norm(before), abs=1e-9)
    assert after @ unit == pytest.approx(before @ unit, abs=1e-9)


def test_an_orbit_begins_and_ends_where_the_light_is():
    path = Orbit((1.0, 1.0, 1.0), (0.2, 1.0, 0.3), 2.0)
    assert np.allclose(at(path, 0.0), LIGHT.position)
    assert np.allclose(at(path, 1.0), LIGHT.position)


def test_a_moved_light_keeps_all_else():
    (moved,) = Orbit((0.0, 0.0, 0.0)).at((LIGHT,), 0.3)
    assert moved == LIGHT.moved(moved.position)
    assert moved.position != LIGHT.position


def test_several_lights_from_one():
    lights = spread(LIGHT, (0.0, 0.0, 0.0), 4)
    assert len(lights) == 4
    assert sum(light.intensity for light in lights) == pytest.approx(4.0)
    places = np.array([light.position for light in lights])
    assert np.allclose(places[0], LIGHT.position)
    assert np.allclose(places[2], [-3, 2, -1])
    gaps = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
    assert np.allclose(gaps, math.sqrt(10) * math.sqrt(2))
    assert all(not light.shadows and light.color == LIGHT.color for light in lights)
    about_z = spread(LIGHT, (0.0, 0.0, 0.0), 2, (0.0, 0.0, 1.0))
    assert np.allclose(about_z[1].position, [-3, -2, 1])


@pytest.mark.parametrize(
    "wrong", [lambda: at(Orbit((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), 0.5), lambda: spread(LIGHT, (0.0, 0.0, 0.0), 0)]
)
def test_a_path_that_leads_nowhere_is_refused(wrong):
    with pytest.raises(ValueError, match="must be"):
        wrong()
