"""What is said while a run goes on, in which order scenes are measured, and the estimate of what is left."""

import numpy as np
import pytest
from helpers.experiment_records import record_of
from helpers.tiny_runs import options, write_scene
from shadowbench.harness.results.record import Record
from shadowbench.harness.results.schema import checked
from shadowbench.harness.runner import progress
from shadowbench.harness.runner.planning.experiment import Entry, find_experiment
from shadowbench.harness.runner.planning.time_estimate import Estimate, expected_work, guess_of_scene, points_of
from shadowbench.harness.runner.progress import Bar, Silent, counted
from shadowbench.harness.runner.run import Run
from shadowbench.harness.scene.catalogue import resolve
from shadowbench.harness.scene.names import ANIMATED, TRIANGLES, scene_names
from shadowbench.harness.scene.prepared import prepare


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass only where a test says so."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def said(capsys) -> list[str]:
    return capsys.readouterr().err.splitlines()


def test_where_there_is_no_terminal_each_kind_of_step_is_a_line(clock, capsys):
    bar = Bar()
    for i in range(4):
        clock[0] += 4.0
        bar.doing("cloth: compiling", f"method {i}")
    bar.doing("cloth: measuring, round 1", "method 0")
    assert said(capsys) == [
        "[   4 s] cloth: compiling (method 0)",
        "[  16 s] cloth: compiling (method 3)",
        "[  16 s] cloth: measuring, round 1 (method 0)",
    ]


def test_untimed_work_is_announced_beside_the_estimate_and_has_steps_of_its_own(clock, capsys):
    bar = Bar()
    bar.more = "then untimed counts"
    bar.left(0.0)
    bar.note("timed part")
    bar.more = ""

    def work():
        for name in "abc":
            clock[0] += 20.0
            yield name

    assert "".join(counted(bar, "hard cases", work(), 3)) == "abc"
    assert said(capsys) == [
        "[   0 s, about 0 s left, then untimed counts] timed part",
        "[   0 s] hard cases (1 of 3)",
        "[  20 s, about 40 s left] hard cases (2 of 3)",
        "[  40 s, about 20 s left] hard cases (3 of 3)",
    ]


def test_the_estimate_is_said_once_there_is_one_and_a_point_with_its_time_or_what_went_wrong(clock, capsys):
    bar = Bar()
    bar.note("first")
    bar.note("")
    bar.left(50.0)
    clock[0] += 10.0
    bar.point(checked(Record, record_of("table1", Entry("warp_bvh"), ms=12.345)))
    bar.left(600.0)
    bar.point(checked(Record, record_of("table1", Entry("warp_bvh"), status="rejected")))
    assert said(capsys) == [
        "[   0 s] first",
        "[  10 s, about 40 s left] cloth, warp_bvh: 12.5 ms per frame",
        "[  10 s, about 10 min left] cloth, warp_bvh: rejected: needs 9 pairs",
    ]


def test_the_estimate_is_what_was_guessed_by_how_much_longer_it_took():
    now = [0.0]
    estimate = Estimate([10.0, 20.0, 40.0, 10.0], lambda: now[0])

    def finished(guessed: float, measured: int, seconds: float) -> float | None:
        estimate.begin(guessed, 4)
        now[0] += seconds
        estimate.finish(measured)
        return estimate.left()

    assert estimate.left() is None
    assert finished(10.0, 0, 0.0) is None
    assert finished(20.0, 2, 30.0) == pytest.approx(50.0 * 3.0)  # of half its points
    estimate.begin(10.0, 4)
    now[0] += 47.0
    estimate.once = 7.0  # of starting a process
    assert estimate.left_within(4, 10.0) == pytest.approx(10.0 + 40.0 * 80.0 / 20.0)
    now[0] += 10.0
    estimate.finish(4)
    assert finished(40.0, 4, 88.0) == 0.0


@pytest.mark.parametrize("slower", [0.25, 1.0, 4.0])
@pytest.mark.parametrize("device", ["cpu", "cuda:0"])
def test_the_estimate_of_another_machine_holds_within_a_factor_of_two(device, slower):
    """The scenes of an experiment, smallest first; on the other machine a scene takes ``slower`` times as long, and a point
    a second more.
    """
    (part,) = find_experiment("table1").presets["paper"].parts()
    scenes = sorted(part.scenes, key=lambda name: expected_work(name, part))
    guesses, points = [guess_of_scene(name, part, device) for name in scenes], points_of(part) // len(scenes)
    now, took = [0.0], [slower * one + points for one in guesses]
    estimate = Estimate(guesses, lambda: now[0])
    for place, guessed in enumerate(guesses[:-1]):
        estimate.begin(guessed, points)
        now[0] += took[place] / 2
        rest = took[place] / 2 + sum(took[place + 1 :])
        assert 0.5 < estimate.left_within(points, took[place] / 2) / rest < 2.0
        now[0] += took[place] / 2
        estimate.finish(points)
        assert 0.5 < estimate.left() / sum(took[place + 1 :]) < 2.0


def test_a_run_has_an_estimate_at_every_step_and_measures_small_scenes_first(tmp_path):
    """After preparing, after every round and every scene; the records come in the order declared. A file may grow before its
    turn comes.
    """
    small = write_scene(tmp_path / "small.obj")
    given, measured = [], []

    def write_large(count):
        points = np.random.default_rng(1).random((count, 3))
        np.savez(tmp_path / "large.npz", V=points, F=np.arange(count).reshape(-1, 3))

    class Noted(Silent):
        def left(self, seconds):
            given.append(seconds)

        def point(self, record):
            measured.append(record.scene["name"])
            write_large(600)

    write_large(300)
    scenes = [str(tmp_path / "large.npz"), small]
    records = Run(options(tmp_path / "out", scenes, ["warp_bvh"], frames=1, rounds=3), Noted()).go()
    assert measured == ["small", "large"]
    assert [record.scene["name"] for record in records] == ["large", "small"]
    assert records[0].scene["triangles"] == 200
    assert len(given) == 2 * (1 + 3 + 1)
    assert all(seconds > 0 for seconds in given[:-2])
    assert given[-2:] == [0.0, 0.0], "after the last round there is nothing left"


def test_the_work_of_a_scene_is_known_before_it_is_made(tmp_path):
    preset = options(tmp_path, [], [], width=256, height=256, frames=2, rounds=1).preset
    assert list(TRIANGLES) == scene_names()
    work = [expected_work(name, preset) for name in ("bunny", "sibenik", "cloth", "balls-300k", "buddha", "balls-2m")]
    assert work == sorted(work)
    declared = tmp_path / "a.toml"
    declared.write_text('mesh = "cloth"\n')
    assert all(expected_work(str(path), preset) > 0 for path in (declared, tmp_path, "nowhere.ply"))


@pytest.mark.parametrize("name", ["sibenik", "cloth"])
def test_the_triangles_of_a_stand_in_are_those_it_has(name):
    prepared = prepare(resolve(name))
    assert prepared.triangle_count == TRIANGLES[name]
    assert (prepared.frame_count > 1) == (name in ANIMATED)
