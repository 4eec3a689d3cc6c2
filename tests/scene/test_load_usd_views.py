"""The cameras and lights that a USD stage holds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.usd_stages import HEAD, mesh, moved_by, needs_usd, read
from shadowbench.harness.scene.targets import targets_of

pytestmark = needs_usd

M = mesh("M")


def turned(degrees: float, axis: str = "X", more: str = "") -> str:
    return f"""    float xformOp:rotate{axis} = {degrees}
    double3 xformOp:translate = (1, 2, 3)
    float3 xformOp:scale = (2, 5, 7)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotate{axis}", "xformOp:scale"]
{more}"""


def test_a_camera_looks_along_its_negative_z_whatever_its_scale(tmp_path):
    lens = "    float focalLength = 20\n    float verticalAperture = 40\n    float focusDistance = 4\n"
    loaded = read(tmp_path, M + f'def Camera "Eye" {{\n{turned(-90, more=lens)}}}\n')
    camera = loaded.cameras["Eye"]
    assert np.allclose(camera.eye, (1, 2, 3))
    assert np.allclose(camera.target, (1, -2, 3))
    assert np.allclose(camera.up, (0, 0, -1))
    assert camera.fov == pytest.approx(90)
    assert camera.height is None
    assert loaded.notes == ()


def test_an_orthographic_camera_says_how_much_it_shows(tmp_path):
    lens = '    token projection = "orthographic"\n    float verticalAperture = 40\n'
    camera = read(tmp_path, M + f'def Camera "Flat" {{\n{lens}}}\n').cameras["Flat"]
    assert camera.height == pytest.approx(4)
    assert np.allclose(camera.target, (0, 0, -1))


def test_cameras_of_the_same_name_have_their_paths(tmp_path):
    text = "".join(f'def Xform "{x}" {{\ndef Camera "Eye" {{\n}}\n}}\n' for x in "AB") + 'def Camera "Other" {\n}\n'
    assert list(read(tmp_path, M + text).cameras) == ["/A/Eye", "/B/Eye", "Other"]


def test_a_camera_that_moves_is_that_of_the_first_frame(tmp_path):
    head = HEAD.replace(")\n", "    startTimeCode = 2\n)\n")
    moves = moved_by(0).replace("= (0, 0.0, 0.0)", ".timeSamples = { 1: (10, 0, 0), 3: (30, 0, 0) }")
    loaded = read(tmp_path, M + f'def Camera "Eye" {{\n{moves}}}\n', head)
    assert np.allclose(loaded.cameras["Eye"].eye, (20, 0, 0))
    assert loaded.notes == ("moving cameras read at the first frame: 1",)
    assert len(loaded.frames) == 1


@pytest.mark.parametrize(
    "more", ["    float focalLength = 0\n", "    float verticalAperture = nan\n", moved_by(math.inf)]
)
def test_cameras_without_a_meaning_are_not_offered(tmp_path, more):
    loaded = read(tmp_path, M + f'def Camera "Eye" {{\n{more}}}\n')
    assert loaded.cameras == {}
    assert loaded.notes == ("cameras not offered: 1 (Camera)",)


def test_a_distant_light_is_a_direction(tmp_path):
    values = "    color3f inputs:color = (1, 0.5, 0)\n    float inputs:intensity = 3\n    float inputs:exposure = 1\n"
    light = read(tmp_path, M + f'def DistantLight "Sun" {{\n{turned(-90, more=values)}}}\n').lights["Sun"]
    assert light.directional
    assert np.allclose(light.position, (0, 1, 0))
    assert light.color == (1, 0.5, 0)
    assert light.intensity == 6
    assert light.spot is None


def lamp(tmp_path, kind, place, more=""):
    loaded = read(tmp_path, M + f'def {kind} "Lamp" {{\n{place}{more}}}\n')
    return loaded.lights["Lamp"], loaded.notes


AREA = ("lights with an area: 1; each shines from its middle unless it is given more targets",)
POINT = ("lights with an extent read as points: 1",)


@pytest.mark.parametrize(
    ("kind", "more", "shape", "size"),
    [
        ("SphereLight", "    float inputs:radius = 0.25\n", "sphere", 0.5),
        ("DiskLight", "    float inputs:radius = 2\n", "disc", 4.0),
        ("RectLight", "    float inputs:width = 3\n    float inputs:height = 0.5\n", "rectangle", (3.0, 0.5)),
        ("SphereLight", "", "sphere", 1.0),
        ("RectLight", "", "rectangle", (1.0, 1.0)),
    ],
)
def test_lights_with_an_extent_have_an_area(tmp_path, kind, more, shape, size):
    """Radius, width and height are those of the prim, or the ones that the format says where it has none."""
    light, notes = lamp(tmp_path, kind, moved_by(1, 2, 3), more)
    assert (light.position, light.shape, light.size, light.samples) == ((1, 2, 3), shape, size, 1)
    assert not light.directional
    assert notes == AREA
    (target,) = targets_of((light,), np.zeros(3), (0, 1, 0))
    assert target.position == light.position, "one target: the light is that of a point"


def test_a_rectangle_lies_as_its_prim_does(tmp_path):
    """Turned and scaled by 2, 5, 7: its width along the prim's x, its height along what was y."""
    light, _ = lamp(tmp_path, "RectLight", turned(-90, "Y"), "    float inputs:width = 3\n")
    assert light.size == pytest.approx((6, 5))
    places = np.array([one.position for one in targets_of((replace(light, samples=256),), np.zeros(3), (0, 1, 0))])
    assert np.ptp(places[:, 0]) == pytest.approx(0, abs=1e-9)
    assert np.ptp(places[:, 1]) == pytest.approx(5, rel=0.02)
    assert np.ptp(places[:, 2]) == pytest.approx(6, rel=0.02)
    down, _ = lamp(tmp_path, "RectLight", turned(-90, "X"), "    float inputs:width = 3\n")
    places = np.array([one.position for one in targets_of((replace(down, samples=256),), np.zeros(3), (0, 1, 0))])
    assert np.ptp(places[:, 0]) == pytest.approx(6, rel=0.02), "facing down, where nothing is horizontal alone"
    assert np.ptp(places[:, 2]) == pytest.approx(5, rel=0.02)


