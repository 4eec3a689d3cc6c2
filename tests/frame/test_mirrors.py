"""Mirrored rays (``effects/mirrors.py``, ``frame/geometry.py``) are right, and every method that takes part says the
same of them.
"""

import dataclasses

import numpy as np
import pytest
from helpers.method_trials import hard_trials
from helpers.mirror_scenes import (
    EXACT,
    INEXACT,
    SIZE,
    answered,
    hall_of_mirrors,
    needs_embree,
    plane_and_ball,
    with_mirrors,
)
from helpers.small_scenes import answers_in, assert_same
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.judge.answer_files import save_raw, score_raw
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.referee import Referee
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.scene.effects import Effects, Switches
from shadowbench.harness.scene.overrides import perforated
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Camera
from shadowbench.harness.scene.shared import read_stored, store


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
def test_exact_methods_agree_bit_for_bit_and_have_no_error(device):
    prepared = hall_of_mirrors()
    first = None
    for name, settings in EXACT:
        moment, answers = answered(name, settings, prepared, device)
        first = first or answers
        assert_same(answers, first)
    score = score_answers(Judge.of(prepared, moment).with_random_pixels(SIZE * SIZE), first).score
    assert score.true_errors == 0, score.examples
    assert [one.bounce for one in score.bounces] == [1, 2, 3]
    for one in score.bounces:
        assert one.rays > 100
        assert (one.rays_wrong, one.primary.judged) == (0, SIZE * SIZE)
    rays = [one.rays for one in score.bounces]
    assert rays == sorted(rays, reverse=True), "a ray that met something else does not go on"
    bits = first["bounce_shadowed"]
    for light in range(3):
        assert 5 < bits[0][light].sum() < (first["bounce_triangle"][0] >= 0).sum() - 20
    assert not bits[:, 3].any(), "a light without shadows has none in a mirror either"


@pytest.mark.slow
@pytest.mark.parametrize(("name", "settings"), EXACT)
def test_a_replay_with_every_effect_has_the_bits_of_plain_launches(name, settings, device):
    """Holes, mirrors, receivers, directional lights and colour; also the moments that come after the capture."""
    plain = hall_of_mirrors(2).scene
    prepared = prepare(
        dataclasses.replace(
            plain, alpha=lambda geometry: perforated(geometry, 2, 6), outputs=("ids", "shadows", "color")
        )
    )
    moved = (plain.lights[0].moved((0.2, -0.4, 0.1)), *plain.lights[1:2], plain.lights[2].moved((-1.0, 1.0, 0.5)))
    moments = [
        prepared.moment(0, SIZE, SIZE),
        prepared.moment(0, SIZE, SIZE, lights=(*moved, plain.lights[3])),
        prepared.moment(0, SIZE, SIZE, camera=Camera((0.1, 0.2, 0.8), (0.0, 0.0, -0.4))),
    ]
    session = Session(make_method(name, settings), prepared, SIZE, SIZE, device)
    eager = [{**session.answers(moment), "color": session.frame.color.numpy().copy()} for moment in moments]
    assert (eager[0]["color"] != eager[1]["color"]).any()
    for moment, wanted in zip(moments, eager, strict=True):
        session.load(moment)
        session.frame.color.zero_()
        session.replay()
        assert not session.overflowed()
        assert_same({**answers_in(session), "color": session.frame.color.numpy()}, wanted)


@needs_embree
@pytest.mark.parametrize(("name", "settings"), INEXACT)
def test_float32_methods_trace_the_same_rays_nearly_without_error(name, settings):
    prepared = hall_of_mirrors(2)
    moment, answers = answered(name, settings, prepared)
    score = score_answers(Judge.of(prepared, moment), answers).score
    assert score.true_errors <= 3, score.examples
    assert sum(one.rays_wrong for one in score.bounces) == 0
    assert all(one.rays > 100 for one in score.bounces)


