"""Answers and scores in files: scored elsewhere the same, read as they were written, and what is none refused."""

import numpy as np
import pytest
from helpers.answered_scene import AnsweredScene, answered_ball, plant_hole
from shadowbench.harness.errors import UserError
from shadowbench.harness.judge.answer_files import save_raw, score_raw
from shadowbench.harness.judge.score import score_answers
from shadowbench.harness.judge.verdict import Score


@pytest.fixture(scope="module")
def ball() -> AnsweredScene:
    return answered_ball()


def test_raw_answers_score_the_same_elsewhere_and_a_score_is_read_as_written(ball, tmp_path):
    answers = ball.answers()
    plant_hole(ball, answers)
    here = score_answers(ball.judge, answers).score
    assert Score.from_json(here.to_json()) == here
    assert "bounces" not in here.to_json()
    path = tmp_path / "answers" / "point-0.npz"
    save_raw(path, ball.prepared, ball.moment, answers, "no such scene", extra={"key": "point"})
    there = score_raw(path, folder=tmp_path / "truth").score
    assert there == here
    assert list((tmp_path / "truth").glob("*.npz"))
    save_raw(tmp_path / "answers" / "other-0.npz", ball.prepared, ball.moment, ball.answers(), "no such scene")
    assert len(list((tmp_path / "answers").glob("mesh-*.npz"))) == 1


def test_raw_answers_without_their_mesh_need_the_scene(ball, tmp_path):
    path = tmp_path / "point-0.npz"
    save_raw(path, ball.prepared, ball.moment, ball.answers(), "no_such_scene")
    next(tmp_path.glob("mesh-*.npz")).unlink()
    with pytest.raises(UserError, match="no_such_scene"):
        score_raw(path)


def test_a_changed_mesh_is_refused(ball, tmp_path):
    path = tmp_path / "point-0.npz"
    save_raw(path, ball.prepared, ball.moment, ball.answers(), "ball")
    mesh = next(tmp_path.glob("mesh-*.npz"))
    with np.load(mesh) as stored:
        arrays = {name: stored[name] for name in stored.files}
    arrays["points"][0, 0] += 1
    np.savez(mesh.open("wb"), **arrays)
    with pytest.raises(UserError, match="mesh of ball differ"):
        score_raw(path)


def test_a_file_that_is_none_is_one_line(tmp_path):
    path = tmp_path / "point-0.npz"
    path.write_text("text")
    with pytest.raises(UserError, match=r"not a file of raw answers \(it is no \.npz file\); run its point again"):
        score_raw(path)
