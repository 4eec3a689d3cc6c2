"""The binary tree's answers: as exact as the referee's, and the same bits whatever its settings."""

import dataclasses
import functools
from typing import Any

import pytest
from helpers.drawn_examples import EXAMPLES, some
from helpers.effect_scenes import all_mirrors
from helpers.holed_scenes import SIZE as HOLED_SIZE
from helpers.holed_scenes import holed
from helpers.lattice_examples import Example, true_errors
from helpers.method_trials import assert_exact, assert_nearly, random_trial
from helpers.mirror_scenes import answered, hall_of_mirrors
from helpers.small_scenes import Answers, assert_same, make_scene, soup, trace
from helpers.tuned_trees import tuned
from hypothesis import given
from hypothesis import strategies as st
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.schedule.needed import stale
from shadowbench.harness.frame.session import Session
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import Prepared, prepare
from shadowbench.harness.scene.scene import Camera, Light

NAME = "bvh2"
SETTINGS = [
    {},
    {"builder": "lbvh", "SHARED_AREA": 0.0},
    {"builder": "hploc", "RADIUS": 8, "SHARES": 1},
    {"primary": "packet", "builder": "hploc", "RADIUS": 1, "SHARES": 4, "SHARED_AREA": 0.6},
    {"update": "refit"},
    {"update": "static", "primary": "packet"},
]
"""In capitals: constants of trees (:mod:`helpers.tuned_trees`)."""


@pytest.mark.parametrize("seed", range(6))
def test_random_scenes_have_the_exact_answers(seed, device):
    with tuned(SETTINGS[seed]) as settings:
        assert_exact(NAME, settings, *random_trial(seed + 300), device)


@some(60)
@given(EXAMPLES, st.sampled_from(SETTINGS))
def test_has_no_true_error_on_lattice_examples(example: Example, settings: dict[str, Any]) -> None:
    with tuned(settings) as chosen:
        example = dataclasses.replace(example, settings={**example.settings, NAME: chosen})
        assert true_errors(example, (NAME,)) == {}


def small_scene() -> Prepared:
    return make_scene(*soup(7, 300), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])


def test_settings_change_no_bit(device):
    prepared = small_scene()
    _, _, first = trace(NAME, SETTINGS[0], prepared, 33, 21, device)
    for settings in SETTINGS[1:]:
        with tuned(settings) as given:
            assert_same(trace(NAME, given, prepared, 33, 21, device)[2], first, str(settings))
    assert_same(trace("ray_grids", {}, prepared, 33, 21, device)[2], first)
    assert_same(trace(NAME, SETTINGS[0], prepared, 33, 21, "cpu")[2], first)


@pytest.mark.parametrize(
    "settings", [{}, {"primary": "packet"}, {"precision": "float32", "primary": "single"}], ids=str
)
def test_rays_to_a_single_light_are_the_same_in_a_launch_with_the_eyes(settings, device):
    if device == "cpu":
        pytest.skip("a CPU has no such launch")
    prepared = make_scene(*soup(7, 300), [(5.0, 4.0, 3.0)])
    answers = []
    for together in (True, False):
        with tuned({"TOGETHER": together, **settings}) as given:
            session, _, found = trace(NAME, given, prepared, 33, 21, device)
        assert (session.method._rays.joint == 0) == together
        answers.append(found)
    assert_same(*answers)
    assert answers[0]["shadowed"].any()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_float32_is_nearly_right(scale, device):
    vertices, faces = soup(21, 150, size=0.2)
    lights = [(2.0 * scale, 3.0 * scale, 4.0 * scale), (0.1 * scale, 0.0, 0.2 * scale)]
    prepared = make_scene(vertices * scale, faces, lights, (0.0, 0.5 * scale, 3.0 * scale))
    assert_nearly(NAME, {"precision": "float32"}, prepared, 41, 29, device, share=0.02)


