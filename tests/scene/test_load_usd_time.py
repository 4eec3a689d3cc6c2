"""USD over time, each frame as the stage is at its time code; the cameras and lights that a stage holds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.mesh_files import refused, written
from helpers.usd_stages import HEAD, POINTS, bounds, bounds_of_library, mesh, moved_by, needs_usd, read
from shadowbench.harness.errors import UserError
from shadowbench.harness.scene.readers.checks import Wanted
from shadowbench.harness.scene.readers.load import load
from shadowbench.harness.scene.targets import targets_of

pytestmark = needs_usd


def stage(text: str, start=None, end=None, second=None, rate=None) -> str:
    values = {"startTimeCode": start, "endTimeCode": end, "timeCodesPerSecond": second, "framesPerSecond": rate}
    given = "".join(f"    {name} = {value}\n" for name, value in values.items() if value is not None)
    return HEAD.replace(")\n", given + ")\n") + text


def read_at(tmp_path, text: str, *wanted, **said):
    return load(written(tmp_path, "a.usda", stage(text, **said)), Wanted(*wanted))


def lefts_of(loaded) -> list[float]:
    """The least x of all triangles, at each frame."""
    return [bounds(loaded, k)[0][0] for k in range(len(loaded.frames))]


RAMP = moved_by(0).replace("= (0, 0.0, 0.0)", ".timeSamples = { 1: (10, 0, 0), 5: (50, 0, 0) }")
SLIDING = mesh("A", RAMP)


@pytest.mark.parametrize(("said", "wanted", "places", "rate", "note"), [
    ({}, (), [10, 20, 30, 40, 50], 24, ""),
    ({"start": 2, "end": 4}, (), [20, 30, 40], 24, "samples at 2 time codes outside 2 to 4 not read"),
    ({"start": 0, "end": 2}, (), [10, 10, 20], 24, "samples at 1 time codes outside 0 to 2 not read"),
    ({"start": 3}, (), [30, 40, 50], 24, "samples at 1 time codes outside 3 to 5 not read"),
    ({"start": 4, "end": 1}, (), [40], None, "samples at 2 time codes outside 4 to 4 not read"),
    ({"start": 1, "end": 1}, (), [10], None, "samples at 1 time codes outside 1 to 1 not read"),
    ({"second": 48}, (), [10, 20, 30, 40, 50], 48, ""),
    ({"second": 24, "rate": 48}, (), [10, 15, 20, 25, 30, 35, 40, 45, 50], 48, ""),
    ({"second": 24, "rate": 8}, (), [10, 40], 8, "samples at 1 time codes between frames not read"),
    ({}, (None, False, 6.0), [10, 50], 6, ""),
    ({"second": "nan"}, (), [10, 20, 30, 40, 50], 24, ""),
    ({}, ((1, 3, 2),), [20, 40], 12, "2 of 5 frames read"),
    ({}, ((2, 2, 1),), [30], None, "1 of 5 frames read"),
    ({}, ((3, None, 1),), [40, 50], 24, "2 of 5 frames read"),
])  # fmt: skip
def test_frames_and_rate(tmp_path, said, wanted, places, rate, note):
    loaded = read_at(tmp_path, SLIDING, *wanted, **said)
    assert np.allclose(lefts_of(loaded), places)
    assert (loaded.rate, loaded.notes) == (rate, (note,) if note else ())


@pytest.mark.parametrize("said", [{"end": 1e18}, {"end": 9, "second": 1, "rate": 1e9}])
def test_animations_that_never_end(tmp_path, said):
    refused(written(tmp_path, "a.usda", stage(SLIDING, **said)), "has too many frames")


@pytest.mark.parametrize("frames", [(0, 5, 1), (7, None, 1)])
def test_frames_that_are_not_there_are_refused(tmp_path, frames):
    with pytest.raises(UserError, match="has frames 0 to 4"):
        read_at(tmp_path, SLIDING, frames)


@pytest.mark.parametrize("word", ["nan", "inf", "-inf"])
def test_ends_that_are_no_numbers_are_those_of_the_samples(tmp_path, word):
    assert np.allclose(lefts_of(read_at(tmp_path, SLIDING, start=word, end=word)), [10, 20, 30, 40, 50])


def test_more_positions_than_the_limit(tmp_path, monkeypatch):
    from shadowbench.harness.scene.readers.usd import read

    monkeypatch.setattr(read, "MOST_POSITIONS", 10)
    refused(written(tmp_path, "a.usda", stage(SLIDING)), "12 vertices in 4 frames", "--frames")


def test_what_is_visible_at_some_times_vanishes_and_appears(tmp_path):
    blinks = '    token visibility.timeSamples = { 1: "inherited", 2: "invisible", 3: "inherited" }\n'
    text = f'def Scope "S" {{\n{blinks}{mesh("A", moved_by(5))}}}\n{mesh("B")}'
    loaded = read_at(tmp_path, text)
    assert ([bounds(loaded, k)[1][0] for k in range(3)], len(loaded.faces)) == ([6, 1, 6], 2)
    assert loaded.notes == ("not in all frames: /S/A",)
    first = read_at(tmp_path, text, (1, 2, 1))
    assert [bounds(first, k)[1][0] for k in range(2)] == [1, 6]


def test_topology_that_changes_is_padded(tmp_path):
    text = """def Mesh "Fluid" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts.timeSamples = { 1: [3], 2: [3, 3], 3: [4] }
    int[] faceVertexIndices.timeSamples = { 1: [0, 1, 2], 2: [0, 1, 2, 3, 4, 5], 3: [0, 1, 2, 3] }
    point3f[] points.timeSamples = {
        1: [(0, 0, 0), (1, 0, 0), (0, 1, 0)],
        2: [(0, 0, 0), (1, 0, 0), (0, 1, 0), (7, 0, 0), (8, 0, 0), (7, 1, 0)],
        3: [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)],
    }
}
"""
    loaded = read_at(tmp_path, text + mesh("B", moved_by(-5)))
    there = [int(np.isfinite(frame[loaded.faces]).all(axis=(1, 2)).sum()) for frame in loaded.frames]
    assert (there, [bounds(loaded, k)[1] for k in range(3)]) == ([2, 3, 3], [[1, 1, 0], [8, 1, 0], [2, 2, 0]])
    assert loaded.notes == ("topology changes, so that padded triangles vanish and appear: /Fluid",)


def test_sizes_of_gprims_over_time_keep_their_topology(tmp_path):
    loaded = read_at(tmp_path, 'def Sphere "S" {\n    double radius.timeSamples = { 0: 1, 2: 3 }\n}\n')
    assert np.allclose([bounds(loaded, k)[1] for k in range(3)], [[1] * 3, [2] * 3, [3] * 3])
    assert len(loaded.faces) == 960
    assert "topology" not in " ".join(loaded.notes)


def test_instancers_over_time(tmp_path):
    text = f"""def PointInstancer "Field" {{
    rel prototypes = </Field/P>
    int[] protoIndices = [0, 0]
    point3f[] positions.timeSamples = {{ 0: [(10, 0, 0), (20, 0, 0)], 2: [(30, 0, 0), (40, 0, 0)] }}
{mesh("P")}}}
"""
    loaded = read_at(tmp_path, text)
    places = [frame[loaded.faces][:, 0, 0].tolist() for frame in loaded.frames]
    assert (places, loaded.rate) == ([[10, 20], [20, 30], [30, 40]], 24)
    moving = text.replace(mesh("P"), SLIDING.replace('"A"', '"P"'))
    assert lefts_of(read_at(tmp_path, moving, start=1, end=2)) == pytest.approx([30, 50])
    fewer = text.replace("protoIndices = [0, 0]", "protoIndices.timeSamples = { 0: [0, 0], 2: [0] }")
    fewer = fewer.replace("(30, 0, 0), (40, 0, 0)", "(30, 0, 0)")
    loaded = read_at(tmp_path, fewer)
    places = [frame[loaded.faces][:, 0, 0] for frame in loaded.frames]
    assert [place[np.isfinite(place)].tolist() for place in places] == [[10, 20], [10, 20], [30]]
    assert loaded.notes == ("topology changes, so that padded triangles vanish and appear: /Field",)


def test_an_animation_that_changes_nothing_is_one_frame(tmp_path):
    """And hidden prims that move make no frames."""
    hidden = mesh("H", RAMP + '    token visibility = "invisible"\n') + mesh("B")
    assert (len(read_at(tmp_path, hidden).frames), bounds(read_at(tmp_path, hidden))) == (1, [[0, 0, 0], [1, 1, 0]])
    still = RAMP.replace("50, 0, 0", "10, 0, 0")
    loaded = read_at(tmp_path, mesh("A", still))
    assert len(loaded.frames) == 1
    assert loaded.rate is None
    assert loaded.notes == ("5 frames are alike: read as one",)


def test_a_mesh_whose_points_are_blocked_at_a_time_is_not_there(tmp_path):
    points = POINTS.replace("points =", "points.timeSamples = { 1: None, 2:").replace("\n", " }\n")
    loaded = read_at(tmp_path, mesh("A", points=points) + mesh("B", moved_by(-2)))
    assert [bounds(loaded, k)[1][0] for k in range(2)] == [-1, 1]


def test_every_frame_has_the_bounds_of_the_library(tmp_path):
    turn = """    matrix4d xformOp:transform.timeSamples = {
        -1: ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 2, 3, 1)),
        5: ((0, 2, 0, 0), (-2, 0, 0, 0), (0, 0, 1, 0), (7, 2, 9, 1)) }
    uniform token[] xformOpOrder = ["xformOp:transform"]
