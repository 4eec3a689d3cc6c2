"""The accuracy experiment: its points, where a frame is wrong, errors over distance and offset, and its drawings."""

from __future__ import annotations

import copy
import csv
import importlib.util
import itertools

import numpy as np
import pytest
from helpers.brute_force import make_scene, soup
from helpers.fake_records import record, write
from shadowbench.experiments import accuracy as declared
from shadowbench.experiments._figures import accuracy, accuracy_heat, accuracy_pareto
from shadowbench.experiments._figures.accuracy_cost import costs
from shadowbench.experiments._figures.accuracy_rows import families, mark_frontier, rows
from shadowbench.experiments._hardness import hard_rows
from shadowbench.experiments._offsets import error_grid, offset_by
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.judge.context import Judge
from shadowbench.harness.judge.verdict import Verdict
from shadowbench.harness.report import flip as looks
from shadowbench.harness.report import style
from shadowbench.harness.results import pixel_maps
from shadowbench.harness.runner.experiment import Entry
from shadowbench.harness.runner.points import check_entries

# --- what it runs ---


@pytest.mark.parametrize("preset", ["quick", "paper"])
def test_points_have_names_of_their_own_and_settings_that_exist(preset):
    entries = declared.EXPERIMENT.presets[preset].methods
    labels = [entry.label for entry in check_entries(entries)]
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
    by_label = {
        entry.label: dict(entry.settings) for entry in declared.LADDER + declared.PEERS + declared.IN_GRIDS
    }
    for _, with_, without in (*declared.MEASURES, *declared.OTHER_MEASURES):
        assert len(set(by_label[with_].items()) ^ set(by_label[without].items())) == 1


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
    lit = hit[answers["visibility"][0][hit] == 0]
    dark = hit[answers["visibility"][0][hit] == 1]
    chosen = {Verdict.ACNE: lit[:3], Verdict.LEAK: dark[:2], Verdict.TRUE: lit[-1:]}
    wrong["visibility"][0][chosen[Verdict.ACNE]] = 1
    wrong["visibility"][0][chosen[Verdict.LEAK]] = 0
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
        np.testing.assert_array_equal(
            np.nonzero(classes.ravel() == verdict)[0], np.sort(pixels), verdict.name
        )
    assert scored.score.true_errors == 6
    assert np.isin(classes, (Verdict.ACNE, Verdict.LEAK, Verdict.TRUE, Verdict.INVALID)).sum() == 6
    assert looks.reference_path(tmp_path, judge.prepared.scene.name, 0).exists()


def test_a_right_frame_has_a_map_without_errors_and_no_flip(judged, tmp_path):
    judge, answers = judged
    scored, looked = looks.keep_wrong(tmp_path, "point", 0, judge, answers)
    classes = pixel_maps.read_wrong(looks.wrong_path(tmp_path, "point", 0))
    assert scored.score.true_errors == 0
    assert set(np.unique(classes)) <= {Verdict.OK, Verdict.TIE}
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
    exact, rung = hard_rows(entries, "cpu", without=("V ", "S", "P2", "P0"))
    assert exact["cases"] == rung["cases"] > 3
    assert (exact["true_errors"], exact["cases_wrong"], exact["worst"]) == (0, 0, "")
    assert rung["true_errors"] > rung["cases_wrong"] > 0


# --- what is drawn ---


