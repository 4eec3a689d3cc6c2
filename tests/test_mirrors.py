"""Mirror bounces: the rays are right, every method that takes part says the same of them, and off they cost nothing."""

from __future__ import annotations

import copy
import dataclasses

import brute_force
import numpy as np
import pytest
from method_trials import DEVICES, box, hard_trials
from shadowbench.harness.alpha import perforated
from shadowbench.harness.errors import UserError
from shadowbench.harness.facts import array_bytes
from shadowbench.harness.frame import BOUNCED, Frame
from shadowbench.harness.method import SimpleMethod
from shadowbench.harness.moment import Prepared
from shadowbench.harness.raw import save_raw, score_raw
from shadowbench.harness.referee import Referee
from shadowbench.harness.registry import make_method, method_class, method_names
from shadowbench.harness.scene import Camera, Effects, Light, Spot
from shadowbench.harness.score import Judge
from shadowbench.harness.session import Session
from shadowbench.harness.share import Stored, store
from shadowbench.harness.specialise import Switches
from shadowbench.harness.timing import Memory
from shadowbench.harness.truth import embree_installed

SIZE = 24
EXACT = [("uniform_grid", {}), ("bvh", {"update": "bvh_rebuild"})]
INEXACT = [("bvh", {"update": "rebuild"}), ("bvh", {"update": "refit"}), ("embree", {})]

needs_embree = pytest.mark.skipif(not embree_installed(), reason="truth needs Embree")


def with_mirrors(prepared: Prepared, mirror: np.ndarray, bounces: int, **changes) -> Prepared:
    """The scene with mirrors: ``mirror`` [triangles] is 1 where a triangle is one."""
    scene = dataclasses.replace(prepared.scene, mirror=lambda g: mirror, bounces=bounces, **changes)
    return Prepared(scene)


