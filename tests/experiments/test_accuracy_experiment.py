"""The accuracy experiment: its points, where a frame is wrong, errors over distance and offset, and its drawings."""

import copy
import importlib.util

import numpy as np
import pandas as pd
import pytest
from helpers.small_scenes import make_scene, soup
from helpers.tiny_runs import write_scene
from shadowbench.experiments import accuracy as declared
from shadowbench.experiments.accuracy import untimed
from shadowbench.experiments.accuracy.untimed import error_grid, hard_rows, offset_by
from shadowbench.harness.commands.run import plan_run
from shadowbench.harness.errors import UserError
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases import all_cases
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.report import picture as looks
from shadowbench.harness.report import style
from shadowbench.harness.results import pixel_maps
from shadowbench.harness.runner.planning import survey
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.planning.planned_point import describe_method
from shadowbench.harness.runner.progress import Silent

pytestmark = pytest.mark.usefixtures("unpainted")

# --- what it runs ---


@pytest.mark.parametrize("preset", ["quick", "paper"])
def test_points_have_names_of_their_own_and_settings_that_exist(preset):
    entries = declared.EXPERIMENT.presets[preset].methods
    labels = [describe_method(entry, "cpu")["label"] for entry in entries]
    assert len(set(labels)) == len(labels)
    assert all(": " in label for label in labels)
    assert len({label.split(": ")[0] for label in labels}) <= len(style.COLOURS)


def test_every_label_that_a_drawing_asks_for_is_run():
    labels = {entry.label for entry in declared.EXPERIMENT.presets["quick"].methods}
    asked = {declared.EXACT, *declared.SHOWN}
    for _, with_, without in (*declared.MEASURES, *declared.OTHER_MEASURES):
        asked |= {with_, without}
    assert asked <= labels


def test_only_the_top_of_the_ladder_says_that_it_is_exact():
    exact = [
        e.label
        for e in declared.LADDER + declared.IN_GRIDS
        if make_method(e.method, dict(e.settings)).known_inexact is None
    ]
    assert exact[:2] == [declared.EXACT, "triangle test: float64"]
    assert {label.removeprefix("in the grids: ").split(",")[0] for label in exact[2:]} == {
        "light frame of the world", "light frame in float32", "back faces culled"
    }  # fmt: skip
    # One knob at a time: a measure's two points differ in one setting.
    by_label = {entry.label: dict(entry.settings) for entry in declared.LADDER + declared.PEERS + declared.IN_GRIDS}
    for _, with_, without in (*declared.MEASURES, *declared.OTHER_MEASURES):
        assert len(set(by_label[with_].items()) ^ set(by_label[without].items())) == 1


def test_what_is_not_about_the_scene_is_asked_for(tmp_path, monkeypatch):
    """The hard cases took most of the time of a run on one's own mesh."""
    done = []
    monkeypatch.setattr(declared.untimed, "keep_grid", lambda options, *_: done.append("grid"))
    monkeypatch.setattr(declared.untimed, "keep_hard", lambda options, *_: done.append("hard"))
    scene = write_scene(tmp_path / "tetra.obj")
    plain = plan_run("accuracy", "quick", "cpu", scenes=[str(scene)], out=tmp_path / "out")
    asked = plan_run("accuracy", "quick", "cpu", scenes=[str(scene)], out=tmp_path / "out", extras=("hard-cases",))
    declared.after(plain, Silent())
    assert done == ["grid"]
    declared.after(asked, Silent())
    assert done == ["grid", "grid", "hard"]
    assert survey.untimed_s(asked) > 5 * survey.untimed_s(plain) > 0
    monkeypatch.setattr(declared, "expected_triangles", lambda _: 69_451)
    assert 400 < survey.untimed_s(plain) < 1200, "the grid of a mesh of 69 thousand triangles took 800 s"
    assert "of it for untimed counts" in survey.announcement(plain, survey.survey(plain))
    with pytest.raises(UserError, match=r"^--with hard_cases: accuracy offers hard-cases; did you mean hard-cases"):
        plan_run("accuracy", extras=("hard_cases",))
    with pytest.raises(UserError, match=r"^--with hard-cases: table1 offers nothing"):
        plan_run("table1", extras=("hard-cases",))


