"""The cameras and lights of glTF files."""

import math

import numpy as np
import pytest
from helpers.gltf_files import Gltf, square
from shadowbench.harness.scene.moment import ray_tables
from shadowbench.harness.scene.readers.load import load
from shadowbench.harness.scene.spotlight import spot_row

PERSPECTIVE = {"type": "perspective", "perspective": {"yfov": math.radians(50), "znear": 0.1}}
QUARTER = [0, math.sqrt(0.5), 0, math.sqrt(0.5)]
"""A quarter turn about y: -z becomes -x."""


def with_camera(camera: dict, **node: object) -> Gltf:
    made = square()
    made.add("cameras", camera)
    made.node(camera=0, **node)
    return made


def with_light(light: dict, **node: object) -> Gltf:
    made = square()
    made.extend(made.head, "KHR_lights_punctual", {"lights": [light]})
    made.node(extensions={"KHR_lights_punctual": {"light": 0}}, **node)
    return made


def test_a_camera_looks_along_the_negative_z_of_its_node(tmp_path):
    made = with_camera(PERSPECTIVE, name="front", translation=[1, 2, 3], rotation=QUARTER, scale=[2, 2, 2])
    made.node(camera=0, name="front")
    made.node(camera=0)
    found = load(made.write(tmp_path)).cameras
    assert list(found) == ["front", "front 2", "camera"]
    camera = found["front"]
    assert camera.eye == (1, 2, 3)
    assert np.allclose(np.subtract(camera.target, camera.eye), [-3, 0, 0])
    assert np.allclose(camera.up, [0, 1, 0])
    assert camera.fov == pytest.approx(50)
    ray_tables(camera, 4, 4, np.zeros(3))


def test_an_orthographic_camera(tmp_path):
    camera = {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 9}, "name": "plan"}
    found = load(with_camera(camera).write(tmp_path)).cameras["plan"]
    assert (found.height, found.eye, found.target) == (4, (0, 0, 0), (0, 0, -1))


def test_the_camera_of_an_animation_is_that_of_its_first_frame(tmp_path):
    made = with_camera(PERSPECTIVE)
    made.head["nodes"][0]["camera"] = 0
    del made.head["nodes"][1]["camera"]
    made.animate(translation=(0, [2, 3], [[7, 0, 0], [8, 0, 0]]))
    assert load(made.write(tmp_path)).cameras["camera"].eye == (7, 0, 0)


@pytest.mark.parametrize(
    ("camera", "scale"),
    [
        ({"type": "perspective", "perspective": {"yfov": 4}}, 1),
        ({"type": "perspective", "perspective": {"yfov": "x"}}, 1),
        ({"type": "perspective"}, 1),
        ({"type": "orthographic", "orthographic": {"ymag": 0}}, 1),
        ({}, 1),
        (PERSPECTIVE, 0),
    ],
)
def test_cameras_that_see_nothing_are_left_out(tmp_path, camera, scale):
    assert load(with_camera(camera, scale=[scale] * 3).write(tmp_path)).cameras == {}


def test_point_lights(tmp_path):
    light = {"type": "point", "color": [1, 0.5, 0], "intensity": 100, "name": "lamp"}
    found = load(with_light(light, translation=[1, 2, 3]).write(tmp_path)).lights["lamp"]
    assert (found.position, found.color, found.intensity) == ((1, 2, 3), (1, 0.5, 0), 100)
    assert found.spot is None
    assert not found.directional


def test_directional_lights_shine_along_the_negative_z_of_their_node(tmp_path):
    found = load(with_light({"type": "directional"}, rotation=QUARTER).write(tmp_path)).lights["light"]
    assert found.directional
    assert np.allclose(found.position, [1, 0, 0]), "the direction to the light"


def test_spots(tmp_path):
    cone = {"type": "spot", "spot": {"outerConeAngle": math.pi / 6}}
    found = load(with_light(cone, rotation=QUARTER, translation=[4, 0, 0]).write(tmp_path)).lights["light"]
    assert found.position == (4, 0, 0)
    assert found.spot.angle == pytest.approx(30)
    assert np.allclose(found.spot.direction, [-1, 0, 0])
    spot_row(found.spot)
    assert load(with_light({"type": "spot"}).write(tmp_path)).lights["light"].spot.angle == pytest.approx(45)


@pytest.mark.parametrize(
    ("light", "shown"),
    [({"type": "point"}, 0), ({}, 1), ({"type": "area"}, 1), ({"type": "spot", "spot": {"outerConeAngle": 0}}, 1)],
)
def test_hidden_and_useless_lights_are_left_out(tmp_path, light, shown):
    made = with_light(light)
    made.extend(made.head["nodes"][1], "KHR_node_visibility", {"visible": bool(shown)})
    assert load(made.write(tmp_path)).lights == {}
