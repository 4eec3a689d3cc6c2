"""What is said while a run goes on, in which order scenes are measured, and the estimate of what is left."""

import numpy as np
import pytest
from helpers.experiment_records import record_of
from helpers.tiny_runs import options, write_scene
from shadowbench.harness.results.record import Record
from shadowbench.harness.results.schema import checked
from shadowbench.harness.runner import progress
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.runner.planning.time_estimate import PIXEL, Estimate, Unit, expected_work
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


def test_the_estimate_has_a_fixed_time_and_one_in_proportion_to_the_work():
    """Seconds of a point: 2 + work / 10, of which the samples take at most 20."""
    units = [Unit(float(work), 4, 20.0) for work in (10, 100, 1000, 10, 100)]
    now = [0.0]
    estimate = Estimate(units, lambda: now[0])

    def finished(unit: int, measured: int, seconds: float) -> float | None:
        estimate.begin(units[unit])
        now[0] += seconds
        estimate.finish(measured)
        return estimate.left()

    assert estimate.left() is None
    assert finished(3, 0, 0.0) is None
    assert finished(0, 4, 4 * 3.0) == pytest.approx(4 * 3.0 * (2 * 10**0.5 + 10.0))
    assert finished(1, 2, 2 * 12.0) == pytest.approx(4 * 12.0 + 4 * 22.0)
    estimate.begin(units[4])
    now[0] += 47.0
    estimate.once = 7.0  # of starting a process
    assert estimate.left_within(4, 8.0) == pytest.approx(8.0 + 4 * 22.0)
    now[0] += 8.0
    estimate.finish(4)
    assert finished(2, 4, 88.0) == 0.0


@pytest.mark.parametrize("seconds", [lambda w: 0.4 + w / 5e5, lambda w: 0.7, lambda w: 0.02 + w**0.7 / 3e3])
def test_the_estimate_holds_within_a_factor_of_two(seconds):
    """The work of a sweep over triangles and pixels, smallest first, as experiments with further presets have it."""
    work = [2.0 * (n + PIXEL * side * side) for side in (64, 128, 256) for n in (1e3, 1e4, 1e5)]
    units = [Unit(one, 5) for one in work]
    now = [0.0]
    estimate, rest = Estimate(units, lambda: now[0]), sum(5 * seconds(one) for one in work)
    for place, unit in enumerate(units[:-1]):
        took = 5 * seconds(unit.work)
        estimate.begin(unit)
        now[0] += took / 2
        if place > 1:
            assert 0.5 < estimate.left_within(5, took / 2) / (rest - took / 2) < 2.0
        now[0] += took / 2
        estimate.finish(5)
        rest -= took
        if place > 0:
            assert 0.5 < estimate.left() / rest < 2.0


def test_a_run_has_an_estimate_at_every_step_and_measures_small_scenes_first(tmp_path):
    """After preparing, after every round and every scene; the records come in the order declared."""
    small = write_scene(tmp_path / "small.obj")
    points = np.random.default_rng(1).random((300, 3))
    np.savez(tmp_path / "large.npz", V=points, F=np.arange(300).reshape(-1, 3))
    given, measured = [], []

    class Noted(Silent):
        def left(self, seconds):
            given.append(seconds)

        def point(self, record):
            measured.append(record.scene["name"])

    scenes = [str(tmp_path / "large.npz"), small]
    records = Run(options(tmp_path / "out", scenes, ["warp_bvh"], frames=1, rounds=3), Noted()).go()
    assert measured == ["small", "large"]
    assert [record.scene["name"] for record in records] == ["large", "small"]
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
