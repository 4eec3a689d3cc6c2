"""Disputes of others: what a reference gets wrong is charged to every method that says the same."""

import copy
import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from helpers import exact_answers as cases
from helpers.answered_scene import WIDTH, lattice_of_rays, lose
from helpers.wrong_reference import WrongReference
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases import find_case
from shadowbench.harness.hardcases.judge import ERROR_NAMES, Judged
from shadowbench.harness.judge import context
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.reference import Reference, embree_installed
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.judge.shared_errors import share_errors
from shadowbench.harness.judge.verdict import Shared

pytestmark = pytest.mark.skipif(not embree_installed(), reason="an exact reference has no errors to share")


@pytest.fixture(scope="module")
def ball() -> WrongReference:
    return WrongReference()


def test_alone_a_method_that_errs_with_the_reference_is_not_caught(ball):
    score, left = ball.score(ball.wrong)
    assert (score.true_errors, score.primary.judged) == (0, 0)
    (shared,) = share_errors([(score, left)])
    assert shared.settled == Shared(scores=1, true_errors=0, excused=0, changes={})
    assert ball.counts(shared) == ball.counts(score)


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_one_method_that_is_right_charges_all_that_err_with_the_reference(ball, order):
    """Whichever was scored first; and each is charged as if the referee had been asked about every pixel."""
    other = {name: value.copy() for name, value in ball.wrong.items()}
    floor = np.nonzero(ball.right["triangle"] == 0)[0]
    lose(other, int(floor[3]))  # an error of its own as well
    given = [ball.right, ball.wrong, other]
    rows = [ball.score(given[i]) for i in order]
    scores = dict(zip(order, share_errors(rows), strict=True))
    assert [scores[i].true_errors for i in range(3)] == [0, 3, 4]
    assert [scores[i].settled.true_errors for i in range(3)] == [0, 3, 3]
    assert scores[1].settled.scores == 3
    for i, answers in enumerate(given):
        assert ball.counts(scores[i]) == ball.whole(answers)
    assert scores[1].primary.true == 1
    assert (scores[1].shadow[0].acne, scores[1].shadow[1].leak) == (1, 1)
    shown = {(one["kind"], one.get("light"), *one["pixel"]) for one in scores[1].examples}
    assert shown == {
        ("true", None, ball.lost % WIDTH, ball.lost // WIDTH),
        ("acne", 0, ball.acne % WIDTH, ball.acne // WIDTH),
        ("leak", 1, ball.leak % WIDTH, ball.leak // WIDTH),
    }
    json.dumps([score.to_json() for score in scores.values()], allow_nan=False)


def test_sharing_again_changes_nothing_and_more_rows_only_add(ball):
    early, kept = ball.score(ball.wrong)
    (early,) = share_errors([(early, kept)])
    late, of_late = ball.score(ball.right)
    both = share_errors([(early, kept), (late, of_late)])
    assert both[0] != early
    assert both[1] != late
    again = share_errors([(both[0], kept), (both[1], of_late)])
    assert again[0] is both[0]
    assert again[1] is both[1]
    turned = share_errors([(both[1], of_late), (both[0], kept)])
    assert turned[0] is both[1]
    assert turned[1] is both[0]
    assert both[0].true_errors == 3


def test_a_wrong_distance_of_the_reference_is_nobody_elses(ball):
    """A method that names the same triangle has its own t checked."""
    tilted = copy.copy(ball)
    tilted.wrong = ball.answers()
    tilted.wrong["t"][ball.lost] *= np.float32(1.01)
    asked = ball.answers()
    asked["shadowed"][0, ball.lost] ^= 1
    rows = [tilted.score(asked), tilted.score(ball.right), tilted.score(tilted.wrong)]
    assert rows[0][0].reference_errors.primary.true == 1
    scores = share_errors(rows)
    assert [score.true_errors for score in scores] == [1, 0, 1]
    assert [score.settled.true_errors for score in scores] == [0, 0, 0]


def test_another_moment_is_another_matter(ball):
    """What is known of the reference of one moment is no news of another."""
    elsewhere = copy.copy(ball)
    elsewhere.moment = replace(ball.moment, facing=True)
    rows = [ball.score(ball.wrong), elsewhere.score(ball.right)]
    score, _ = share_errors(rows)
    assert score.settled.scores == 1
    assert score.true_errors == 0


def test_ties_and_edges_keep_their_classes():
    """A reference that loses a ray along the shared edge of duplicates; others name the higher duplicate."""
    ball = WrongReference.__new__(WrongReference)
    ball.prepared, ball.moment = lattice_of_rays([(0, 1, 2), (0, 2, 3)] * 2)
    ball.judge = Judge.of(ball.prepared, ball.moment)
    ball.right = cases.exact_answers(ball.prepared, ball.moment)
    ball.provenance = ball.judge.reference.provenance
    middle = 16 * 33 + 16
    inside = 16 * 33 + 20  # in the first triangle, away from its edges
    assert ball.right["triangle"][inside] == 0
    ball.wrong = ball.answers()
    lose(ball.wrong, middle)
    ball.wrong["triangle"][inside] = 1  # wrong, and so is the duplicate that the other one names
    higher = {name: value.copy() for name, value in ball.wrong.items()}
    higher["triangle"][higher["triangle"] >= 0] += 2
    rows = [ball.score(answers) for answers in (ball.right, ball.wrong, higher)]
    assert rows[2][0].primary.tie > 50
    scores = share_errors(rows)
    for score, answers in zip(scores, (ball.right, ball.wrong, higher), strict=True):
        primary, whole = score.primary, ball.score(answers, 33 * 33)[0].primary
        for name in ("edge", "near_tie", "true", "invalid"):
            assert getattr(primary, name) == getattr(whole, name), name
        assert primary.ok + primary.tie == whole.ok + whole.tie
    assert [score.primary.edge for score in scores] == [0, 1, 1]
    assert scores[1].settled.excused >= 1
    assert scores[1].check == "failed"


@pytest.mark.parametrize(("name", "all_found"), [("P03", False), ("P12", True)])
def test_embrees_own_row_is_charged_where_another_method_is_right(name, all_found):
    """Embree is both a method and the reference: alone, its own errors are found near its disputes only.

    In P12 those are everywhere.
    """
    case = find_case(name)
    one = Judged(case, case.make())
    prepared, moment = one.trial.prepared, one.trial.moment
    judge = Judge.of(prepared, moment)
    rows = []
    for method in ("embree", "ray_grids"):
        answers = Session(make_method(method), prepared, moment.width, moment.height, "cpu").answers(moment)
        scored = score_answers(judge.with_random_pixels(0), answers)
        rows.append((scored.score, scored.disputes))
        if method == "embree":
            exact = sum(n for kind, n in one.count(answers)[0].items() if kind in ERROR_NAMES)
    assert (rows[0][0].true_errors == exact) == all_found
    assert rows[0][0].true_errors <= exact
    assert [score.true_errors for score in share_errors(rows)] == [exact, 0]


def test_mirrored_rays_that_are_the_same_are_charged_too(monkeypatch):
    case = find_case("M05")
    trial = case.make()
    moment = trial.moment
    judge = Judge.of(trial.prepared, moment)
    right = Session(make_method("uniform_grid"), trial.prepared, moment.width, moment.height, "cpu").answers(moment)
    pixel = int(np.nonzero(right["bounce_shadowed"][0][0])[0][40])
    plain = context.reference_for

    def blind_to_one(prepared, rays, referee, effects):
        """Embree's answers to mirrored rays, but for everyone's right ones and one shadow that is lost."""
        reference = plain(prepared, rays, referee, effects)
        given = {name: right[f"bounce_{name}"][0].copy() for name in ("triangle", "t", "u", "v", "shadowed")}
        given["shadowed"][0, pixel] = 0
        return Reference(**given, provenance=reference.provenance)

    monkeypatch.setattr(context, "reference_for", blind_to_one)
    wrong = {name: value.copy() for name, value in right.items()}
    wrong["bounce_shadowed"][0, 0, pixel] = 0
    moved = {name: value.copy() for name, value in wrong.items()}
    moved["bounce_direction"][0, pixel] *= np.float32(1 + 2.0**-22)  # other rays: nothing is known of them
    rows = []
    for answers in (right, wrong, moved):
        scored = score_answers(judge.with_random_pixels(0), answers)
        rows.append((scored.score, scored.disputes))
    assert [score.bounces[0].shadow[0].leak for score, _ in rows] == [0, 0, 0]
    scores = share_errors(rows)
    assert [score.bounces[0].shadow[0].leak for score in scores] == [0, 1, 0]
    assert [score.bounces[0].true_errors for score in scores][:2] == [0, 1]
    assert [score.true_errors for score in scores][:2] == [0, 1]
    assert {(one["bounce"], one["kind"], one["light"]) for one in scores[1].examples if one.get("settled")} == {
        (1, "leak", 0)
    }