def test_float32_has_shadows_of_a_directional_light(device):
    """Of which rays cannot start in float32: those are traced exactly."""
    sun = Light((0.2, 1.0, 0.3), directional=True)
    prepared = make_scene(*soup(21, 150, size=0.2), [sun, (2.0, 3.0, 4.0)], (0.0, 0.5, 3.0))
    assert_nearly(NAME, {"precision": "float32"}, prepared, 41, 29, device, share=0.02)
    scene = dataclasses.replace(hall_of_mirrors().scene, lights=(sun,))
    _, exact = answered(NAME, {}, prepare(scene), device)
    _, got = answered(NAME, {"precision": "float32"}, prepare(scene), device)
    for key in ("shadowed", "bounce_shadowed"):
        assert exact[key].any()
        assert (got[key] != exact[key]).mean() < 0.02


def test_packets_follow_the_number_of_triangles_for_the_image():
    prepared = make_scene(*soup(7, 100), [(5.0, 4.0, 3.0)])
    for settings, side, packets in (
        ({}, 64, True),
        ({}, 32, False),
        ({"precision": "float32"}, 32, True),
        ({"precision": "float32"}, 16, False),
        ({"primary": "packet"}, 16, True),
        ({"primary": "single"}, 64, False),
    ):
        session = Session(make_method(NAME, settings), prepared, side, side, "cpu")
        assert session.method.tracing(session.frame)[1] == packets, settings


def test_float32_says_that_it_is_inexact():
    assert make_method(NAME, {"precision": "float32"}).known_inexact
    assert not make_method(NAME).known_inexact


HOLED = [*SETTINGS, {"precision": "float32"}, {"ROOM": 1, "SHARES": 3}]


@functools.cache
def holed_and_its_answers(mirrors: bool, every: int, device: str) -> tuple[Prepared, Answers]:
    """float32 leaves every hit of a triangle with holes to float64: also behind many of them, and in a mirror."""
    scene = dataclasses.replace(holed()[0].scene, alpha=lambda geometry: perforated(geometry, every, 6))
    if mirrors:
        scene = dataclasses.replace(scene, mirror=all_mirrors, bounces=2)
    prepared = prepare(scene)
    return prepared, trace("uniform_grid", {}, prepared, *HOLED_SIZE, device)[2]


@pytest.mark.parametrize("settings", HOLED, ids=str)
@pytest.mark.parametrize(("mirrors", "every"), [(False, 1), (True, 2)])
def test_holes_are_seen_through(settings, mirrors, every, device):
    prepared, wanted = holed_and_its_answers(mirrors, every, device)
    with tuned(settings) as given:
        session, _, got = trace(NAME, given, prepared, *HOLED_SIZE, device)
    assert_same(got, wanted)
    assert session.method.counters()["primary undecided pairs"] > 100 // every


@pytest.mark.parametrize("settings", [{"update": "static"}, {"precision": "float32"}], ids=str)
def test_only_what_moved_is_traced_again(settings, device):
    """Where only the light or the camera moves; what is traced in one launch with the eye's rays is traced alone."""
    prepared, size = make_scene(*soup(7, 300), [(5.0, 4.0, 3.0)]), (33, 21)
    light = (Light((3.0, 4.0, 5.0)),)
    camera = Camera((0.2, 0.4, 3.0), prepared.scene.camera.target)
    moments = {
        "light/0": prepared.moment(0, *size, lights=light),
        "camera": prepared.moment(0, *size, lights=light, camera=camera),
    }
    session, whole = (Session(make_method(NAME, settings), prepared, *size, device) for _ in range(2))
    first = session.answers(prepared.moment(0, *size))
    for changed, moment in moments.items():
        again = [work.name for work in stale(session.all_passes, {changed})]
        assert any("primary rays" in name for name in again) == (changed == "camera"), again
        assert session.advance(moment) == {changed}
        found, wanted = session.frame.answers.to_host(), whole.answers(moment)
        assert_same(found, wanted, changed)
    assert (first["shadowed"] != wanted["shadowed"]).any()
    assert (first["triangle"] != wanted["triangle"]).any()