def test_the_grid_of_another_scene_is_not_that_of_this_one(tmp_path):
    scene, out = write_scene(tmp_path / "tetra.obj"), tmp_path / "out"
    chosen = plan_run("accuracy", "quick", "cpu", scenes=[str(scene)], out=out)
    out.mkdir()
    for name, kept in (("bunny", False), ("tetra", True)):
        (out / declared.untimed.HEAT).write_text(f"scene,label\n{name},a\n")
        assert declared.untimed.kept(chosen) is kept
        assert (survey.untimed_s(chosen) == 0) is kept


# --- where a frame is wrong ---


@pytest.fixture(scope="module")
def judged():
    vertices, faces = soup(21, 150, size=0.2)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0)], (0.0, 0.5, 3.0))
    moment = prepared.moment(0, 40, 30)
    answers = Session(make_method("accuracy_ladder"), prepared, 40, 30, "cpu").answers(moment)
    return Judge.of(prepared, moment), answers


def planted(answers):
    """The answers with 3 lit pixels said to be shadowed, 2 shadowed ones said to be lit, and a wrong triangle."""
    wrong = copy.deepcopy(answers)
    hit = np.nonzero(answers["triangle"] >= 0)[0]
    lit = hit[answers["shadowed"][0][hit] == 0]
    dark = hit[answers["shadowed"][0][hit] == 1]
    chosen = {Verdict.ACNE: lit[:3], Verdict.LEAK: dark[:2], Verdict.TRUE: lit[-1:]}
    wrong["shadowed"][0][chosen[Verdict.ACNE]] = 1
    wrong["shadowed"][0][chosen[Verdict.LEAK]] = 0
    wrong["triangle"][chosen[Verdict.TRUE]] = -1
    for name, value in (("t", np.inf), ("u", 0.0), ("v", 0.0)):
        wrong[name][chosen[Verdict.TRUE]] = value
    return wrong, chosen


def test_the_map_of_classes_shows_planted_errors_where_they_are(judged, tmp_path):
    judge, answers = judged
    wrong, chosen = planted(answers)
    scored, _ = looks.keep_wrong(tmp_path, "point", 0, judge, wrong)
    classes = pixel_maps.read_wrong(looks.wrong_path(tmp_path, "point", 0))
    assert classes.shape == (30, 40)
    for verdict, pixels in chosen.items():
        np.testing.assert_array_equal(np.nonzero(classes.ravel() == verdict)[0], np.sort(pixels), verdict.name)
    assert scored.score.true_errors == 6
    assert np.isin(classes, (Verdict.ACNE, Verdict.LEAK, Verdict.TRUE, Verdict.INVALID)).sum() == 6
    assert looks.reference_path(tmp_path, judge.prepared.scene.name, 0).exists()
    assert looks.answered_path(tmp_path, "point", 0).exists()


def test_a_right_frame_has_a_map_without_errors_and_no_flip(judged, tmp_path):
    judge, answers = judged
    scored, looked = looks.keep_wrong(tmp_path, "point", 0, judge, answers)
    classes = pixel_maps.read_wrong(looks.wrong_path(tmp_path, "point", 0))
    assert scored.score.true_errors == 0
    assert set(np.unique(classes)) <= {Verdict.OK, Verdict.TIE}
    assert not looks.answered_path(tmp_path, "point", 0).exists(), "the reference's picture shows it"
    if importlib.util.find_spec("flip_evaluator"):
        assert looked["flip"] < 1e-3


@pytest.mark.skipif(not importlib.util.find_spec("flip_evaluator"), reason="flip-evaluator is not installed")
def test_flip_grows_with_what_is_seen():
    right = np.full((32, 32, 3), 120, dtype=np.uint8)
    few, many = right.copy(), right.copy()
    few[:2] = 250
    many[:16] = 250
    values = [looks.flip(right, given)["flip"] for given in (right, few, many)]
    assert values[0] == 0.0
    assert values[0] < values[1] < values[2] <= 1.0