@pytest.mark.slow
@needs_embree
@pytest.mark.parametrize(
    ("name", "plain", "width", "height"), list(hard_trials()), ids=lambda x: x if isinstance(x, str) else ""
)
def test_hard_cases_all_of_mirrors_have_no_error(name, plain, width, height):
    prepared = with_mirrors(plain, np.ones(plain.triangle_count, dtype=np.uint8), 3)
    moment = prepared.moment(0, width, height)
    first, second = (Session(make_method(*chosen), prepared, width, height, "cpu").answers(moment) for chosen in EXACT)
    assert_same(second, first)
    score = score_answers(Judge.of(prepared, moment).with_random_pixels(width * height), first).score
    assert score.true_errors == 0, score.examples


@needs_embree
def test_a_mirror_shows_holes_as_holes():
    prepared = hall_of_mirrors(2)
    scene = dataclasses.replace(prepared.scene, alpha=lambda geometry: perforated(geometry, 2, 6))
    assert Effects.of(scene).switches(0, 1) == Switches(receivers=True, alpha=True, bounced=True)
    holed = prepare(scene)
    moment, answers = answered("uniform_grid", {}, holed)
    _, other = answered("warp_bvh", {"update": "bvh_rebuild"}, holed)
    assert_same(other, answers)
    score = score_answers(Judge.of(holed, moment).with_random_pixels(SIZE * SIZE), answers).score
    assert score.true_errors == 0, score.examples
    assert score.bounces[0].rays > 100
    whole = answered("uniform_grid", {}, prepared)[1]
    reached = (whole["bounce_active"][0] == 1) & (answers["triangle"] == whole["triangle"])
    assert (answers["bounce_triangle"][0] != whole["bounce_triangle"][0])[reached].sum() > 20


def test_mirrors_are_handed_to_other_processes(tmp_path):
    prepared = hall_of_mirrors(1)
    store(tmp_path / "scene.npz", prepared, [0])
    read = read_stored(tmp_path / "scene.npz", dataclasses.replace(prepared.scene, mirror=lambda g: 1 / 0))
    np.testing.assert_array_equal(read.mirror, prepared.mirror)


@needs_embree
def test_the_score_finds_wrong_rays_hits_and_bits():
    prepared = hall_of_mirrors(2)
    moment, answers = answered("uniform_grid", {}, prepared)
    judge = Judge.of(prepared, moment)
    assert score_answers(judge, answers).score.true_errors == 0
    there = np.nonzero(answers["bounce_triangle"][0] >= 0)[0][:6]

    def changed(name, change):
        spoilt = {**answers, f"bounce_{name}": answers[f"bounce_{name}"].copy()}
        change(spoilt[f"bounce_{name}"])
        return score_answers(judge, spoilt).score.bounces

    def shift(array):
        array[0][there] += np.float32(1e-4)

    for name in ("direction", "origin"):
        assert changed(name, shift)[0].rays_wrong == 6, name
    bounces = changed("active", lambda a: a[0].__setitem__(there, 0))
    assert bounces[0].rays_wrong == 6
    assert bounces[0].primary.invalid == 6, "a hit without a ray is none"
    bounces = changed("triangle", lambda a: a[0].__setitem__(there, (a[0][there] + 7) % 40))
    assert bounces[0].primary.true + bounces[0].primary.invalid == 6
    assert bounces[1].rays_wrong > 0, "the next bounce's rays are not those of what was answered"
    bounces = changed("shadowed", lambda a: a[1][3].fill(1))
    assert bounces[1].true_errors > 0, "a bit of a light that asks for no shadows"
    lit = np.nonzero((answers["bounce_shadowed"][0][0] == 0) & (answers["bounce_triangle"][0] >= 0))[0]
    bounces = changed("shadowed", lambda a: a[0][0].__setitem__(lit, 1))
    assert bounces[0].shadow[0].acne > len(lit) / 2


@needs_embree
def test_answers_kept_for_elsewhere_are_scored_with_their_rays(tmp_path):
    prepared = hall_of_mirrors(2)
    moment, answers = answered("uniform_grid", {}, prepared)
    save_raw(tmp_path / "raw.npz", prepared, moment, answers, "test")
    score = score_raw(tmp_path / "raw.npz").score
    assert score.true_errors == 0
    assert [one.rays for one in score.bounces] == [
        one.rays for one in score_answers(Judge.of(prepared, moment), answers).score.bounces
    ]


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
