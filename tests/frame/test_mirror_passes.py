"""Passes of mirrored rays: none where nothing reflects, what runs again, who takes part, and what is counted."""

import dataclasses

import numpy as np
import pytest
from helpers import small_scenes
from helpers.mirror_scenes import EXACT, INEXACT, SIZE, answered, hall_of_mirrors, plane_and_ball, with_mirrors
from helpers.small_scenes import answers_in, assert_same
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.frame import BOUNCED, Frame
from shadowbench.harness.frame.method import SimpleMethod
from shadowbench.harness.frame.registry import make_method, method_class, method_names
from shadowbench.harness.frame.session import Session
from shadowbench.harness.runner.measuring.memory import Memory, array_bytes
from shadowbench.harness.scene.effects import Effects
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import prepare, under
from shadowbench.harness.scene.scene import Camera


@pytest.mark.parametrize(("name", "settings"), EXACT + INEXACT)
def test_no_bounce_leaves_launches_memory_and_answers_as_they_were(name, settings):
    if name == "embree":
        pytest.importorskip("embreex", reason="needs Embree")
    plain = small_scenes.make_scene(*small_scenes.soup(3, 60), [(1.0, 2.5, 1.5)])
    scenes = [plain, *(with_mirrors(plain, np.ones(60, dtype=np.uint8), bounces) for bounces in (0, 2))]
    sessions = [Session(make_method(name, settings), one, SIZE, SIZE, "cpu") for one in scenes]
    launches = [[(work.name, work.reads, work.writes) for work in s.passes] for s in sessions]
    assert launches[1] == launches[0]
    assert launches[0] == [
        (work.name, work.reads, work.writes) for work in sessions[2].passes if work.effect != "mirror"
    ]
    assert len(launches[2]) == len(launches[0]) + 2 * 3, "rays, hits and shadow bits of two bounces"
    frame = sessions[1].frame
    assert frame.mirror.size == 0
    assert all(getattr(frame.answers.bounces, name).size == 0 for name in (*BOUNCED, "receivers"))
    moment = plain.moment(0, SIZE, SIZE)
    expected, got = (session.answers(moment) for session in sessions[:2])
    assert list(got) == list(expected) == ["triangle", "t", "u", "v", "shadowed"]
    assert_same(got, expected)


@pytest.mark.parametrize(
    ("name", "settings"),
    [("uniform_grid", {}), ("bvh2", {}), ("hybrid", {"shadows": "tree"}), ("hybrid", {}), ("kdtree", {}), ("warp_bvh", {})],
)  # fmt: skip
def test_a_moved_light_runs_only_its_own_shadow_rays_and_a_moved_camera_all_bounces(name, settings):
    def made():
        return Session(make_method(name, settings), prepared, SIZE, SIZE, "cpu")

    prepared = hall_of_mirrors(2)
    session = made()
    first = prepared.moment(0, SIZE, SIZE)
    session.answers(first)
    lights = list(prepared.lights(0))
    lights[0] = lights[0].moved((0.2, 0.4, 0.1))
    moment = prepared.moment(0, SIZE, SIZE, lights=tuple(lights))
    session.select({"light/0"})
    names = [work.name for work in session.passes]
    assert names == [name for work in session.all_passes for name in [work.name] if "light 0" in name]
    if name == "uniform_grid":
        assert len(names) == 7, "facing triangles; receivers and shadow rays of the eye's hits and of two bounces"
    session.passes = session.all_passes
    assert session.advance(moment) == {"light/0"}
    fresh = made().answers(moment)
    assert_same(answers_in(session), fresh)
    elsewhere = prepared.moment(0, SIZE, SIZE, camera=Camera((0.1, 0.2, 0.8), (0.0, 0.0, -0.4)))
    session.advance(prepared.moment(0, SIZE, SIZE, camera=prepared.scene.camera))
    session.advance(elsewhere)
    fresh = made().answers(elsewhere)
    assert_same(answers_in(session), fresh)


class Noted(SimpleMethod):
    """Notes what it is asked to trace: of whom, and the bounce."""

    simulates = frozenset({"shadows", "mirror"})

    def prepare(self, frame):
        self.asked = []

    def build_structure(self, frame):
        self.asked.append("build")

    def trace_primary(self, frame):
        self.asked.append("eye")

    def trace_shadow(self, frame, light):
        self.asked.append(light)

    def trace_bounce(self, frame, bounce):
        assert frame.rays(bounce).origin.shape == (SIZE * SIZE,)
        self.asked.append(("eye", bounce))

    def trace_bounce_shadow(self, frame, light, bounce):
        self.asked.append((light, bounce))