def ball(centre, radius: float, rings: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of 4 rings^2 triangles or so, its corners nowhere special."""
    u, v = np.meshgrid(np.linspace(0, np.pi, rings), np.linspace(0, 2 * np.pi, 2 * rings) + 0.1)
    vertices = np.stack([np.sin(u) * np.cos(v), np.cos(u), np.sin(u) * np.sin(v)], -1).reshape(-1, 3)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return vertices * radius + centre, faces


def plane_and_ball(bounces: int = 1) -> Prepared:
    """A mirror in the plane z = 0 that a camera looks down on, and a ball beside the camera that only it shows."""
    vertices, faces = ball((0.4, 0.3, 3.6), 0.7)
    ground = np.array([[-4.0, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]])
    prepared = brute_force.make_scene(
        np.concatenate([ground, vertices]),
        np.concatenate([[[0, 1, 2], [0, 2, 3]], faces + 4]),
        [(3.0, 2.0, 5.0)],
        eye=(-1.0, -0.5, 2.0),
        target=(-0.3, -0.1, 0.0),
    )
    return with_mirrors(prepared, (np.arange(len(faces) + 2) < 2).astype(np.uint8), bounces)


def hall_of_mirrors(bounces: int = 3) -> Prepared:
    """A box of mirrors seen from within, with triangles floating in it that are none; lights of every kind."""
    walls, sides = box(3)
    vertices, faces = brute_force.soup(5, 40, size=0.15, spread=0.6)
    lights = [
        Light((0.3, 0.5, 0.4)),
        Light((-0.4, 0.6, 0.2), spot=Spot((0.2, -1.0, 0.1), 50.0)),
        Light((1.0, 2.0, 0.5), directional=True),
        Light((0.1, 0.1, 0.7), shadows=False),
    ]
    prepared = brute_force.make_scene(
        np.concatenate([walls, vertices]),
        np.concatenate([sides, faces + len(walls)]),
        lights,
        eye=(0.21, 0.13, 0.83),
        target=(-0.1, 0.05, -0.3),
        fov=70.0,
    )
    mirror = (np.arange(len(sides) + len(faces)) < len(sides)).astype(np.uint8)
    return with_mirrors(prepared, mirror, bounces, facing=True)


def answered(name, settings, prepared, device="cpu", size=SIZE):
    moment = prepared.moment(0, size, size)
    return moment, Session(make_method(name, settings), prepared, size, size, device).answers(moment)


@pytest.mark.parametrize("device", DEVICES)
def test_a_mirrored_hit_is_what_the_mirrored_eye_sees(device):
    prepared = plane_and_ball()
    size = 48
    moment, answers = answered("uniform_grid", {}, prepared, device, size)
    on_mirror = (answers["triangle"] >= 0) & (answers["triangle"] < 2)
    np.testing.assert_array_equal(answers["bounce_active"][0], on_mirror)
    pixels = np.nonzero(on_mirror)[0]
    assert len(pixels) > size * size / 2
    turned = np.array([1.0, 1.0, -1.0], dtype=np.float32)
    without = moment.valid.copy()
    without[:2] = 0
    seen = Referee(moment.points, prepared.faces, without).closest(
        moment.eye * turned, moment.directions(pixels) * turned
    )
    got, t = answers["bounce_triangle"][0][pixels], answers["bounce_t"][0][pixels]
    same = got == seen.triangle
    assert (got >= 0).sum() > 60
    assert (~same).sum() <= 0.01 * len(pixels), "only rays at an edge may differ"
    hit = same & (got >= 0)
    np.testing.assert_allclose((answers["t"][pixels] + t)[hit], seen.t[hit], rtol=1e-5)
    np.testing.assert_array_equal(np.isinf(t), got < 0)


@needs_embree
@pytest.mark.parametrize("device", DEVICES)
def test_exact_methods_agree_bit_for_bit_and_have_no_error(device):
    prepared = hall_of_mirrors()
    first = None
    for name, settings in EXACT:
        moment, answers = answered(name, settings, prepared, device)
        first = first or answers
        for key in first:
            np.testing.assert_array_equal(answers[key], first[key], key)
    score = Judge(prepared, moment).score(first, extra_pixels=SIZE * SIZE)
    assert score["true_errors"] == 0, score["examples"]
    assert [one["bounce"] for one in score["bounces"]] == [1, 2, 3]
    for one in score["bounces"]:
        assert one["rays"] > 100
        assert one["rays_wrong"] == 0
        assert one["primary"]["judged"] == SIZE * SIZE
    rays = [one["rays"] for one in score["bounces"]]
    assert rays == sorted(rays, reverse=True), "a ray that met something else does not go on"
    bits = first["bounce_visibility"]
    for light in range(3):
        assert 5 < bits[0][light].sum() < (first["bounce_triangle"][0] >= 0).sum() - 20
    assert not bits[:, 3].any(), "a light without shadows has none in a mirror either"


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("name", "settings"), EXACT)
def test_a_replay_with_every_effect_has_the_bits_of_plain_launches(name, settings, device):
    """Holes, mirrors, receivers, directional lights and colour; also the moments that come after the capture."""
    plain = hall_of_mirrors(2).scene
    prepared = Prepared(
        dataclasses.replace(
            plain, alpha=lambda geometry: perforated(geometry, 2, 6), outputs=("ids", "shadows", "color")
        )
    )
    moved = (
        plain.lights[0].moved((0.2, -0.4, 0.1)),
        *plain.lights[1:2],
        plain.lights[2].moved((-1.0, 1.0, 0.5)),
    )
    moments = [
        prepared.moment(0, SIZE, SIZE),
        prepared.moment(0, SIZE, SIZE, lights=(*moved, plain.lights[3])),
        prepared.moment(0, SIZE, SIZE, camera=Camera((0.1, 0.2, 0.8), (0.0, 0.0, -0.4))),
    ]
    session = Session(make_method(name, settings), prepared, SIZE, SIZE, device)
    eager = []
    for moment in moments:
        answers = session.answers(moment)
        eager.append({**answers, "color": session.frame.color.numpy().copy()})
    assert (eager[0]["color"] != eager[1]["color"]).any()
    for moment, wanted in zip(moments, eager, strict=True):
        session.load(moment)
        session.frame.color.zero_()
        session.replay()
        assert not session.overflowed()
        for key, values in session.frame.answers.to_host().items():
            np.testing.assert_array_equal(values, wanted[key], key)
        np.testing.assert_array_equal(session.frame.color.numpy(), wanted["color"])


@needs_embree
@pytest.mark.parametrize(("name", "settings"), INEXACT)
def test_float32_methods_trace_the_same_rays_nearly_without_error(name, settings):
    prepared = hall_of_mirrors(2)
    moment, answers = answered(name, settings, prepared)
    score = Judge(prepared, moment).score(answers)
    assert score["true_errors"] <= 3, score["examples"]
    assert sum(one["rays_wrong"] for one in score["bounces"]) == 0
    assert all(one["rays"] > 100 for one in score["bounces"])


@needs_embree
@pytest.mark.parametrize("seed", range(3))
def test_mirrors_of_any_shape_have_no_error(seed):
    vertices, faces = brute_force.soup(seed, 60, size=0.5)
    random = np.random.default_rng(seed)
    prepared = with_mirrors(
        brute_force.make_scene(vertices, faces, [(1.0, 2.5, 1.5)]),
        random.integers(0, 2, len(faces)).astype(np.uint8),
        2,
    )
    moment, answers = answered("uniform_grid", {}, prepared)
    score = Judge(prepared, moment).score(answers, extra_pixels=SIZE * SIZE)
    assert score["true_errors"] == 0, score["examples"]
    assert score["bounces"][0]["rays"] > 20
    other = answered("bvh", {"update": "bvh_rebuild"}, prepared)[1]
    for key in answers:
        np.testing.assert_array_equal(answers[key], other[key], key)


@needs_embree
@pytest.mark.parametrize(
    ("name", "plain", "width", "height"), list(hard_trials()), ids=lambda x: x if isinstance(x, str) else ""
)
def test_hard_cases_all_of_mirrors_have_no_error(name, plain, width, height):
    prepared = with_mirrors(plain, np.ones(plain.triangle_count, dtype=np.uint8), 3)
    moment = prepared.moment(0, width, height)
    first, second = (
        Session(make_method(*chosen), prepared, width, height, "cpu").answers(moment) for chosen in EXACT
    )
    for key in first:
        np.testing.assert_array_equal(first[key], second[key], key)
    score = Judge(prepared, moment).score(first, extra_pixels=width * height)
    assert score["true_errors"] == 0, score["examples"]


@needs_embree
def test_a_mirror_shows_holes_as_holes():
    prepared = hall_of_mirrors(2)
    scene = dataclasses.replace(prepared.scene, alpha=lambda geometry: perforated(geometry, 2, 6))
    assert Effects.of(scene).switches(0, 1) == Switches(masked=True, alpha=True, bounced=True)
    holed = Prepared(scene)
    moment, answers = answered("uniform_grid", {}, holed)
    _, other = answered("bvh", {"update": "bvh_rebuild"}, holed)
    for key in answers:
        np.testing.assert_array_equal(answers[key], other[key], key)
    score = Judge(holed, moment).score(answers, extra_pixels=SIZE * SIZE)
    assert score["true_errors"] == 0, score["examples"]
    assert score["bounces"][0]["rays"] > 100
    whole = answered("uniform_grid", {}, prepared)[1]
    reached = (whole["bounce_active"][0] == 1) & (answers["triangle"] == whole["triangle"])
    assert (answers["bounce_triangle"][0] != whole["bounce_triangle"][0])[reached].sum() > 20


def test_mirrors_are_handed_to_other_processes(tmp_path):
    prepared = hall_of_mirrors(1)
    store(tmp_path / "scene.npz", prepared, [0])
    read = Stored(tmp_path / "scene.npz", dataclasses.replace(prepared.scene, mirror=lambda g: 1 / 0))
    np.testing.assert_array_equal(read.mirror, prepared.mirror)


@needs_embree
def test_the_score_finds_wrong_rays_hits_and_bits():
    prepared = hall_of_mirrors(2)
    moment, answers = answered("uniform_grid", {}, prepared)
    judge = Judge(prepared, moment)
    assert judge.score(answers)["true_errors"] == 0
    there = np.nonzero(answers["bounce_triangle"][0] >= 0)[0][:6]

    def changed(name, change):
        spoilt = {**answers, f"bounce_{name}": answers[f"bounce_{name}"].copy()}
        change(spoilt[f"bounce_{name}"])
        return judge.score(spoilt)["bounces"]

    def shift(array):
        array[0][there] += np.float32(1e-4)

    for name in ("direction", "origin"):
        assert changed(name, shift)[0]["rays_wrong"] == 6, name
    bounces = changed("active", lambda a: a[0].__setitem__(there, 0))
    assert bounces[0]["rays_wrong"] == 6
    assert bounces[0]["primary"]["invalid"] == 6, "a hit without a ray is none"
    bounces = changed("triangle", lambda a: a[0].__setitem__(there, (a[0][there] + 7) % 40))
    assert bounces[0]["primary"]["true"] + bounces[0]["primary"]["invalid"] == 6
    assert bounces[1]["rays_wrong"] > 0, "the next bounce's rays are not those of what was answered"
    bounces = changed("visibility", lambda a: a[1][3].fill(1))
    assert bounces[1]["true_errors"] > 0, "a bit of a light that asks for no shadows"
    lit = np.nonzero((answers["bounce_visibility"][0][0] == 0) & (answers["bounce_triangle"][0] >= 0))[0]
    bounces = changed("visibility", lambda a: a[0][0].__setitem__(lit, 1))
    assert bounces[0]["shadow"][0]["acne"] > len(lit) / 2


@needs_embree
def test_answers_kept_for_elsewhere_are_scored_with_their_rays(tmp_path):
    prepared = hall_of_mirrors(2)
    moment, answers = answered("uniform_grid", {}, prepared)
    save_raw(tmp_path / "raw.npz", prepared, moment, answers, "test")
    score = score_raw(tmp_path / "raw.npz")
    assert score["true_errors"] == 0
    assert [one["rays"] for one in score["bounces"]] == [
        one["rays"] for one in Judge(prepared, moment).score(answers)["bounces"]
    ]


@pytest.mark.parametrize(("name", "settings"), EXACT + INEXACT)
def test_without_mirrors_a_bounce_changes_no_bit(name, settings):
    if name == "embree":
        pytest.importorskip("embreex", reason="needs Embree")
    plain = brute_force.make_scene(*brute_force.soup(3, 60), [(1.0, 2.5, 1.5)])
    _, expected = answered(name, settings, plain)
    _, answers = answered(name, settings, with_mirrors(plain, np.zeros(60, dtype=np.uint8), 1))
    for key in expected:
        np.testing.assert_array_equal(answers[key], expected[key], key)
    assert not answers["bounce_active"].any()
    assert (answers["bounce_triangle"] == -1).all()
    assert np.isposinf(answers["bounce_t"]).all()
    assert not answers["bounce_visibility"].any()


@pytest.mark.parametrize(("name", "settings"), EXACT + INEXACT)
def test_no_bounce_leaves_launches_memory_and_answers_as_they_were(name, settings):
    if name == "embree":
        pytest.importorskip("embreex", reason="needs Embree")
    plain = brute_force.make_scene(*brute_force.soup(3, 60), [(1.0, 2.5, 1.5)])
    sessions = [
        Session(make_method(name, settings), one, SIZE, SIZE, "cpu")
        for one in (
            plain,
            with_mirrors(plain, np.ones(60, dtype=np.uint8), 0),
            with_mirrors(plain, np.ones(60, dtype=np.uint8), 2),
        )
    ]
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
    assert list(got) == list(expected) == ["triangle", "t", "u", "v", "visibility"]
    for key in expected:
        np.testing.assert_array_equal(got[key], expected[key], key)


def test_a_moved_light_runs_only_its_own_shadow_rays_and_a_moved_camera_all_bounces():
    prepared = hall_of_mirrors(2)
    session = Session(make_method("uniform_grid"), prepared, SIZE, SIZE, "cpu")
    first = prepared.moment(0, SIZE, SIZE)
    session.answers(first)
    lights = list(prepared.lights(0))
    lights[0] = lights[0].moved((0.2, 0.4, 0.1))
    moment = prepared.moment(0, SIZE, SIZE, lights=tuple(lights))
    session.select({"light/0"})
    names = [work.name for work in session.passes]
    assert names == [name for work in session.all_passes for name in [work.name] if "light 0" in name]
    assert len(names) == 6, "receivers and shadow rays of the eye's hits and of two bounces"
    session.passes = session.all_passes
    assert session.advance(moment) == {"light/0"}
    fresh = Session(make_method("uniform_grid"), prepared, SIZE, SIZE, "cpu").answers(moment)
    for key, value in session.frame.answers.to_host().items():
        np.testing.assert_array_equal(value, fresh[key], key)
    elsewhere = prepared.moment(0, SIZE, SIZE, camera=Camera((0.1, 0.2, 0.8), (0.0, 0.0, -0.4)))
    session.advance(prepared.moment(0, SIZE, SIZE, camera=prepared.scene.camera))
    session.advance(elsewhere)
    fresh = Session(make_method("uniform_grid"), prepared, SIZE, SIZE, "cpu").answers(elsewhere)
    for key, value in session.frame.answers.to_host().items():
        np.testing.assert_array_equal(value, fresh[key], key)


class ByTheReferee(SimpleMethod):
    """Asks the exact referee: what an author of a simple method writes for mirrors."""

    name = "by_the_referee"
    title = "By the referee"
    simulates = frozenset({"shadows", "mirror"})
    capturable = False

    def build_structure(self, frame):
        host = frame.host
        self.referee = Referee(host.points, frame.prepared.faces, host.valid)

    def _closest(self, frame, bounce, origins, directions):
        hits = self.referee.closest(origins, directions)
        triangle, t, u, v = frame.hits(bounce)
        triangle.assign(hits.triangle)
        t.assign(hits.t.astype(np.float32))
        u.zero_()
        v.zero_()
        return hits

    def trace_primary(self, frame):
        host = frame.host
        self.hits = {0: self._closest(frame, 0, host.eye, host.directions(np.arange(frame.pixels)))}

    def trace_shadow(self, frame, light):
        frame.bits(0)[light].assign(self.referee.occluded(self.hits[0], frame.host.lights[light]))

    def trace_bounce(self, frame, bounce):
        origins, directions, active = (array.numpy() for array in frame.rays(bounce))
        away = np.where(active[:, None] == 1, origins, np.float32(1e6))
        self.hits[bounce] = self._closest(
            frame, bounce, away, np.where(active[:, None] == 1, directions, np.float32(1.0))
        )

    def trace_bounce_shadow(self, frame, light, bounce):
        bits = self.referee.occluded(self.hits[bounce], frame.host.lights[light])
        frame.bits(bounce)[light].assign(bits)


def test_a_simple_method_takes_part_by_two_functions():
    prepared = plane_and_ball(2)
    moment = prepared.moment(0, SIZE, SIZE)
    assert ByTheReferee().applies(prepared.scene, "cpu") is None
    given = Session(ByTheReferee(), prepared, SIZE, SIZE, "cpu").answers(moment)
    _, expected = answered("uniform_grid", {}, prepared)
    for name in ("active", "origin", "direction", "triangle", "visibility"):
        np.testing.assert_array_equal(given[f"bounce_{name}"], expected[f"bounce_{name}"], name)
    assert (given["bounce_triangle"][0] >= 0).sum() > 10


def test_every_method_takes_part_or_says_why_not():
    scene = plane_and_ball().scene
    can = {name for name in method_names() if "mirror" in method_class(name).simulates}
    assert can == {"uniform_grid", "bvh", "embree"}
    for name in method_names():
        reason = make_method(name).applies(scene, "cpu")
        if name in can:
            assert reason is None
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
        for key, value in session.frame.answers.to_host().items():
            np.testing.assert_array_equal(value, before[key], key)
    assert "mirror tests" not in counts[0]
    assert 0 < counts[1]["mirror tests"] < counts[2]["mirror tests"]
    assert 0 < counts[1]["mirror shadow tests"] < counts[2]["mirror shadow tests"]
    assert counts[0]["primary tests"] == counts[2]["primary tests"]


def test_what_the_harness_gives_to_everybody_is_not_a_method_s_memory():
    plain = hall_of_mirrors(2).scene
    prepared = Prepared(
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


def test_a_copy_under_another_scene_has_that_scene_s_mirrors():
    prepared = plane_and_ball()
    assert prepared.mirror.sum() == 2
    other = copy.copy(prepared)
    other.scene = dataclasses.replace(prepared.scene, mirror=None)
    assert other.mirror.sum() == 0
    assert prepared.mirror.sum() == 2


@pytest.mark.parametrize("broken", [False, True])
def test_nothing_to_hit_is_a_miss_at_every_bounce(broken):
    faces = [[0, 0, 0]] if broken else np.zeros((0, 3))
    empty = brute_force.make_scene([[0.0, 0, 0]], faces, [(1.0, 1.0, 1.0)])
    _, answers = answered("uniform_grid", {}, with_mirrors(empty, np.ones(len(faces), dtype=np.uint8), 2))
    assert (answers["bounce_triangle"] == -1).all()
    assert np.isposinf(answers["bounce_t"]).all()
    assert not answers["bounce_visibility"].any()


def test_mirrors_of_another_length_are_refused():
    plain = brute_force.make_scene(*brute_force.soup(3, 60), [(1.0, 2.5, 1.5)])
    with pytest.raises(UserError, match=r"mirrors of shape \(3,\), but there are 60 triangles"):
        Session(make_method("uniform_grid"), with_mirrors(plain, np.ones(3), 1), 4, 4, "cpu")


def test_a_mirrored_ray_starts_strictly_on_its_own_side():
    prepared = hall_of_mirrors(3)
    moment, answers = answered("uniform_grid", {}, prepared)
    before = moment.eye.astype(np.float64) + np.zeros((SIZE * SIZE, 3))
    triangle = answers["triangle"]
    for k in range(3):
        rows = np.nonzero(answers["bounce_active"][k])[0]
        a, b, c = (moment.points[prepared.faces[triangle[rows], i]].astype(np.float64) for i in range(3))
        n = np.cross(b - a, c - a)
        start = answers["bounce_origin"][k].astype(np.float64)
        came, now = (np.einsum("ij,ij->i", n, p[rows] - a) for p in (before, start))
        assert (came * now > 0).all()
        assert (np.abs(now) < 1e-5).all()
        assert not (answers["bounce_triangle"][k][rows] == triangle[rows]).any(), "walls are flat"
        before, triangle = start, answers["bounce_triangle"][k]
