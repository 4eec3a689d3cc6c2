"""What a run says that it will do: which points are there, how long the others may take, whether the machine is busy."""

import json
from functools import partial

import pytest
from helpers.tiny_runs import Heard, options, write_scene
from shadowbench.harness.commands.run import dry, plan_run
from shadowbench.harness.errors import UserError
from shadowbench.harness.results.record import Record
from shadowbench.harness.runner.planning import survey, time_estimate
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment
from shadowbench.harness.runner.planning.time_estimate import expected_work, guess
from shadowbench.harness.runner.progress import Bar, Silent
from shadowbench.harness.runner.run import Run


def test_a_dry_run_names_what_is_there_and_what_is_not(tmp_path, capsys):
    scene, out = write_scene(tmp_path / "tetra.obj"), tmp_path / "out"
    one, both = options(out, [scene], ["uniform_grid"]), options(out, [scene], ["uniform_grid", "ray_grids"])
    assert dry(both, as_json=True) == 0
    told = json.loads(capsys.readouterr().out)
    assert [p["status"] for p in told["points"]] == ["to be measured"] * 2
    assert told["rough"]
    assert 4.0 <= told["seconds"] < 4.2  # what a scene and two points take whatever their size
    assert not out.exists()

    Run(one, Silent()).go()
    before = sorted(out.rglob("*"))
    dry(both)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["tetra, uniform_grid: already measured (ok)", "tetra, ray_grids: to be measured"]
    assert "2 points on 1 scene" in lines[2]
    assert "1 of them is already measured. This may take about" in lines[2]
    assert "compile" not in lines[2]
    assert sorted(out.rglob("*")) == before

    report = Heard()
    Run(one, report).go()
    assert "nothing to measure, 1 of 1 points" in report.notes[0]
    assert "ompile" not in report.notes[0]


@pytest.mark.parametrize("below", ["", "deep/er"])
def test_results_cannot_go_to_a_file(tmp_path, below):
    taken = tmp_path / "mesh.ply"
    taken.touch()
    with pytest.raises(UserError, match=r"mesh\.ply is a file; name a folder"):
        plan_run("frame_time", device="cpu", scenes=["cloth"], out=taken / below)


@pytest.mark.parametrize(
    ("experiment", "measured_s"), [("table1", 242), ("frame_time", 178), ("two_lights", 132), ("effects", 154)]
)
def test_the_first_estimate_is_within_a_factor_of_two(experiment, measured_s, tmp_path):
    """The seconds that the quick presets took on two cores, kernels compiled."""
    chosen = plan_run(experiment, "quick", "cpu", out=tmp_path)
    seconds, known = survey.seconds_left(survey.survey(chosen))
    assert not known
    assert measured_s / 2 < seconds < measured_s * 2


@pytest.mark.parametrize(
    ("experiment", "measured_s"),
    [("table1", 390), ("frame_time", 424), ("figure9", 39), ("figure11", 628), ("moving", 540),
     ("ablation", 685)],
)  # fmt: skip
def test_the_first_estimate_of_a_run_on_a_gpu_is_within_a_factor_of_two(experiment, measured_s):
    """The seconds that the paper presets took on an H200, without compiling; made of the times in their records."""
    parts = find_experiment(experiment).presets["paper"].parts()
    every = [(scene, part, light) for part in parts for scene in part.scenes for light in part.lightings]
    seconds = sum(len(part.methods) * guess(scene, part, light.count, "cuda:0") for scene, part, light in every)
    assert measured_s / 2 < seconds < measured_s * 2


def test_points_that_are_there_tell_the_time_of_samples_and_nothing_else():
    """On a GPU the reference takes most of the time; with a point measured, it was left out of the estimate."""
    preset = find_experiment("figure10").presets["paper"]

    def point(scene, status, sampling_s):
        seconds = partial(guess, scene, preset, 0, "cuda:0")
        return survey.Planned(scene, "", "a", status, sampling_s, expected_work(scene, preset), seconds)

    fresh = [point(scene, "", 0.0) for scene in ("fairy", "buddha")]
    rough, known = survey.seconds_left(fresh)
    assert (known, rough / 2 < survey.seconds_left([point("cloth", "ok", 1.0), *fresh])[0] < rough * 2) == (False, True)


def test_a_busy_machine_is_named_in_the_first_line(monkeypatch, tmp_path):
    monkeypatch.setattr(survey.os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(survey.os, "getloadavg", lambda: (2.4, 0.0, 0.0))
    assert survey.busy("cpu") == ""
    monkeypatch.setattr(survey.os, "getloadavg", lambda: (7.5, 0.0, 0.0))
    scene = write_scene(tmp_path / "tetra.obj")
    chosen = options(tmp_path / "out", [scene], [Entry("uniform_grid")])
    line = survey.announcement(chosen, survey.survey(chosen))
    assert line.endswith("The machine is busy (load 7.5 on 2 cores): CPU times will be too long")
    assert "\n" not in line
    monkeypatch.delattr(survey.os, "sched_getaffinity")  # as on macOS
    monkeypatch.setattr(survey.os, "cpu_count", lambda: 3)
    assert "on 3 cores" in survey.busy("cpu")


@pytest.mark.parametrize(("taken", "said"), [(1, ", 1 of 3 rounds: the budget of 5 s was spent"), (3, "")])
def test_a_budget_that_ends_before_the_last_round_is_named(taken, said):
    record = Record.__new__(Record)
    object.__setattr__(record, "rounds", [{"round": i} for i in range(taken)])
    object.__setattr__(record, "point", {"rounds": 3, "budget_s": 5.0})
    assert Bar()._short(record) == said


def test_the_triangles_of_a_ply_are_those_of_its_header(tmp_path):
    path = tmp_path / "mesh.ply"
    path.write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nelement face 69451\nend_header\n")
    assert time_estimate.expected_triangles(str(path)) == 69451
    path.write_bytes(b"other" * 1000)
    assert time_estimate.expected_triangles(str(path)) == 5000 // time_estimate.BYTES