def test_without_the_package_flip_says_so(monkeypatch):
    monkeypatch.setattr(looks.importlib.util, "find_spec", lambda name: None)
    picture = np.zeros((4, 4, 3), dtype=np.uint8)
    assert looks.flip(picture, picture) == {"flip": None, "flip_missing": looks.FLIP_MISSING}


# --- errors over light distance and scene offset ---


def test_an_offset_moves_everything_alike():
    vertices, faces = soup(5, 30)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0)], (0.0, 0.5, 3.0))
    here, there = prepared.moment(0, 8, 8), offset_by(prepared, 64.0).moment(0, 8, 8)
    step = there.eye.astype(float) - here.eye
    assert np.linalg.norm(step) == pytest.approx(64.0 * prepared.radius, rel=1e-5)
    size = 64.0 * prepared.radius * 2.0**-22
    np.testing.assert_allclose(there.points - here.points.astype(float), np.tile(step, (90, 1)), atol=size)
    np.testing.assert_allclose(there.lights[0] - here.lights[0].astype(float), step, atol=size)
    np.testing.assert_array_equal(there.column, here.column)
    np.testing.assert_array_equal(prepared.moment(0, 8, 8).points, here.points)


def test_the_grid_of_errors_is_zero_for_the_exact_tree_and_not_for_a_fixed_offset():
    vertices, faces = soup(21, 150, size=0.2)
    prepared = make_scene(vertices, faces, [(2.0, 3.0, 4.0)], (0.0, 0.5, 3.0))
    entries = (
        Entry("accuracy_ladder", {}, "exact"),
        Entry("accuracy_ladder", {"origin": "epsilon_1e-6"}, "1e-6 radii"),
    )
    grid = list(error_grid(prepared, entries, (2.0, 1e5), (0.0, 1e3), 24, "cpu"))
    assert len(grid) == 2 * 2 * 2
    exact = [row for row in grid if row["label"] == "exact"]
    assert all(row["wrong"] + row["excused"] == 0 for row in exact)
    assert all(row["scored"] > 100 for row in exact)
    far = [row for row in grid if row["label"] == "1e-6 radii" and row["offset"] == 1e3]
    assert all(row["acne"] > 10 for row in far)


def test_the_hard_cases_tell_a_rung_from_the_top():
    entries = (Entry("accuracy_ladder", {}, "exact"), Entry("accuracy_ladder", {"origin": "ray"}, "o + t d"))
    without = ("A", "V ", "S", "M", "H", "O", "P0", "P17", *(f"P{k}" for k in range(2, 7)))
    exact, rung = hard_rows(entries, "cpu", without=without, but=("P07",))
    assert exact["left_out"] == rung["left_out"]
    names = exact["left_out"].split("; ")
    assert {"S35", "P21", "V ball +1"} <= set(names)
    assert not {"P07", "P12"} & set(names)
    assert exact["cases"] == rung["cases"] > 3
    assert (exact["true_errors"], exact["cases_wrong"], exact["worst"]) == (0, 0, "")
    assert rung["true_errors"] > rung["cases_wrong"] > 0


# --- what is drawn ---


def test_the_report_names_the_hard_cases_that_were_left_out(tmp_path):
    rows = pd.DataFrame([{"label": "a", "cases": 9, "true_errors": 1, "left_out": "P29; S35"}])
    (text,) = untimed.described(rows.reindex(columns=untimed.HARD_COLUMNS))
    assert "2 were not tried, in which a point may still be wrong: P29, S35." in text
    (text,) = untimed.described(rows.assign(left_out=untimed.NONE).reindex(columns=untimed.HARD_COLUMNS))
    assert "none was left out" in text
    assert untimed.described(untimed.read_hard(tmp_path)) == []


def test_the_quick_preset_keeps_hard_cases_that_tell():
    names = {case.name for case in all_cases()}
    assert set(declared.TELLING) <= names
    assert all(name.startswith(declared.LONG) for name in declared.TELLING)
    (entry,) = [e for e in declared.IN_GRIDS if e.label == "in the grids: Möller-Trumbore"]
    # Without them one wrong answer of thousands is left.
    (row,) = hard_rows([entry], "cpu", without=("A", "H", "M", "O", "V", "P", "S"), but=("P29d", "P29e"))
    assert row["true_errors"] > 50
