"""Scoring under a spotlight: hit points outside it have no shadow ray, whatever stands between."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import small_scenes
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.judge import score
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.receivers import not_receivers
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.runner.workers.grader import Grader, hand_over, handed_path
from shadowbench.harness.scene.effects import Effects
from shadowbench.harness.scene.overrides import Lighting

SIZE = 32


@pytest.fixture(scope="module")
def scene():
    pytest.importorskip("embreex", reason="the reference needs Embree")
    vertices, faces = small_scenes.soup(3, 60)
    prepared = small_scenes.make_scene(vertices, faces, [(1.0, 2.5, 1.5)])
    middle = tuple(float(x) for x in prepared.middle + prepared.centre)
    return Lighting("spot", target=middle, angle=12.0).applied(prepared)


@pytest.fixture(scope="module")
def judged(scene):
    moment = scene.moment(0, SIZE, SIZE)
    answers = Session(make_method("perspective_spherical"), scene, SIZE, SIZE, "cpu").answers(moment)
    judge = Judge.of(scene, moment, Effects.of(scene.scene))
    return moment, answers, judge


def test_a_method_that_keeps_to_the_spot_has_no_error_and_a_bit_outside_is_one(scene, judged):
    moment, answers, judge = judged
    outside = not_receivers(scene, moment, answers["triangle"])[0][0]
    hit = answers["triangle"] >= 0
    assert 20 < outside.sum() < hit.sum() - 20
    assert not outside[~hit].any()
    assert answers["shadowed"][0][hit & ~outside].sum() > 5
    assert score_answers(judge, answers).score.true_errors == 0
    bits = answers["shadowed"].copy()
    bits[0, np.nonzero(outside)[0][:7]] = 1
    found = score_answers(judge, {**answers, "shadowed": bits}).score
    assert (found.true_errors, found.shadow[0].acne) == (7, 7)
    free = replace(moment, spots=np.zeros((1, 12)))
    assert not np.any(not_receivers(scene, free, answers["triangle"])), "a light that is not limited"


@pytest.mark.parametrize(("beside", "excused"), [(0.0, True), (2.0**-22, True), (2.0**-17, False)])
def test_a_bit_at_the_border_of_a_spot_is_excused_on_either_side(scene, judged, beside, excused):
    """The cone is turned so that its border passes a shadowed hit by this share of the coordinates, on either side."""
    moment, answers, judge = judged
    shadowed = np.nonzero(answers["shadowed"][0])[0]
    points = moment.origins(shadowed) + answers["t"][shadowed][:, None] * moment.directions(shadowed)
    ways = points - moment.lights[0]
    row = moment.spots[0]
    farthest = (ways @ row[1:4] / np.linalg.norm(ways, axis=1)).argmin()
    pixel, way = shadowed[farthest], ways[farthest].astype(np.float64)
    angle = np.arctan2(np.linalg.norm(np.cross(row[1:4], way)), way @ row[1:4])
    step = beside * max(np.abs(moment.eye).max(), np.abs(points[farthest]).max()) / np.linalg.norm(way)
    for sign, bit in ((-1, 1), (1, 0)):  # claimed outside the cone, and left out inside
        spots = moment.spots.copy()
        spots[0, 10] = np.cos(angle + sign * step)
        moved = replace(moment, spots=spots)
        outside = not_receivers(scene, moved, answers["triangle"])[0][0]
        bits = np.where(outside, 0, answers["shadowed"])
        bits[0, pixel] = bit
        found = score_answers(Judge.of(scene, moved, judge.effects), {**answers, "shadowed": bits}).score
        assert found.true_errors == (not excused)
        assert beside == 0.0 or found.shadow[0].edge == excused


def test_the_same_answers_are_judged_once_and_others_anew(scene, judged, tmp_path, monkeypatch):
    moment, answers, _ = judged
    asked = []
    known = score_answers(Judge.of(scene, moment), answers)

    def count(judge, answers):
        asked.append(1)
        return replace(known, score=replace(known.score, true_errors=len(asked)))

    monkeypatch.setattr(score, "score_answers", count)
    grader = Grader(scene, {0: moment}, "soup", tmp_path, "cpu", {})
    other = {**answers, "shadowed": answers["shadowed"].copy()}
    other["shadowed"][0, 5] ^= 1
    found = []
    for key, given in (("a", answers), ("b", answers), ("c", other)):
        hand_over(handed_path(tmp_path, key, 0), given)
        (graded,) = grader.grade(key, False, True, tmp_path / "picture.png", "soup")
        found.append(graded["score"]["true_errors"])
    assert found == [1, 1, 2]
