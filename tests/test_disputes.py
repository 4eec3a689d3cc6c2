"""Disputes of others: what a reference gets wrong is charged to every method that says the same, whoever asked."""

from __future__ import annotations

import copy
import itertools
import json
from dataclasses import replace

import exact_cases as cases
import numpy as np
import pytest
from runs import install_trouble, options, write_scene
from shadowbench.harness import looks
from shadowbench.harness import score as scoring
from shadowbench.harness.commands.verify import score as score_command
from shadowbench.harness.disputes import settle
from shadowbench.harness.grading import Grader, hand_over, handed_path
from shadowbench.harness.moment import Prepared
from shadowbench.harness.progress import Silent
from shadowbench.harness.raw import save_raw
from shadowbench.harness.referee import Verdict
from shadowbench.harness.run import Run
from shadowbench.harness.scene import Camera, Light
from shadowbench.harness.score import Judge, score_answers
from shadowbench.harness.settlement import kept_path, read_disputes, settle_folder
from shadowbench.harness.truth import Reference, embree_installed

WIDTH, HEIGHT = 60, 45

pytestmark = pytest.mark.skipif(not embree_installed(), reason="an exact reference has no errors to settle")


class Court:
    """A scene, its exact answers, and a reference that is wrong in some pixels."""

    def __init__(self, scene=None):
        self.prepared = Prepared(scene or cases.ball_on_floor(lights=2))
        self.moment = self.prepared.moment(0, WIDTH, HEIGHT)
        self.judge = Judge(self.prepared, self.moment)
        self.right = cases.exact_answers(self.prepared, self.moment, self.judge.referee)
        self.wrong = self.answers()
        right, floor = self.right, self.right["triangle"] == 0
        self.lost = pixel_of(floor)
        self.acne = pixel_of((right["triangle"] == 1) & (right["visibility"][0] == 0))
        self.leak = pixel_of((right["triangle"] <= 1) & (right["visibility"][1] == 1))
        lose(self.wrong, self.lost)
        self.wrong["visibility"][0, self.acne] = 1
        self.wrong["visibility"][1, self.leak] = 0

    def answers(self):
        return {name: value.copy() for name, value in self.right.items()}

    @property
    def reference(self) -> Reference:
        arrays = {name: value.copy() for name, value in self.wrong.items()}
        return Reference(**arrays, provenance=self.judge.reference.provenance)

    def score(self, answers, sample: int = 0):
        """A score against the wrong reference, and what it leaves to others."""
        left: list = []
        judge = self.judge
        score = score_answers(
            self.prepared,
            self.moment,
            answers,
            self.reference,
            judge.referee,
            judge.effects,
            sample,
            disputes=left,
        )
        return score, left

    def counts(self, score):
        """What must come out the same whoever asked."""
        asked = ("disputed", "judged", "t_max_relative_error", "uv_max_error")
        primary = {name: n for name, n in score["primary"].items() if name not in asked}
        shadow = [{name: n for name, n in light.items() if name != "disputed"} for light in score["shadow"]]
        return primary, shadow, score["true_errors"], score["excused_share"], score["check"]

    def whole(self, answers):
        """The counts where the referee decides every pixel."""
        return self.counts(self.score(answers, WIDTH * HEIGHT)[0])


