"""Scoring: right answers pass, every planted error is found, counted in its class and shown."""

import json
from dataclasses import replace

import numpy as np
import pytest
from helpers import exact_answers as cases
from helpers.answered_scene import (
    HEIGHT,
    WIDTH,
    AnsweredScene,
    answered_ball,
    floor_pixel,
    lattice_of_rays,
    lose,
    plant_hole,
    sky_pixel,
)
from helpers.second_judge import SecondJudge
from shadowbench.harness.judge.consistency import check_consistency
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.reference import Reference
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.scene.effects import Effects
from shadowbench.harness.scene.prepared import prepare
from shadowbench.harness.scene.scene import Camera, Light


@pytest.fixture(scope="module")
def ball() -> AnsweredScene:
    return answered_ball()


def test_right_answers_pass(ball):
    score = score_answers(ball.judge, ball.answers()).score
    assert score.check == "ok"
    assert score.true_errors == 0
    assert score.primary.ok == WIDTH * HEIGHT
    assert score.primary.judged >= 200
    assert score.primary.t_max_relative_error < 2.0**-23
    assert [light.light for light in score.shadow] == [0, 1]
    assert all(light.ok == light.scored == (ball.right["triangle"] >= 0).sum() for light in score.shadow)
    assert score.examples == ()
    assert score.truth["robust"] is True
    json.dumps(score.to_json(), allow_nan=False)


def ball_pixel(case: AnsweredScene) -> int:
    """A pixel whose neighbours all see the ball: far from its outline."""
    inner = (case.right["triangle"] > 1).reshape(HEIGHT, WIDTH)
    for axis in (0, 1):
        inner = inner & np.roll(inner, 1, axis) & np.roll(inner, -1, axis)
    return case.pixel(inner.ravel())


def plant_floor_seen_through_the_ball(case, answers):
    pixel = ball_pixel(case)
    floor = SecondJudge(case.moment.points, case.prepared.faces[:2])
    (seen,) = floor.closest(case.moment.eye[None], case.moment.directions(np.array([pixel])))
    answers["triangle"][pixel], answers["t"][pixel] = seen.ties[0], seen.t
    _, answers["u"][pixel], answers["v"][pixel] = seen.weights
    return pixel


def plant_hit_in_the_sky(case, answers):
    pixel = sky_pixel(case)
    answers["triangle"][pixel], answers["t"][pixel] = 5, 2.0
    return pixel


def plant_t(case, answers):
    pixel = ball_pixel(case)
    answers["t"][pixel] *= np.float32(1.001)
    return pixel


def plant_u(case, answers):
    pixel = floor_pixel(case)
    answers["u"][pixel] += np.float32(0.01)
    return pixel


