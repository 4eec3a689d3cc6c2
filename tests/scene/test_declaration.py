"""Scenes declared in a file: what is said holds, what is not said stays, what is wrong is told in one line."""

import json

import numpy as np
import pytest
from shadowbench.harness.commands.plan import frame_plan
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.materials import reflectances
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.chosen_view import ChosenView
from shadowbench.harness.scene.effects import Effects
from shadowbench.harness.scene.prepared import prepare

MESH = """v -1 -1 0
v 1 -1 0
v 1 1 0
v -1 1 0
v 0 0 1
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
f 1 3 2
f 1 4 3
"""

FULL = """
mesh = "roof.obj"
title = "A roof"
closed = true
facing = true
outputs = ["ids", "shadows"]

[camera]
eye = [0, 0.5, 4]
target = [0, 0, 0]
fov = 50
moves = true

[[lights]]
position = [0, 2.5, 3]
spot = {direction = [0, -2.5, -3], angle = 40, falloff = 2}

[[lights]]
position = [1, 3, 0.5]
directional = true
color = [1, 0.5, 0.2]

[[lights]]
position = [1, 1, 1]
shadows = false

[alpha]
every = 2
holes = 4

[mirror]
share = 0.4
bounces = 2
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "roof.obj").write_text(MESH)
    return tmp_path


def declare(folder, text, name="scene.toml"):
    path = folder / name
    path.write_text(text)
    return path


def test_everything_declared_is_in_the_scene(folder):
    scene = resolve(declare(folder, FULL))
    assert (scene.name, scene.title, scene.closed, scene.facing) == ("scene", "A roof", True, True)
    assert scene.camera.eye == (0.0, 0.5, 4.0)
    assert scene.camera_moves
    assert scene.lights[0].spot.angle == 40
    assert scene.lights[1].directional
    assert scene.lights[1].color == (1.0, 0.5, 0.2)
    effects = Effects.of(scene)
    assert effects.shadows == (True, True, False)
    assert (effects.names(), effects.bounces) == (("shadows", "receivers", "directional", "alpha", "mirror"), 2)
    prepared = prepare(scene)
    assert prepared.alpha is not None
    assert prepared.alpha.triangles.tolist() == [1, 0, 1, 0, 1, 0]
    assert prepared.mirror.sum() == 2  # the two large ones below


def test_an_orthographic_camera_is_declared_by_its_height(folder):
    camera = 'mesh = "roof.obj"\n[camera]\nkind = "orthographic"\neye = [0, 5, 0]\nup = [0, 0, 1]\nheight = 3'
    scene = resolve(declare(folder, camera))
    assert scene.camera.height == 3.0
    assert "orthographic" in Effects.of(scene).names()
    assert "orthographic" not in Effects.of(resolve(folder / "roof.obj")).names()
    with pytest.raises(UserError, match="--fov does not apply to an orthographic camera"):
        ChosenView(fov=40.0).applied(scene)


def test_what_is_not_declared_stays(folder):
    plain, declared = resolve(folder / "roof.obj"), resolve(declare(folder, 'mesh = "roof.obj"'))
    assert (declared.camera, declared.lights) == (plain.camera, plain.lights)
    assert declared.title == "roof.obj (scene.toml)"
    assert declared.source.sha256 != plain.source.sha256
    np.testing.assert_array_equal(prepare(declared).points(0)[0], prepare(plain).points(0)[0])


def test_a_scene_of_the_catalogue_can_be_declared_about(folder):
    scene = resolve(declare(folder, 'mesh = "conference"\nfacing = true'))
    assert scene.facing
    assert scene.stand_in == resolve("conference").stand_in


LIGHT = "[[lights]]\nposition = "
SPOT = f"{LIGHT}[0, 1, 0]\nspot = "
ORTHOGRAPHIC = '[camera]\nkind = "orthographic"\n'

WRONG = [
    ('mesh = ""', "add the mesh"),
    ('mesh = "rof.obj"', "rof.obj"),
    ('mesh = "scene.toml"', "refers back to this file"),
    ("mesh = ", "not valid TOML"),
    ("shadow = true", "unknown key 'shadow'"),
    ("[[lights]]\nplace = [0,0,0]", "unknown key 'place'"),
    ("[[lights]]\nshadows = true", "add its position"),
    ("[lights]\nposition = [0,0,0]", r"write \[\[lights\]\]"),
    (f"{LIGHT}[0,0]", "three numbers"),
    (f"{LIGHT}[0, nan, 0]", "must be finite"),
    (f"{LIGHT}[0, inf, 0]", "must be finite"),
    (f"{LIGHT}[0, 1e300, 0]", "outside the range of float32"),
    (f"{LIGHT}[0, 1{'0' * 400}, 0]", "must be finite"),
    (f"{LIGHT}[0, 0, 0]\ndirectional = true", "must not be zero"),
    (f"{LIGHT}[1, 1, 1]\ncolor = [-1, 0, 0]", r"lights\[0\].color must lie in 0"),
    (f"{LIGHT}[1, 1, 1]\nintensity = 1e300", "intensity must lie in"),
    (f"{SPOT}{{direction=[0,-1,0], angle=20}}\ndirectional=true", "cannot be a spot"),
    (f"{SPOT}{{direction=[0,-1,0]}}", "angle"),
    (f"{SPOT}{{direction=[0,-1,0], angle=0}}", "more than 0 and at most 180"),
    (f"{SPOT}{{direction=[0,-1,0], angle=20, falloff=-1}}", "falloff must not be negative"),
    ("facing = 1", "must be true or false, not 1"),
    ('outputs = ["colour"]', "unknown output 'colour'"),
    ("outputs = []", "give at least one of"),
    ('outputs = ["ids", "ids"]', "each once"),
    ('title = "A\\nB"', "title must be one line"),
    ('title = " "', "title must be one line"),
    (f"x = {'[' * 5000}", "not valid TOML"),
    ("[mirror]\nshare = 2", "must be greater than 0"),
    ("[mirror]\nbounces = 0.5", "must be a whole number, not 0.5"),
    ("[mirror]\nbounces = 1000000", r"must lie in 0\.\.64"),
    ("[alpha]\nholes = 1.5", "must be a whole number, not 1.5"),
    ("[alpha]\nevery = 0", r"alpha.every must lie in 1\.\.2147483647"),
    (f"[alpha]\nevery = 1{'0' * 30}", "alpha.every must lie in"),
    ("[alpha]\nholes = 1000000000", r"alpha.holes must lie in 1\.\.1048576"),
    ("[orbit]\ncentre = [0, 0, 0]\naxis = [0, 0, 0]", "orbit.axis must not be zero"),
    ("[orbit]\ncentre = [0, 0, 0]\nframes = 0", "orbit.frames must lie in"),
    ('[camera]\nfov = "wide"', "must be a number"),
    ("[camera]\nfov = 0", "must be more than 0 and less than 180"),
    (f"[camera]\nfov = {'1' * 5000}", "not valid TOML"),
    ("[camera]\neye = [nan, 0, 0]", "camera.eye must be finite"),
    ("[camera]\neye = [1e300, 0, 0]", "outside the range of float32"),
    ("[camera]\neye = [1, 0, 0]\ntarget = [1, 0, 0]", "must be finite and different"),
    ("[camera]\nheight = 2", "camera.height does not apply"),
    ('[camera]\nkind = "fisheye"', "is not one of perspective, orth"),
    (ORTHOGRAPHIC, "add its height"),
    (f"{ORTHOGRAPHIC}height = 2\nfov = 40", "camera.fov does not apply"),
    (f"{ORTHOGRAPHIC}height = 0", "height 0.0 must be finite and greater than 0"),
]


@pytest.mark.parametrize(("text", "message"), WRONG, ids=range(len(WRONG)))
def test_mistakes_are_reported_in_one_line(folder, text, message):
    text = text if text.startswith("mesh") else f'mesh = "roof.obj"\n{text}'
    with pytest.raises(UserError, match=message) as caught:
        resolve(declare(folder, text))
    assert "scene.toml" in str(caught.value) or "rof.obj" in str(caught.value)


def test_a_link_to_itself_and_a_folder_are_no_declaration(folder):
    loop = folder / "loop.toml"
    loop.symlink_to(loop)
    with pytest.raises(UserError, match="cannot read"):
        resolve(loop)
    (folder / "room.toml").mkdir()
    with pytest.raises(UserError, match="not a file"):
        resolve(folder / "room.toml")


def test_lights_on_an_orbit_move_over_frames_of_their_own(folder):
    told = 'mesh = "roof.obj"\n[[lights]]\nposition = [2, 3, 0]\n[[lights]]\nposition = [1, 1, 0]\ndirectional = true\n'
    path = declare(folder, told + "[orbit]\ncentre = [0, 1, 0]\nturns = 0.5\nframes = 3")
    prepared = prepare(resolve(path))
    assert prepared.frame_count == 3
    first, sun = prepared.lights(2)
    assert np.allclose(first.position, (-2, 3, 0))
    assert np.allclose(sun.position, (-1, 1, 0))  # the way to it turns about the axis, wherever that stands
    found = frame_plan(str(path), ["uniform_grid"], "16x16", "cpu")
    assert all("moving" in words for words in found["declared"]["lights"])


def test_a_mesh_has_one_hue_whatever_is_declared_about_it(folder):
    one = reflectances(prepare(resolve(declare(folder, 'mesh = "roof.obj"', "one.toml"))))
    other = reflectances(prepare(resolve(declare(folder, 'mesh = "roof.obj"\nfacing = true', "other.toml"))))
    assert np.array_equal(one, other)


def test_plan_takes_settings(folder):
    path = str(declare(folder, 'mesh = "roof.obj"\n[alpha]\nevery = 2'))
    (plain,) = frame_plan(path, ["warp_bvh"], "16x16", "cpu")["methods"]
    assert "warp_bvh.update=bvh_rebuild" in plain["cannot"]
    (chosen,) = frame_plan(path, ["warp_bvh"], "16x16", "cpu", settings=["warp_bvh.update=bvh_rebuild"])["methods"]
    assert not chosen["cannot"]
    assert chosen["settings"] == {"update": "bvh_rebuild"}


def test_a_declaration_can_be_declared_about_but_not_in_a_circle(folder):
    declare(folder, 'mesh = "roof.obj"\nfacing = true', "inner.toml")
    assert resolve(declare(folder, 'mesh = "inner.toml"')).facing
    declare(folder, 'mesh = "scene.toml"', "inner.toml")
    with pytest.raises(UserError, match="refers back to this file"):
        resolve(folder / "scene.toml")


def test_a_mark_before_the_text_is_passed_over(folder):
    assert resolve(declare(folder, '\ufeffmesh = "roof.obj"\nfacing = true')).facing


def test_a_declared_scene_never_takes_the_name_of_one_of_the_paper(folder):
    assert resolve(declare(folder, 'mesh = "roof.obj"', "fairy.toml")).name == "fairy-declared"
    assert resolve(declare(folder, 'mesh = "roof.obj"', "My Room.toml")).name == "my_room"


def test_plan_of_a_declared_scene(folder):
    path = str(declare(folder, FULL))
    found = frame_plan(path, ["uniform_grid", "embree"], "16x16", "cpu")
    assert found["calls_for"] == ["shadows", "receivers", "directional", "alpha", "mirror"]
    assert found["declared"]["camera"].startswith("moving, from ")
    assert found["declared"]["mirror bounces"] == 2
    grid, embree = found["methods"]
    assert "holes" in embree["cannot"] or "filter" in embree["cannot"]
    work = {step["name"]: step for step in grid["passes"]}
    assert "light 2: shadow rays" not in work
    assert work["light 0: receivers"]["after"]["light 0"]["runs"]
    assert not work["light 0: receivers"]["after"]["light 1"]["runs"]
    assert not any(step["after"]["nothing"]["runs"] for step in work.values())
    assert all(step["first"] for step in work.values())


def test_plan_command_prints_and_gives_json(folder, call, monkeypatch):
    command = ("plan", declare(folder, FULL), "--method", "uniform_grid", "--size", "16x16")
    for width in (80, 160):  # in several tables, and in one
        monkeypatch.setenv("COLUMNS", str(width))
        code, shown, _ = call(*command)
        assert code == 0
        assert max(map(len, shown.splitlines())) <= width
    assert "light 1: directional, with shadows, fixed" in shown
    assert "passes that run" in shown
    assert json.loads(call(*command, "--json")[1])["methods"][0]["method"] == "uniform_grid"


@pytest.mark.parametrize("scene", ["fairy", "sibenik"])
def test_plan_of_a_moving_and_of_a_still_scene(scene):
    """What a plan says is what a frame does: see also the partial frames of ``shadowbench check``."""
    found = frame_plan(scene, ["uniform_grid", "perspective_spherical", "ray_grids"], "32x32", "cpu")
    assert found["calls_for"] == ["shadows"]
    for method in found["methods"]:
        runs = {
            label: [step["name"] for step in method["passes"] if step["after"][label]["runs"]]
            for label in found["changes"]
        }
        assert (runs["nothing"], runs["geometry"]) == ([], [step["name"] for step in method["passes"]])
        assert all(name.startswith("light 0") for name in runs["light 0"])
        builds = [s["name"] for s in method["passes"] if s["part"] == "build" and s["after"]["camera"]["runs"]]
        assert bool(builds) == (method["method"] == "perspective_spherical")