def pixel_of(test) -> int:
    found = np.nonzero(test)[0]
    assert len(found) > 10
    return int(found[len(found) // 2])


def lose(answers, pixel):
    answers["triangle"][pixel], answers["t"][pixel] = -1, np.inf
    answers["u"][pixel] = answers["v"][pixel] = 0
    answers["visibility"][:, pixel] = 0


@pytest.fixture(scope="module")
def court() -> Court:
    return Court()


def test_alone_a_method_that_errs_with_the_reference_is_not_caught(court):
    score, left = court.score(court.wrong)
    assert (score["true_errors"], score["primary"]["judged"]) == (0, 0)
    assert settle([(score, left)]) == [True]
    assert score["settled"] == {"scores": 1, "true_errors": 0, "excused": 0, "changes": {}}
    assert court.counts(score) == court.counts(court.score(court.wrong)[0])


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_one_method_that_is_right_charges_all_that_err_with_the_reference(court, order):
    """Whichever was scored first; and each is charged as if the referee had been asked about every pixel."""
    other = {name: value.copy() for name, value in court.wrong.items()}
    floor = np.nonzero(court.right["triangle"] == 0)[0]
    lose(other, int(floor[3]))  # an error of its own as well
    given = [court.right, court.wrong, other]
    rows = [court.score(given[i]) for i in order]
    assert settle(rows) == [True] * 3
    scores = dict(zip(order, (score for score, _ in rows), strict=True))
    assert [scores[i]["true_errors"] for i in range(3)] == [0, 3, 4]
    assert [scores[i]["settled"]["true_errors"] for i in range(3)] == [0, 3, 3]
    assert scores[1]["settled"]["scores"] == 3
    for i, answers in enumerate(given):
        assert court.counts(scores[i]) == court.whole(answers)
    assert scores[1]["primary"]["true"] == 1
    assert (scores[1]["shadow"][0]["acne"], scores[1]["shadow"][1]["leak"]) == (1, 1)
    shown = {(one["kind"], one.get("light"), *one["pixel"]) for one in scores[1]["examples"]}
    assert shown == {
        ("true", None, court.lost % WIDTH, court.lost // WIDTH),
        ("acne", 0, court.acne % WIDTH, court.acne // WIDTH),
        ("leak", 1, court.leak % WIDTH, court.leak // WIDTH),
    }
    json.dumps([score for score, _ in rows], allow_nan=False)


def test_settling_again_changes_nothing_and_more_rows_only_add(court):
    early = court.score(court.wrong)
    settle([early])
    late = court.score(court.right)
    assert settle([early, late]) == [True, True]
    before = copy.deepcopy(early[0])
    assert settle([early, late]) == [False, False]
    assert settle([late, early]) == [False, False]
    assert early[0] == before
    assert before["true_errors"] == 3


def test_a_wrong_distance_of_the_reference_is_nobody_elses(court):
    """A method that names the same triangle has its own t checked."""
    tilted = copy.copy(court)
    tilted.wrong = court.answers()
    tilted.wrong["t"][court.lost] *= np.float32(1.01)
    asked = court.answers()
    asked["visibility"][0, court.lost] ^= 1
    rows = [tilted.score(asked), tilted.score(court.right), tilted.score(tilted.wrong)]
    assert rows[0][0]["reference_errors"]["primary"]["true"] == 1
    settle(rows)
    assert [score["true_errors"] for score, _ in rows] == [1, 0, 1]
    assert [score["settled"]["true_errors"] for score, _ in rows] == [0, 0, 0]


def test_another_moment_is_another_matter(court):
    """What is known of the reference of one moment is no news of another."""
    elsewhere = copy.copy(court)
    elsewhere.moment = replace(court.moment, facing=True)
    rows = [court.score(court.wrong), elsewhere.score(court.right)]
    settle(rows)
    assert rows[0][0]["settled"]["scores"] == 1
    assert rows[0][0]["true_errors"] == 0


def test_ties_and_edges_keep_their_classes():
    """A reference that loses a ray along the shared edge of duplicates; others name the higher duplicate."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0.0)])
    faces = [(0, 1, 2), (0, 2, 3), (0, 1, 2), (0, 2, 3)]
    scene = cases.make_scene(corners, faces, Camera((0, 0, 2), (0, 0, 0)), Light((0, 0, 3)))
    court = Court.__new__(Court)
    court.prepared = Prepared(scene)
    steps = (np.arange(33, dtype=np.float32) - 16) / 8
    zero = np.zeros(33, dtype=np.float32)
    column, row = np.stack([steps, zero, zero - 1], axis=1), np.stack([zero, -steps, zero], axis=1)
    court.moment = replace(court.prepared.moment(0, 33, 33), column=column, row=row)
    court.judge = Judge(court.prepared, court.moment)
    court.right = cases.exact_answers(court.prepared, court.moment, court.judge.referee)
    middle = 16 * 33 + 16
    inside = 16 * 33 + 20  # in the first triangle, away from its edges
    assert court.right["triangle"][inside] == 0
    court.wrong = court.answers()
    lose(court.wrong, middle)
    court.wrong["triangle"][inside] = 1  # wrong, and so is the duplicate that the other one names
    higher = {name: value.copy() for name, value in court.wrong.items()}
    higher["triangle"][higher["triangle"] >= 0] += 2
    rows = [court.score(answers) for answers in (court.right, court.wrong, higher)]
    assert rows[2][0]["primary"]["tie"] > 50
    settle(rows)
    for (score, _), answers in zip(rows, (court.right, court.wrong, higher), strict=True):
        primary, whole = score["primary"], court.score(answers, 33 * 33)[0]["primary"]
        for name in ("edge", "near_tie", "true", "invalid"):
            assert primary[name] == whole[name], name
        assert primary["ok"] + primary["tie"] == whole["ok"] + whole["tie"]
    assert [score["primary"]["edge"] for score, _ in rows] == [0, 1, 1]
    assert rows[1][0]["settled"]["excused"] >= 1
    assert rows[1][0]["check"] == "failed"


# --- folders ---------------------------------------------------------------------------------------------------


def record_of(key: str, graded: list[dict]) -> dict:
    return {"key": key, "method": {"name": "embree", "settings": {}}, "frames": graded}


def grade(court, folder, key, answers, wrong_maps=False):
    """One point scored by a grader of its own, as where a run goes on after it was stopped."""
    hand_over(handed_path(folder, key, 0), answers)
    grader = Grader(court.prepared, {0: court.moment}, "ball", folder, "cpu")
    graded = grader.grade(key, False, True, folder / "picture.png", "ball", wrong_maps)
    (folder / "records").mkdir(exist_ok=True)
    (folder / "records" / f"{key}.json").write_text(json.dumps(record_of(key, graded)))


@pytest.fixture
def blind(court, monkeypatch):
    """Every judge takes the wrong reference, and samples no pixels."""
    monkeypatch.setattr(scoring, "embree_reference", lambda *arguments: court.reference)
    plain = Judge.score
    monkeypatch.setattr(
        Judge,
        "score",
        lambda self, answers, extra_pixels=0, **more: plain(self, answers, extra_pixels, **more),
    )


def errors(folder, key):
    return json.loads((folder / "records" / f"{key}.json").read_text())["frames"][0]["score"]["true_errors"]


def test_a_folder_is_settled_when_it_goes_on_and_only_then_rewritten(court, blind, tmp_path):
    grade(court, tmp_path, "b", court.wrong, wrong_maps=True)
    settle_folder(tmp_path)
    assert errors(tmp_path, "b") == 0
    grade(court, tmp_path, "a", court.right, wrong_maps=True)
    changed = settle_folder(tmp_path)
    assert set(changed) == {"a", "b"}
    assert changed["b"]["frames"][0]["score"]["settled"]["true_errors"] == 3
    assert (errors(tmp_path, "a"), errors(tmp_path, "b")) == (0, 3)
    classes = looks.read_wrong(looks.wrong_path(tmp_path, "b", 0)).ravel()
    assert classes[court.lost] == Verdict.TRUE
    assert (classes[court.acne], classes[court.leak]) == (Verdict.ACNE, Verdict.LEAK)
    assert (classes > Verdict.TIE).sum() == 3
    assert (looks.read_wrong(looks.wrong_path(tmp_path, "a", 0)) > Verdict.TIE).sum() == 0
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in tmp_path.glob("[rm]*/*")}
    assert settle_folder(tmp_path) == {}
    assert {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in before} == before
    assert all(path.stat().st_size < 4000 for path in (tmp_path / "truth").glob("disputes-*"))


def test_a_torn_file_of_disputes_costs_its_own_point_only(court, blind, tmp_path):
    for key, answers in (("a", court.right), ("b", court.wrong), ("c", court.wrong)):
        grade(court, tmp_path, key, answers)
    kept_path(tmp_path, "c", 0).write_bytes(b"PK\x03\x04 torn")
    assert read_disputes(kept_path(tmp_path, "c", 0)) is None
    settle_folder(tmp_path)
    assert (errors(tmp_path, "b"), errors(tmp_path, "c")) == (3, 0)


def test_answers_scored_later_are_settled_with_those_scored_before(court, blind, tmp_path, capsys):
    kept = {"b": court.wrong, "a": court.right}
    for key, answers in kept.items():
        path = tmp_path / "answers" / f"{key}-0.npz"
        save_raw(path, court.prepared, court.moment, answers, "ball", extra={"key": key})
        (tmp_path / "records").mkdir(exist_ok=True)
        record = record_of(key, [{"frame": 0, "score": None, "unscored": "no truth there"}])
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


def test_a_run_that_goes_on_charges_what_it_scored_before(tmp_path, monkeypatch):
    """Embree's answers on the disk say that everything misses; so does the method measured first."""
    monkeypatch.setenv("PYTHONPATH", install_trouble(tmp_path / "packages"))
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
    alone = steady["frames"][0]["score"]
    assert 0 < alone["true_errors"] < hits  # what a random sample of pixels finds
    both = Run(options(out, [scene], ["steady", "uniform_grid"], **size), Silent()).go()
    found = {record["method"]["name"]: record["frames"][0]["score"] for record in both}
    assert found["uniform_grid"]["true_errors"] == 0
    assert found["steady"]["true_errors"] == hits
    assert found["steady"]["settled"]["true_errors"] == hits - alone["true_errors"]
    assert {key: both[0][key] for key in ("frames", "rounds")} == {
        key: json.loads((out / "records" / f"{both[0]['key']}.json").read_text())[key]
        for key in ("frames", "rounds")
    }
    assert honest["frames"][0]["score"]["true_errors"] == 0
