"""Targets of lights with an area: where they are, what a picture makes of them, and that a point light has none of it."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.tiny_runs import TETRAHEDRON
from shadowbench.harness.commands.options import view_of
from shadowbench.harness.commands.plan import frame_plan
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame import session
from shadowbench.harness.frame.effects.shading import shaded
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.case import CASES, view
from shadowbench.harness.hardcases.judge import Judged, judge_case
from shadowbench.harness.hardcases.light_places import area
from shadowbench.harness.hardcases.shapes import ball, joined, plane
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.effects import Effects, Limits
from shadowbench.harness.scene.facts import light_facts
from shadowbench.harness.scene.overrides import Lighting
from shadowbench.harness.scene.prepared import under
from shadowbench.harness.scene.scene import SHAPES, Light
from shadowbench.harness.scene.targets import target_places, targets_of, with_area


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "mesh.obj"
    path.write_text(TETRAHEDRON)
    return path


MIDDLE, UP = np.array([0.0, 0.0, -3.0]), (0.0, 1.0, 0.0)


@pytest.mark.parametrize("shape", SHAPES)
def test_targets_are_spread_evenly_over_the_area(shape):
    size = (4.0, 1.0) if shape == "rectangle" else 2.0
    light = Light((1.0, 2.0, 3.0), shape=shape, size=size, samples=256, towards=(0.0, 0.0, 1.0))
    places = np.array(target_places(light, 0, MIDDLE, UP)) - light.position
    width, _height = light.extent
    np.testing.assert_allclose(places.mean(axis=0), 0.0, atol=0.01 * width)
    if shape == "rectangle":
        assert np.ptp(places[:, 0]) == pytest.approx(4.0, rel=0.02)
        assert np.ptp(places[:, 1]) == pytest.approx(1.0, rel=0.02)
        assert not places[:, 2].any()
    elif shape == "disc":
        radii = np.hypot(places[:, 0], places[:, 1])
        assert not places[:, 2].any()
        assert radii.max() <= 1.0
        assert np.mean(radii < 0.5**0.5) == pytest.approx(0.5, abs=0.01)
    else:
        np.testing.assert_allclose(np.linalg.norm(places, axis=1), 1.0)
        assert np.mean(np.abs(places) < 0.5, axis=0) == pytest.approx([0.5] * 3, abs=0.03)
    fewer = target_places(replace(light, samples=5), 0, MIDDLE, UP)
    assert fewer == target_places(light, 0, MIDDLE, UP)[:5], "a larger number adds targets to the same ones"
    assert fewer != target_places(replace(light, samples=5), 1, MIDDLE, UP), "another light has others"
    assert target_places(replace(light, samples=1), 0, MIDDLE, UP) == [light.position]


def test_an_area_faces_the_middle_unless_it_says_otherwise():
    light = Light((3.0, 0.0, -3.0), shape="disc", size=1.0, samples=8)
    places = np.array([one.position for one in targets_of((light,), MIDDLE, UP)])
    assert not np.ptp(places[:, 0])
    assert np.ptp(places[:, 1]) > 0.5
    for at in (MIDDLE, MIDDLE + UP):  # no direction, and one along up
        found = target_places(light.moved(tuple(at)), 0, MIDDLE, UP)
        assert np.isfinite(found).all()
        assert not np.ptp(np.array(found)[:, 1])


def test_a_picture_shows_the_mean_of_the_targets():
    """What the frame with a light of four targets shows is the mean of four frames with a point light at each of them."""
    mesh = joined(ball(0.75, (0, 0, 0)), plane(2, -1, 4))
    lamp = area("disc", 1.5, at=(0.5, 0.75, 3.0))
    other = Light((-2.0, 0.5, 2.0), intensity=0.5)

    def colors(lights):
        trial = view(mesh, lights, (0, 0, -5), (0, 0, 1), 0.75, (16, 16))
        answers = Session(make_method("bvh2"), trial.prepared, 16, 16, "cpu").answers(trial.moment)
        return shaded(trial.prepared, trial.moment, answers, trial.prepared.scene.lights)(0, 256), answers["shadowed"]

    soft, bits = colors([lamp, other])
    single = [colors([Light(place), other]) for place in target_places(lamp, 0, MIDDLE, UP)]
    np.testing.assert_allclose(soft, np.mean([color for color, _ in single], axis=0), rtol=1e-6)
    np.testing.assert_array_equal(bits[:4], [own[0] for _, own in single])
    assert (np.ptp(bits[:4].astype(int), axis=0) == 1).any(), "there is a penumbra"


def test_a_point_light_is_as_it_was():
    light = Light((1.0, 2.0, 3.0), color=(1.0, 0.5, 0.2), intensity=3.0)
    assert targets_of((light,), MIDDLE, UP) == (light,)
    assert set(light_facts(light)) == {"position", "shadows", "color", "intensity", "spot", "directional"}
    assert "samples" not in Lighting("1 light", count=1).facts()
    assert light_facts(with_area(light, None, 0.5, 4))["samples"] == 4


def test_lightings_and_moved_lights_of_experiments():
    trial = view(ball(1.0, (0, 0, 0)), [Light((0.0, 1.0, 0.0), directional=True)], (0, 0, -5), (0, 0, 1), 0.5)
    lighting = Lighting("4 targets", size=0.25, samples=4, moved="light")
    assert Lighting.read(lighting.facts()) == lighting
    assert (lighting.targets, replace(lighting, count=3).targets, Lighting("3 lights", count=3).targets) == (4, 12, 3)
    assert lighting.changed == {f"light/{i}" for i in range(4)}
    prepared = lighting.applied(trial.prepared)
    (lamp,) = prepared.scene.lights
    assert (lamp.shape, lamp.samples, lamp.size) == ("sphere", 4, 0.25 * prepared.radius)
    assert len(prepared.moment(0, 4, 4).lights) == len(Effects.of(prepared.scene).shadows) == 4
    lit = under(prepared, replace(prepared.scene, lights=(lamp, Light((5.0, 0.0, 0.0)))))
    assert len(lit.moment(0, 4, 4).lights) == 5


@pytest.mark.parametrize(("declared", "said"), [
    ('shape = "cube"', "lights[0]: shape 'cube': it is one of rectangle, disc, sphere"),
    ('shape = "disc"\nsize = -1', "lights[0]: size -1.0: it must be finite and not negative"),
    ('shape = "disc"\nsize = [1, 2]', "lights[0]: size (1.0, 2.0): give one number, or width and height of a"),
    ('shape = "rectangle"\nsize = [1, 2, 3]', "give one number, or width and height"),
    ('shape = "rectangle"\nsize = [1, nan]', "lights[0].size must be finite, not nan"),
    ('shape = "sphere"\nsamples = 0', "lights[0]: samples 0: give 1 to 1024"),
    ('shape = "sphere"\nsamples = 2.5', "lights[0].samples must be a whole number, not 2.5"),
    ('shape = "sphere"\nsamples = "3"', "lights[0].samples must be a whole number, not '3'"),
    ("samples = 4", "lights[0]: an area needs a shape: rectangle, disc, sphere"),
    ('shape = "sphere"\ndirectional = true', "a directional light cannot have an area: it stands nowhere"),
    ("shape = 7", "lights[0]: shape 7: it is one of"),
    ('shape = "disc"\ntowards = 1', "lights[0].towards must be three numbers"),
    ('shape = "disc"\nsize = "wide"', "lights[0].size must be a number"),
    ('shape = "disc"\nsize = 1e39', "lights[0].size (1e+39, 1e+39, 0.0) is outside the range of float32"),
])  # fmt: skip
def test_a_wrong_area_is_one_line(mesh, declared, said):
    room = mesh.with_name("room.toml")
    room.write_text(f'mesh = "mesh.obj"\n[[lights]]\nposition = [0, 1, 0]\n{declared}\n')
    with pytest.raises(UserError) as error:
        resolve(room)
    assert said in str(error.value)


@pytest.mark.parametrize(
    "given", [{"light_samples": 0}, {"light_size": float("nan")}, {"light_size": 1e39}, {"light_shape": "cube"}]
)
def test_a_wrong_area_on_the_command_line_is_refused_at_once(given):
    with pytest.raises(UserError, match="--light-size, --light-samples, --light-shape: "):
        view_of(**{"light_size": 1.0, **given})


def test_plan_tells_lights_and_targets_apart(mesh):
    room = mesh.with_name("room.toml")
    room.write_text(
        'mesh = "mesh.obj"\n[[lights]]\nposition = [0, 1, 0]\nshape = "rectangle"\nsize = [1, 0.5]\nsamples = 3\n'
        "[[lights]]\nposition = [1, 1, 0]\n"
    )
    found = frame_plan(str(room), ["uniform_grid"], "8x8", "cpu")
    assert found["declared"]["lights"] == [
        "area, with shadows, fixed, at 0,1,0, rectangle of 1 x 0.5 with 3 targets, passes of light 0 to 2",
        "point, with shadows, fixed, at 1,1,0, passes of light 3",
    ]
    assert found["changes"]["light 0"] == ["light/0", "light/1", "light/2"]
    assert found["changes"]["light 1"] == ["light/3"]
    with pytest.raises(UserError, match="is a point; give its --light-size"):
        frame_plan("cloth", ["bvh2"], "8x8", "cpu", view=view_of(light_samples=4))


@pytest.mark.parametrize("name", ["bvh2", "ray_grids", "uniform_grid"])
def test_methods_take_many_targets(name):
    """The two cases that are too long for every method: 256 targets, and 64 lights."""
    for case in CASES["light_places"]:
        if case.large and case.name.startswith("A"):
            finding = judge_case(Judged(case, case.make()), make_method(name), "cpu")
            assert (finding.status, dict(finding.classes)) == ("ok", {}), case.title


def test_more_targets_than_fit_are_refused_with_the_number_that_fits(mesh, monkeypatch):
    """128 of them at 512 squared, with 16 MiB."""
    monkeypatch.setattr(session, "Limits", lambda: Limits(memory=16 << 20))
    wide = view_of(light_size=1.0, light_samples=128)
    (found,) = frame_plan(str(mesh), ["uniform_grid"], "512x512", "cpu", view=wide)["methods"]
    said = "rejected: the shadow bits of 128 targets need 33,554,432 bytes; the limit is 16,777,216, enough for 64"
    assert found["cannot"] == f"{said}; 64 targets of a light fit, of 128"


def test_plan_states_the_memory_of_shadow_bits(mesh):
    def memory(targets: int) -> int:
        view = view_of(light_size=1.0, light_samples=targets)
        return frame_plan(str(mesh), ["uniform_grid"], "64x64", "cpu", view=view)["methods"][0]["memory"]["frame"]

    assert 64 * 64 * 64 <= memory(65) - memory(1) <= 64 * 64 * 64 + 64 * 200
