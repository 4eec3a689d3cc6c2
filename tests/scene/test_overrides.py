"""Lightings of an experiment: distances in radii, several lights, spots, paths of a moving light; count maps."""

import dataclasses
import json
import math

import numpy as np
import pytest
from helpers.tiny_runs import write_scene
from shadowbench.harness.results.pixel_maps import read_map, write_map
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.light_paths import Orbit, spread
from shadowbench.harness.scene.overrides import Lighting
from shadowbench.harness.scene.prepared import prepare, under
from shadowbench.harness.scene.scene import Light
from shadowbench.harness.scene.spotlight import CONE, RECTANGLE, spot_row


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    return prepare(resolve(write_scene(tmp_path_factory.mktemp("scene") / "tetra.obj")))


def test_the_default_lighting_changes_nothing_and_has_no_facts(prepared):
    assert Lighting().applied(prepared) is prepared
    assert Lighting().longer(prepared.scene) is prepared.scene
    assert (Lighting().facts(), Lighting.read({})) == ({}, Lighting())


def test_distance_is_in_radii_from_the_middle_in_the_lights_own_direction(prepared):
    middle = prepared.middle + prepared.centre
    own = prepared.scene.lights
    before = np.subtract(own[0].position, middle)
    for distance in (0.1, 3.0, 1e7):
        lit = Lighting("far", distance=distance).applied(prepared)
        after = np.subtract(lit.scene.lights[0].position, middle)
        assert np.linalg.norm(after) == pytest.approx(distance * prepared.radius)
        assert after @ before == pytest.approx(np.linalg.norm(after) * np.linalg.norm(before))
        moved = lit.moment(0, 4, 4).lights[0]
        assert np.allclose(moved, after + prepared.middle, rtol=1e-6)
    assert prepared.scene.lights is own


def test_a_spot_looks_at_its_target(prepared):
    lit = Lighting("spot", target=(0.1, 0.2, 0.3), angle=7.0).applied(prepared)
    light = lit.scene.lights[0]
    assert light.spot.angle == 7.0
    assert np.allclose(np.add(light.position, light.spot.direction), (0.1, 0.2, 0.3))
    assert lit.moment(0, 4, 4).spots[0, 0] == CONE


def test_a_spot_may_be_a_rectangle_or_fall_off(prepared):
    lighting = Lighting("spot", target=(0.1, 0.2, 0.3), angle=7.0, rise=3.0, falloff=9.0)
    (light,) = Lighting.read(json.loads(json.dumps(lighting.facts()))).applied(prepared).scene.lights
    assert (light.spot.angle, light.spot.rise, light.spot.falloff) == (7.0, 3.0, 9.0)
    row = spot_row(light.spot)
    assert (row[0], np.degrees(row[10:])) == (RECTANGLE, pytest.approx([7.0, 3.0]))


def test_a_light_becomes_directional_once(prepared):
    lighting = Lighting("sun", directional=True)
    (first,) = lighting.applied(prepared).scene.lights
    assert first.directional
    again = under(prepared, dataclasses.replace(prepared.scene, lights=(first,)))
    assert lighting.applied(again).scene.lights == (first,)


def test_a_light_with_an_area_becomes_directional_without_it(prepared):
    lamp = dataclasses.replace(prepared.scene.lights[0], shape="rectangle", size=(2.0, 1.0), samples=4)
    soft = under(prepared, dataclasses.replace(prepared.scene, lights=(lamp,)))
    (light,) = Lighting("sun", directional=True).applied(soft).scene.lights
    assert (light.directional, light.shape, light.samples) == (True, "", 1)


def test_a_directional_light_that_becomes_a_spot_stands_somewhere(prepared):
    sun = dataclasses.replace(prepared.scene.lights[0], position=(0.0, 3.0, 4.0), directional=True, spot=None)
    sunny = under(prepared, dataclasses.replace(prepared.scene, lights=(sun,)))
    (light,) = Lighting("spot", spot=20.0).applied(sunny).scene.lights
    assert not light.directional
    assert light.spot is not None
    away = np.subtract(light.position, prepared.middle + prepared.centre)
    assert np.allclose(away, np.array([0.0, 0.6, 0.8]) * 2 * prepared.radius)


def test_a_static_scene_gets_a_frame_for_every_place_of_the_light(prepared):
    lighting = Lighting("turn", turns=1.0, frames=5)
    longer = prepare(lighting.longer(prepared.scene))
    lit = lighting.applied(longer)
    assert lit.frame_count == 5
    places = [lit.moment(k, 4, 4).lights[0] for k in range(5)]
    assert np.allclose(places[0], places[4], atol=1e-6)
    assert np.linalg.norm(places[0] - places[2]) > 0.1
    assert (lit.points(0)[0] == lit.points(4)[0]).all()
    assert prepared.frame_count == 1


def test_lightings_go_through_json_and_need_a_label():
    lighting = Lighting("spot", target=(1.0, 2.0, 3.0), angle=5.0, frames=2)
    assert Lighting.read(json.loads(json.dumps(lighting.facts()))) == lighting
    with pytest.raises(ValueError, match="needs a label"):
        Lighting(count=2)
    with pytest.raises(ValueError, match="must not be negative"):
        Lighting("odd", distance=-1.0)


def test_maps_keep_every_count(tmp_path):
    counts = np.array([[0, 1, 255], [256, 65_536, (1 << 24) - 1]])
    write_map(tmp_path / "maps" / "a.png", counts)
    assert (read_map(tmp_path / "maps" / "a.png") == counts).all()
    with pytest.raises(ValueError, match="do not fit"):
        write_map(tmp_path / "b.png", counts + 1)


LIGHT = Light((3.0, 2.0, 1.0), shadows=False, color=(1.0, 0.5, 0.25), intensity=4.0)


def at(path, share, light=LIGHT):
    (moved,) = path.at((light,), share)
    return np.array(moved.position)


def test_a_moved_light_keeps_all_else():
    (moved,) = Orbit((0.0, 0.0, 0.0)).at((LIGHT,), 0.3)
    assert moved == LIGHT.moved(moved.position)
    assert moved.position != LIGHT.position


def test_several_lights_from_one():
    lights = spread(LIGHT, (0.0, 0.0, 0.0), 4)
    assert (len(lights), sum(light.intensity for light in lights)) == (4, pytest.approx(4.0))
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