"""
    loaded = read_at(tmp_path, f'def Xform "X" {{\n{turn}def Cube "C" {{\n{RAMP}}}\n}}\n' + SLIDING)
    assert len(loaded.frames) == 7
    for frame in (0, 3, 6):
        assert np.allclose(bounds(loaded, frame), bounds_of_library(tmp_path / "a.usda", frame - 1.0))


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
    assert (loaded.notes, len(loaded.frames)) == (("moving cameras read at the first frame: 1",), 1)


@pytest.mark.parametrize(
    "more", ["    float focalLength = 0\n", "    float verticalAperture = nan\n", moved_by(math.inf)]
)
def test_cameras_without_a_meaning_are_not_offered(tmp_path, more):
    loaded = read(tmp_path, M + f'def Camera "Eye" {{\n{more}}}\n')
    assert (loaded.cameras, loaded.notes) == ({}, ("cameras not offered: 1 (Camera)",))


def test_a_distant_light_is_a_direction(tmp_path):
    values = "    color3f inputs:color = (1, 0.5, 0)\n    float inputs:intensity = 3\n    float inputs:exposure = 1\n"
    light = read(tmp_path, M + f'def DistantLight "Sun" {{\n{turned(-90, more=values)}}}\n').lights["Sun"]
    assert light.directional
    assert np.allclose(light.position, (0, 1, 0))
    assert (light.color, light.intensity) == ((1, 0.5, 0), 6)
    assert light.spot is None


def lamp(tmp_path, kind, place, more=""):
    loaded = read(tmp_path, M + f'def {kind} "Lamp" {{\n{place}{more}}}\n')
    return loaded.lights["Lamp"], loaded.notes


AREA = ("lights with an area: 1; each shines from its middle unless it is given more targets",)
POINT = ("lights with an extent read as points: 1",)


@pytest.mark.parametrize(("kind", "more", "shape", "size"), [
    ("SphereLight", "    float inputs:radius = 0.25\n", "sphere", 0.5),
    ("DiskLight", "    float inputs:radius = 2\n", "disc", 4.0),
    ("RectLight", "    float inputs:width = 3\n    float inputs:height = 0.5\n", "rectangle", (3.0, 0.5)),
    ("SphereLight", "", "sphere", 1.0),
    ("RectLight", "", "rectangle", (1.0, 1.0)),
])  # fmt: skip
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


@pytest.mark.parametrize(("kind", "place", "more", "notes"), [
    ("CylinderLight", moved_by(1, 2, 3), "", POINT),
    ("SphereLight", turned(0), "", POINT),  # stretched
    ("DiskLight", turned(0), "", POINT),
    ("SphereLight", moved_by(1, 2, 3), "    bool treatAsPoint = 1\n", ()),
    ("SphereLight", moved_by(1, 2, 3), "    float inputs:radius = 0\n", POINT),
    ("RectLight", moved_by(1, 2, 3), "    float inputs:width = nan\n", POINT),
    ("DiskLight", moved_by(1, 2, 3), "    float inputs:radius = 3e38\n", POINT),
])  # fmt: skip
def test_lights_without_a_known_area_are_points(tmp_path, kind, place, more, notes):
    light, told = lamp(tmp_path, kind, place, more)
    assert (light.position, light.shape, told) == ((1, 2, 3), "", notes)


def test_a_shaped_light_is_a_spot(tmp_path):
    meta = '(prepend apiSchemas = ["ShapingAPI"])'
    cone = "    float inputs:shaping:cone:angle = 30\n    float inputs:shaping:focus = 2\n"
    spot = read(tmp_path, M + f'def SphereLight "Spot" {meta} {{\n{turned(-90, more=cone)}}}\n').lights["Spot"].spot
    assert np.allclose(spot.direction, (0, -1, 0))
    assert (spot.angle, spot.falloff) == (30, 2)


def test_lights_that_are_not_lit_or_have_no_place_are_not_offered(tmp_path):
    text = 'def SphereLight "Off" {\n    token visibility = "invisible"\n}\ndef DomeLight "Sky" {\n}\n'
    loaded = read(tmp_path, M + text)
    assert (loaded.lights, loaded.notes) == ({}, ("lights not offered: 1 (DomeLight)",))