@pytest.mark.parametrize(
    ("kind", "place", "more", "notes"),
    [
        ("CylinderLight", moved_by(1, 2, 3), "", POINT),
        ("SphereLight", turned(0), "", POINT),  # stretched
        ("DiskLight", turned(0), "", POINT),
        ("SphereLight", moved_by(1, 2, 3), "    bool treatAsPoint = 1\n", ()),
        ("SphereLight", moved_by(1, 2, 3), "    float inputs:radius = 0\n", POINT),
        ("RectLight", moved_by(1, 2, 3), "    float inputs:width = nan\n", POINT),
        ("DiskLight", moved_by(1, 2, 3), "    float inputs:radius = 3e38\n", POINT),
    ],
)
def test_lights_without_a_known_area_are_points(tmp_path, kind, place, more, notes):
    light, told = lamp(tmp_path, kind, place, more)
    assert (light.position, light.shape) == ((1, 2, 3), "")
    assert told == notes


def test_a_shaped_light_is_a_spot(tmp_path):
    meta = '(prepend apiSchemas = ["ShapingAPI"])'
    cone = "    float inputs:shaping:cone:angle = 30\n    float inputs:shaping:focus = 2\n"
    spot = read(tmp_path, M + f'def SphereLight "Spot" {meta} {{\n{turned(-90, more=cone)}}}\n').lights["Spot"].spot
    assert np.allclose(spot.direction, (0, -1, 0))
    assert spot.angle == 30
    assert spot.falloff == 2


def test_lights_that_are_not_lit_or_have_no_place_are_not_offered(tmp_path):
    text = 'def SphereLight "Off" {\n    token visibility = "invisible"\n}\ndef DomeLight "Sky" {\n}\n'
    loaded = read(tmp_path, M + text)
    assert loaded.lights == {}
    assert loaded.notes == ("lights not offered: 1 (DomeLight)",)