def point(label, ms, wrong, spread=0.01, scene="buddha", count=10):
    """A made-up record with one frame: its times around ``ms``, and acne as its only errors."""
    made = record(scene, "embree")
    made["key"] = f"{scene}-{label}"
    made["experiment"] = "accuracy"
    made["method"] |= {"label": label, "settings": {"label": label}}
    frame = made["frames"][0]
    frame["total_ms"] = list(np.linspace(ms * (1 - spread), ms * (1 + spread), count))
    frame["wall_ms"] = frame["total_ms"]
    frame["round"] = [0, 1] * (count // 2)
    frame["score"]["true_errors"] = wrong
    frame["score"]["primary"] |= {"true": 0, "invalid": 0, "near_tie": 1, "edge": 2, "tie": 5}
    frame["score"]["shadow"] = [{"scored": 100, "acne": wrong, "leak": 0, "edge": 3, "invalid": 0}]
    frame |= {"flip": 0.25, "flip_missing": ""}
    return made


@pytest.fixture
def folder(tmp_path):
    made = [
        point("a: exact", 20.0, 0),
        point("a: fast", 15.0, 4),
        point("b: beaten", 30.0, 4),
        point("b: quick", 5.0, 2000),
        point("c: as wrong as quick", 6.0, 2000),
    ]
    return write(tmp_path, made)


def test_the_frontier_is_what_nothing_beats(folder):
    made = rows(folder)
    mark_frontier(made)
    assert {r["label"] for r in made if r["on_frontier"]} == {"a: exact", "a: fast", "b: quick"}


def test_a_cpu_is_on_no_frontier_of_a_gpu(folder):
    made = rows(folder)
    next(r for r in made if r["label"] == "b: quick")["device"] = "another"
    mark_frontier(made)
    assert {r["label"] for r in made if r["on_frontier"]} == {"a: exact", "a: fast", "c: as wrong as quick"}


def test_classes_are_counted_apart(folder):
    (fast,) = [r for r in rows(folder) if r["label"] == "a: fast"]
    counts = {
        name: fast[name] for name in ("wrong_per_frame", "primary_wrong", "acne", "leak", "excused", "ties")
    }
    assert counts == {
        "wrong_per_frame": 4, "primary_wrong": 0, "acne": 4, "leak": 0, "excused": 6, "ties": 5
    }  # fmt: skip
    assert (fast["family"], fast["level"], fast["flip"]) == ("a", "fast", 0.25)


def test_equal_error_takes_the_fastest_that_is_right_enough(folder):
    made = {e["family"]: e for e in accuracy.equal_error(rows(folder))}
    assert (made["a"]["label"], made["a"]["total_ms"]) == ("a: fast", pytest.approx(15.0))
    assert made["b"]["label"] == "b: beaten"
    assert made["c"]["label"] == ""
    assert made["c"]["best_wrong"] == 2000


def test_a_difference_within_the_noise_is_no_cost(tmp_path):
    made = [
        point("a: with", 20.0, 0),
        point("a: without", 19.95, 0),
        point("a: cheap", 10.0, 7),
        point("a: once", 10.0, 7, count=2),
    ]
    names = ("without", "cheap", "once")
    found = costs(rows(write(tmp_path, made)), [(name, "a: with", f"a: {name}") for name in names])
    assert [c["within_noise"] for c in found] == [True, False, True]
    assert found[1]["cost_ms"] == pytest.approx(10.0)
    assert found[2]["noise_ms"] is None


def test_everything_is_drawn_and_the_tables_are_in_the_text(folder, capsys):
    classes = np.zeros((256, 256), dtype=np.int64)
    classes[10:20, 10:20] = Verdict.ACNE
    looks.write_map(looks.wrong_path(folder, "buddha-b: quick", 0), classes + looks.OFFSET)
    lines = [
        "scene,label,method,distance,offset,size,status,wrong,primary_wrong,acne,leak,excused,scored,pixels"
    ]
    for distance in (2, 1000):
        lines += [f'buddha,"{name}",m,{distance},0,48,ok,{wrong},0,{wrong},0,1,900,2304' for name, wrong in
                  (("ours", 0), ("theirs", 30))]  # fmt: skip
    (folder / "accuracy_heat.csv").write_text("\n".join(lines) + "\n")
    hard = ["label,method,device,cases,cases_wrong,true_errors,worst", "a: exact,m,cpu,90,0,0,"]
    hard.append("a: fast,m,cpu,90,3,1234,P12 700")
    (folder / "accuracy_hard.csv").write_text("\n".join(hard) + "\n")
    measures = [("care", "a: exact", "a: fast")]
    files = accuracy.draw(folder, False, measures, [], ["b: quick"], "a: exact")
    assert {path.name for path in files} == {
        "accuracy.csv", "accuracy_equal_error.csv", "accuracy_costs.csv", "accuracy_pareto.svg",
        "accuracy_costs.svg", "accuracy_where-buddha.png", "accuracy_heat.png", "accuracy.md",
    }  # fmt: skip
    assert all(path.stat().st_size > 100 for path in files)
    text = (folder / "accuracy.md").read_text()
    for phrase in (
        "Time to fewer than 10 wrong answers",
        "not reached: 2,000 wrong at best",
        "| care |",
        "0.25",
    ):
        assert phrase in text, phrase
    assert "a: exact" in capsys.readouterr().out
    with open(folder / "accuracy.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert len(table) == 5
    assert {r["label"]: r["on_frontier"] for r in table}["b: beaten"] == "False"


def test_names_in_the_pareto_plot_cover_neither_one_another_nor_a_marker():
    """Many points close together: some names are left out, none is drawn over anything."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    random = np.random.default_rng(1)
    rows = [
        {
            "family": f"{i % 3}", "level": f"a long name {i}", "scene_title": "S", "scene": "s", "width": 8, "height": 8,
            "total_ms": float(ms), "wrong_per_frame": float(wrong), "on_frontier": i == 0, "quartiles": (ms, ms),
        }
        for i, (ms, wrong) in enumerate(zip(random.uniform(1, 3, 40), random.integers(0, 90, 40), strict=True))
    ]  # fmt: skip
    figure = Figure(figsize=(3.6, 2.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    looks = families(rows)
    accuracy_pareto._panel(axes, rows, looks)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    accuracy_pareto._names(axes, rows, accuracy_pareto._heights(looks))
    boxes = [accuracy_pareto._box(text) for text in axes.texts]
    assert 4 < len(boxes) < 41
    assert not any(accuracy_pareto._meet(a, b) for a, b in itertools.combinations(boxes, 2))
    for r in rows:
        x, y = axes.transData.transform(
            (r["total_ms"], accuracy_pareto._height(r, accuracy_pareto._heights(looks)))
        )
        assert not any(accuracy_pareto._meet((x - 1, y - 1, x + 1, y + 1), box) for box in boxes), r["level"]


def test_the_ink_on_a_colour_is_the_one_that_stands_out():
    import matplotlib

    colours = matplotlib.colormaps["magma_r"].with_extremes(bad="white")
    assert accuracy_heat._ink(colours, 0.0) == "black", "pale yellow"
    assert accuracy_heat._ink(colours, 0.6) == "white", "purple"
    assert accuracy_heat._ink(colours, 1.0) == "white"
    assert accuracy_heat._ink(colours, np.ma.masked) == accuracy_heat._ink(colours, float("nan")) == "black"


def test_a_folder_without_scores_says_so(tmp_path):
    made = point("a: exact", 20.0, 0)
    made["frames"][0].update(score=None, unscored="no truth here")
    files = accuracy.draw(write(tmp_path, [made]), True, [], [], [], "a: exact")
    assert "No point has both a time and a score." in (tmp_path / "accuracy.md").read_text()
    assert not any(path.suffix == ".svg" for path in files)


def test_families_have_colours_of_their_own():
    made = [{"family": str(i)} for i in range(len(style.COLOURS))]
    assert len(set(families(made).values())) == len(made)