def test_a_simple_method_takes_part_by_two_functions():
    prepared = plane_and_ball(2)
    session = Session(Noted(), prepared, SIZE, SIZE, "cpu")
    assert session.method.applies(prepared.scene, "cpu") is None
    session.answers(prepared.moment(0, SIZE, SIZE))
    lights = range(len(prepared.scene.lights))
    bounces = [[("eye", b), *((light, b) for light in lights)] for b in (1, 2)]
    assert session.method.asked == ["build", "eye", *lights, *bounces[0], *bounces[1]]


def test_every_method_takes_part_or_says_why_not():
    scene = plane_and_ball().scene
    can = {name for name in method_names() if "mirror" in method_class(name).simulates}
    trees, grids = (
        {"bvh2", "driver", "embree", "hybrid", "kdtree", "two_level_bvh", "warp_bvh"},
        {"coherent_grid", "two_level_grid", "uniform_grid"},
    )
    assert can == trees | grids
    for name in method_names():
        method = make_method(name)
        reason = method.applies(scene, "cpu")
        if name in can:
            assert (reason is None) == ("cpu" in method.devices)
            assert reason is None or "runs on cuda only" in reason
        else:
            assert reason.startswith("mirror: ")
            assert "not supported" not in reason


@pytest.mark.parametrize(("name", "settings"), EXACT)
def test_tests_of_mirrored_rays_are_counted(name, settings):
    counts = []
    for bounces in (0, 1, 3):
        prepared = hall_of_mirrors(bounces)
        session = Session(make_method(name, settings), prepared, SIZE, SIZE, "cpu")
        before = session.answers(prepared.moment(0, SIZE, SIZE))
        counts.append(session.method.counters())
        assert_same(answers_in(session), before)
    assert "mirror tests" not in counts[0]
    assert 0 < counts[1]["mirror tests"] < counts[2]["mirror tests"]
    assert 0 < counts[1]["mirror shadow tests"] < counts[2]["mirror shadow tests"]
    assert counts[0]["primary tests"] == counts[2]["primary tests"]


def test_what_the_harness_gives_to_everybody_is_not_a_method_s_memory():
    plain = hall_of_mirrors(2).scene
    prepared = prepare(
        dataclasses.replace(plain, alpha=lambda geometry: perforated(geometry, 2, 6), outputs=("color",))
    )
    memory = Memory()
    memory.start()
    frame = Frame(prepared, SIZE, SIZE, len(plain.lights), "cpu", Effects.of(prepared.scene))
    held = memory.peak()
    memory.pause()
    given = array_bytes(frame, frame.answers, frame.answers.bounces, frame.alpha)
    assert held == pytest.approx(given, rel=0.02)
    assert array_bytes(frame, frame.answers) < 0.8 * held


def test_the_same_mesh_under_another_scene_has_that_scene_s_mirrors():
    prepared = plane_and_ball()
    assert prepared.mirror.sum() == 2
    other = under(prepared, dataclasses.replace(prepared.scene, mirror=None))
    assert (other.mirror.sum(), prepared.mirror.sum()) == (0, 2)


@pytest.mark.parametrize("broken", [False, True])
def test_nothing_to_hit_is_a_miss_at_every_bounce(broken):
    faces = [[0, 0, 0]] if broken else np.zeros((0, 3))
    empty = small_scenes.make_scene([[0.0, 0, 0]], faces, [(1.0, 1.0, 1.0)])
    _, answers = answered("uniform_grid", {}, with_mirrors(empty, np.ones(len(faces), dtype=np.uint8), 2))
    assert (answers["bounce_triangle"] == -1).all()
    assert np.isposinf(answers["bounce_t"]).all()
    assert not answers["bounce_shadowed"].any()


def test_mirrors_of_another_length_are_refused():
    plain = small_scenes.make_scene(*small_scenes.soup(3, 60), [(1.0, 2.5, 1.5)])
    with pytest.raises(UserError, match=r"mirrors of shape \(3,\), but there are 60 triangles"):
        Session(make_method("uniform_grid"), with_mirrors(plain, np.ones(3), 1), 4, 4, "cpu")
