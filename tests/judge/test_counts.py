"""Scores as records keep them: read, checked and written."""

import copy

import pytest
from helpers.answered_scene import answered_ball, plant_hole
from shadowbench.harness.judge.counts import Score
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.results.schema import read_records
from shadowbench.harness.typed_json import WrongFieldError

KEPT = {
    "true_errors": 1,
    "excused_share": 0,
    "check": "failed",
    "primary": {"pixels": 4, "ok": 3, "true": 1},
    "shadow": [{"light": 0, "ok": 3, "scored": 3}],
}


def test_a_score_is_read_as_it_was_written():
    case = answered_ball()
    answers = case.answers()
    plant_hole(case, answers)
    score = score_answers(case.judge, answers).score
    assert Score.from_json(score.to_json()) == score
    assert "bounces" not in score.to_json()


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("primary", "pixels"), "x", "frames[2].score.primary.pixels is 'x', not a whole number"),
        (("primary", "pixels"), None, "frames[2].score.primary.pixels is None, not a whole number"),
        (("primary", "ties"), 1, "frames[2].score.primary.ties is no field that this version knows"),
        (("shadow", 0), 3, "frames[2].score.shadow[0] is 3, not an object"),
        (("shadow",), {}, "frames[2].score.shadow is {}, not a list"),
        (("excused_share",), "0", "frames[2].score.excused_share is '0', not a number"),
    ],
)
def test_a_wrong_field_is_named(path, value, message):
    changed = copy.deepcopy(KEPT)
    inner = changed
    for step in path[:-1]:
        inner = inner[step]
    inner[path[-1]] = value
    assert Score.from_json(KEPT).primary.true == 1
    with pytest.raises(WrongFieldError) as caught:
        Score.from_json(changed, "frames[2].score")
    assert str(caught.value) == message


def test_a_missing_field_is_named():
    with pytest.raises(WrongFieldError, match=r"it has no score\.true_errors"):
        Score.from_json({name: value for name, value in KEPT.items() if name != "true_errors"}, "score")


@pytest.mark.parametrize("experiment", ["table1", "effects", "key_bits"])
def test_scores_of_kept_results_can_be_read(request, experiment):
    folder = next((request.config.rootpath / "results").glob(f"nvidia-*/{experiment}"))
    scores = [frame.score for record in read_records(folder) for frame in record.frames]
    assert len([score for score in scores if isinstance(score, Score)]) > 5
    assert all(Score.from_json(score.to_json()) == score for score in scores if score)