@pytest.mark.parametrize(
    "plant", [plant_hole, plant_floor_seen_through_the_ball, plant_hit_in_the_sky, plant_t, plant_u]
)
def test_a_planted_primary_error_is_true(ball, plant):
    answers = ball.answers()
    pixel = plant(ball, answers)
    score = score_answers(ball.judge, answers).score
    assert score_answers(ball.judge, answers).score == score
    assert score.check == "failed"
    assert score.primary.true == 1
    assert score.true_errors == 1
    assert score.excused_share == 0
    assert (score.primary.t_max_relative_error > 1e-6) == (plant is plant_t)
    assert (score.primary.uv_max_error > 1e-6) == (plant is plant_u)
    (example,) = score.examples
    assert example["pixel"] == [pixel % WIDTH, pixel // WIDTH]
    assert example["kind"].startswith("true")
    # What was right there is not scored for shadows any more, everything else is.
    hits = int((ball.right["triangle"] >= 0).sum())
    lost = int(ball.right["triangle"][pixel] >= 0)
    assert [light.scored for light in score.shadow] == [hits - lost] * 2
    json.dumps(score.to_json(), allow_nan=False)


def test_an_edge_is_excused_and_counted_and_too_many_fail():
    """Rays on a lattice run exactly along the diagonal that two triangles of a square share."""
    prepared, moment = lattice_of_rays([(0, 1, 2), (0, 2, 3)])
    judge = Judge.of(prepared, moment)
    right = cases.exact_answers(prepared, moment)
    assert (right["triangle"] == 0).sum() == 45
    assert (right["triangle"] == 1).sum() == 36
    assert score_answers(judge, right).score.check == "ok"

    middle = 16 * 33 + 16
    tied = {name: value.copy() for name, value in right.items()}
    tied["triangle"][middle], tied["u"][middle], tied["v"][middle] = 1, 0.5, 0
    score = score_answers(judge, tied).score
    assert (score.primary.tie, score.primary.true, score.check) == (1, 0, "ok")

    lost = {name: value.copy() for name, value in right.items()}
    for count, (pixel, check) in enumerate(((middle, "ok"), (middle - 32, "failed")), start=1):
        lose(lost, pixel)
        score = score_answers(judge, lost).score
        assert (score.primary.edge, score.true_errors, score.check) == (count, 0, check)
        assert score.excused_share == pytest.approx(count / 33**2)
        assert score.examples[0]["kind"] == "edge"


def test_what_is_no_answer_is_invalid(ball):
    """Values that no hit has, a miss that is not filled as one, and bits that are none: each at a pixel of its own."""
    hit = [
        ("triangle", -77), ("triangle", -2), ("triangle", 10_000), ("t", np.nan), ("t", -77.0), ("t", np.inf), ("t", 0.0),
        ("u", np.nan), ("v", -np.inf),
    ]  # fmt: skip
    miss = [("t", 1.0), ("u", 0.5), ("v", np.nan)]
    answers, lit = ball.answers(), ~ball.right["shadowed"].any(axis=0)
    floor, sky = (np.nonzero((ball.right["triangle"] == k) & lit)[0] for k in (0, -1))
    for pixels, wrong in ((floor, hit), (sky, miss)):
        for pixel, (name, value) in zip(pixels, wrong, strict=False):
            answers[name][pixel] = value
    answers["shadowed"][0, floor[-1]] = 77
    answers["shadowed"][1, sky[-1]] = 1
    scored = score_answers(ball.judge, answers)
    assert scored.score.primary.invalid == 12
    assert [light.invalid for light in scored.score.shadow] == [1, 1]
    assert scored.score.check == "failed"
    invalid = {*floor[:9].tolist(), *sky[:3].tolist(), floor[-1], sky[-1]}
    assert set(np.nonzero(scored.classes == Verdict.INVALID)[0].tolist()) == invalid
    json.dumps(scored.score.to_json(), allow_nan=False)


def test_unwritten_answers_are_all_invalid(ball):
    answers = {name: np.full_like(value, -77) for name, value in ball.right.items() if name != "shadowed"}
    answers["shadowed"] = np.full_like(ball.right["shadowed"], 77)
    score = score_answers(ball.judge, answers).score
    assert score.primary.invalid == WIDTH * HEIGHT
    assert [light.invalid for light in score.shadow] == [WIDTH * HEIGHT] * 2
    assert score.check == "failed"


def test_acne_and_leaks_are_distinguished(ball):
    light = 1
    lit = ball.pixel((ball.right["triangle"] == 0) & (ball.right["shadowed"][light] == 0))
    dark = ball.pixel((ball.right["triangle"] <= 1) & (ball.right["shadowed"][light] == 1))
    answers = ball.answers()
    answers["shadowed"][light, lit] = 1
    answers["shadowed"][light, dark] = 0
    score = score_answers(ball.judge, answers).score
    assert (score.shadow[light].acne, score.shadow[light].leak) == (1, 1)
    assert score.shadow[light].disputed == 2
    assert (score.shadow[1 - light].acne, score.shadow[1 - light].leak) == (0, 0)
    assert score.true_errors == 2
    kinds = {entry["kind"]: entry for entry in score.examples}
    assert kinds["leak"]["exact"]["occluder"] > 1
    assert kinds["acne"]["exact"] == {"bit": 0, "occluder": -1}


def test_a_light_without_shadows_must_stay_zero(ball):
    judge = Judge.of(ball.prepared, ball.moment, Effects((True, False)))
    answers = ball.answers()
    answers["shadowed"][1] = 0
    assert score_answers(judge, answers).score.check == "ok"
    assert [light.light for light in score_answers(judge, answers).score.shadow] == [0]
    answers["shadowed"][1, floor_pixel(ball)] = 1
    assert score_answers(judge, answers).score.true_errors == 1


def test_a_scene_without_lights():
    base = cases.ball_on_floor()
    geometry = base.geometry()
    prepared = prepare(cases.static_scene(geometry.positions(0), geometry.faces, base.camera))
    moment = prepared.moment(0, 20, 15)
    judge = Judge.of(prepared, moment)
    answers = judge.reference.answers()
    answers["shadowed"] = np.full((1, 300), 77, dtype=np.uint8)  # the unused row of a frame without lights
    score = score_answers(judge, answers).score
    assert (score.check, score.shadow) == ("ok", ())
    assert score.primary.ok == 300


def test_the_references_own_errors_stand_apart(ball):
    """A reference that loses a pixel: the method that is right stays right, the reference gets the error."""
    pixel = floor_pixel(ball)
    reference = ball.judge.reference
    said = {name: value.copy() for name, value in reference.answers().items()}
    lose(said, pixel)
    said["shadowed"][0, ball.pixel((ball.right["triangle"] == 1) & (ball.right["shadowed"][0] == 0))] = 1
    broken = Reference(**said, provenance=reference.provenance)
    score = score_answers(replace(ball.judge, reference=broken), ball.answers()).score
    assert score.check == "ok"
    assert score.primary.disputed == 1
    assert score.reference_errors.primary.true == 1
    assert score.reference_errors.shadow[0].acne == 1
    assert score.reference_errors.shadow[1].acne == 0


def test_disputes_beyond_the_limit_count_as_errors(ball):
    answers = ball.answers()
    lose(answers, np.nonzero(ball.right["triangle"] == 0)[0][:50])
    score = score_answers(replace(ball.judge, limit=20), answers).score
    assert score.primary.unjudged == 30
    assert score.primary.true == 20
    assert score.true_errors == 50


def test_random_pixels_find_what_method_and_reference_agree_on(ball):
    """Both lose the same pixel: only the exact decision of every pixel can see it."""
    answers = ball.answers()
    pixel = plant_hole(ball, answers)
    blind = Reference(**answers, provenance=ball.judge.reference.provenance)
    judge = replace(ball.judge, reference=blind, random_pixels=WIDTH * HEIGHT)
    score = score_answers(judge, answers).score
    assert score.primary.true == 1
    assert score.examples[0]["pixel"] == [pixel % WIDTH, pixel // WIDTH]
    assert score_answers(judge.with_random_pixels(0), answers).score.primary.judged == 0


def test_duplicates_are_ties_without_being_disputed():
    base = cases.ball_on_floor()
    geometry = base.geometry()
    faces = np.concatenate([geometry.faces, geometry.faces[:, [1, 2, 0]]])
    case = AnsweredScene(cases.static_scene(geometry.positions(0), faces, base.camera, *base.lights))
    answers = case.answers()
    count = len(geometry.faces)
    moved = answers["triangle"] >= 0
    answers["triangle"][moved] += count  # u and v stay: a prepared scene lists their corners in one order
    score = score_answers(case.judge, answers).score
    assert score.primary.tie == moved.sum()
    assert score.primary.disputed <= moved.sum()
    assert score.check == "ok"


SLIVER = np.array([(-1, 0, 0), (1, 0, 0), (1, 1e-5, 0.0)])
"""Of an aspect of 2e5."""

FAR, TALL = SLIVER * 2.0**40 - (0, 0, 1), SLIVER * (1, 2**20, 1)
STEEP = np.array([(-1, 0, -2), (1, 0, 2), (1, 1, 2)]) * 2.0**50 + (0, -7, 0)
GRAZED = np.array([(-1, 0, -1e4), (1, 0, 1e4), (0, 1, 0)])
"""A hair beside its hit t is another."""


@pytest.mark.parametrize(
    ("corners", "height", "error", "wrong"),
    [
        (SLIVER, 2, 2.0**-24, False),  # what float32 rounds
        (SLIVER, 2, 1e-4, True),
        (SLIVER, 2, 1e-2, True),
        (FAR, 2, 2.0**-24, False),
        (FAR, 2, 1e-4, True),
        (TALL, 1e6, 2.0**-24, False),
        (TALL, 1e6, 1e-5, True),
        (STEEP, 2, 2.0**-24, False),
        (STEEP, 2, 1e-4, True),
        (GRAZED, 2, 1e-3, False),
        (GRAZED, 2, 1e-1, True),
    ],
)
def test_a_wrong_t_is_wrong_on_slivers_and_far_away_and_a_right_one_right(corners, height, error, wrong) -> None:
    """Of the ray through the middle of the picture, with t off by a share of itself."""
    scene = cases.static_scene(corners, [(0, 1, 2)], Camera((0, 0, height), (0, 0, -1)), Light((0, 3, 3)))
    prepared = prepare(scene)
    moment = prepared.moment(0, 1, 1)
    (seen,) = SecondJudge(moment.points, prepared.faces).closest(moment.eye[None], moment.directions(np.array([0])))
    numbers = {"t": float(seen.t) * (1 + error), "u": seen.weights[1], "v": seen.weights[2]}
    answers = {name: np.array([value], np.float32) for name, value in numbers.items()}
    answers |= {"triangle": np.zeros(1, np.int32), "shadowed": np.zeros((1, 1), np.uint8)}
    checked = check_consistency(prepared, moment, answers)
    assert checked.t_wrong[0] == wrong
    assert not checked.uv_wrong[0]
