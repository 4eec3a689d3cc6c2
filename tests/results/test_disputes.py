"""Folders of results charged with shared errors: runs that go on, answers scored later; nothing is written twice."""

import json

import numpy as np
import pytest
from helpers.answered_scene import lose
from helpers.experiment_records import record_of
from helpers.tiny_runs import install_misbehaving, options, write_scene
from helpers.wrong_reference import WrongReference
from shadowbench.harness.commands.verify import score as score_command
from shadowbench.harness.judge import reference
from shadowbench.harness.judge.answer_files import save_raw
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.reference import embree_installed
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.report import picture as looks
from shadowbench.harness.results import pixel_maps
from shadowbench.harness.results.disputes import charge_folder, disputes_path, read_disputes
from shadowbench.harness.results.schema import read_record
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.run import Run
from shadowbench.harness.runner.workers.grader import Grader, hand_over, handed_path

pytestmark = pytest.mark.skipif(not embree_installed(), reason="an exact reference has no errors to share")


@pytest.fixture(scope="module")
def ball() -> WrongReference:
    return WrongReference()


def graded_record(key: str, graded: list[dict]) -> dict:
    record = record_of("table1", Entry("embree", {}, key))
    (frame,) = record["frames"]
    return {**record, "key": key, "frames": [{**frame, **one} for one in graded]}


def grade(ball, folder, key, answers, wrong_maps=False):
    """One point scored by a grader of its own, as where a run goes on after it was stopped."""
    hand_over(handed_path(folder, key, 0), answers)
    grader = Grader(ball.prepared, {0: ball.moment}, "ball", folder, "cpu", {})
    graded = grader.grade(key, False, True, folder / "picture.png", "ball", wrong_maps)
    (folder / "records").mkdir(exist_ok=True)
    (folder / "records" / f"{key}.json").write_text(json.dumps(graded_record(key, graded)))


@pytest.fixture
def blind(ball, monkeypatch):
    """Every judge takes the wrong reference, and samples no pixels."""
    monkeypatch.setattr(reference, "embree_reference", lambda *arguments: ball.reference)
    plain = Judge.of
    without_sample = staticmethod(lambda *arguments: plain(*arguments).with_random_pixels(0))
    monkeypatch.setattr(Judge, "of", without_sample)


def errors(folder, key):
    return json.loads((folder / "records" / f"{key}.json").read_text())["frames"][0]["score"]["true_errors"]


def test_a_folder_is_charged_when_it_goes_on_and_only_then_rewritten(ball, blind, tmp_path):
    grade(ball, tmp_path, "b", ball.wrong, wrong_maps=True)
    charge_folder(tmp_path)
    assert errors(tmp_path, "b") == 0
    grade(ball, tmp_path, "a", ball.right, wrong_maps=True)
    changed = charge_folder(tmp_path)
    assert (set(changed), changed["b"].frames[0].score.settled.true_errors) == ({"a", "b"}, 3)
    assert (errors(tmp_path, "a"), errors(tmp_path, "b")) == (0, 3)
    classes = pixel_maps.read_wrong(looks.wrong_path(tmp_path, "b", 0)).ravel()
    assert classes[ball.lost] == Verdict.TRUE
    assert (classes[ball.acne], classes[ball.leak]) == (Verdict.ACNE, Verdict.LEAK)
    assert (classes > Verdict.TIE).sum() == 3
    assert (pixel_maps.read_wrong(looks.wrong_path(tmp_path, "a", 0)) > Verdict.TIE).sum() == 0
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in tmp_path.glob("[rm]*/*")}
    assert charge_folder(tmp_path) == {}
    assert {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in before} == before
    assert all(path.stat().st_size < 4000 for path in (tmp_path / "truth").glob("disputes-*"))


def test_a_torn_file_of_disputes_costs_its_own_point_only(ball, blind, tmp_path):
    for key, answers in (("a", ball.right), ("b", ball.wrong), ("c", ball.wrong)):
        grade(ball, tmp_path, key, answers)
    disputes_path(tmp_path, "c", 0).write_bytes(b"PK\x03\x04 torn")
    assert read_disputes(disputes_path(tmp_path, "c", 0)) is None
    charge_folder(tmp_path)
    assert (errors(tmp_path, "b"), errors(tmp_path, "c")) == (3, 0)


def test_answers_scored_later_are_charged_with_those_scored_before(ball, blind, tmp_path, capsys):
    kept = {"b": ball.wrong, "a": ball.right}
    for key, answers in kept.items():
        path = tmp_path / "answers" / f"{key}-0.npz"
        save_raw(path, ball.prepared, ball.moment, answers, "ball", extra={"key": key})
        (tmp_path / "records").mkdir(exist_ok=True)
        record = graded_record(key, [{"frame": 0, "score": None, "unscored": "no reference there"}])
        (tmp_path / "records" / f"{key}.json").write_text(json.dumps(record))
    held_back = tmp_path / "answers" / "a-0.npz"
    held_back.rename(tmp_path / "a-0.npz")
    score_command(tmp_path, as_json=True)
    (row,) = json.loads(capsys.readouterr().out)["answers"]
    assert (row["score"]["true_errors"], row["counts_against"]) == (0, False)
    (tmp_path / "a-0.npz").rename(held_back)
    score_command(tmp_path, as_json=True)
    rows = {row["answers"][-7]: row for row in json.loads(capsys.readouterr().out)["answers"]}
    assert (rows["b"]["status"], rows["b"]["score"]["true_errors"]) == ("had a score", 3)
    assert (errors(tmp_path, "a"), errors(tmp_path, "b")) == (0, 3)


@pytest.mark.slow
def test_a_run_that_goes_on_charges_what_it_scored_before(tmp_path, monkeypatch):
    """Embree's answers on the disk say that everything misses; so does the method measured first."""
    monkeypatch.setenv("PYTHONPATH", install_misbehaving(tmp_path / "packages"))
    monkeypatch.syspath_prepend(str(tmp_path / "packages"))
    scene = write_scene(tmp_path / "tetra.obj")
    size = {"width": 32, "height": 32, "frames": 1, "score": True}
    (honest,) = Run(options(tmp_path / "first", [scene], ["uniform_grid"], **size), Silent()).go()
    (path,) = (tmp_path / "first" / "truth").glob("truth-*.npz")
    with np.load(path) as stored:
        arrays = {name: stored[name].copy() for name in stored.files}
    hits = int((arrays["triangle"] >= 0).sum())
    assert hits > 200
    for pixel in np.nonzero(arrays["triangle"] >= 0)[0]:
        lose(arrays, pixel)
    out = tmp_path / "out"
    (out / "truth").mkdir(parents=True)
    np.savez(out / "truth" / path.name, **arrays)
    (steady,) = Run(options(out, [scene], ["steady"], **size), Silent()).go()
    alone = steady.frames[0].score
    assert 0 < alone.true_errors < hits  # what a random sample of pixels finds
    both = Run(options(out, [scene], ["steady", "uniform_grid"], **size), Silent()).go()
    found = {record.method["name"]: record.frames[0].score for record in both}
    assert (found["uniform_grid"].true_errors, found["steady"].true_errors) == (0, hits)
    assert found["steady"].settled.true_errors == hits - alone.true_errors
    assert both[0] == read_record(out / "records" / f"{both[0].key}.json")
    assert honest.frames[0].score.true_errors == 0
