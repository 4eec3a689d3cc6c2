"""What is said while a run goes on, in which order scenes are measured, and the estimate of what is left."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.experiment_records import record_of
from helpers.tiny_runs import options, write_scene
from shadowbench.harness.results.record import Record
from shadowbench.harness.results.schema import checked
from shadowbench.harness.runner import progress
from shadowbench.harness.runner.experiment import Entry
from shadowbench.harness.runner.progress import Bar, Silent, counted
from shadowbench.harness.runner.runner import Run
from shadowbench.harness.runner.workload import Estimate, expected_work
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


def test_the_estimate_is_said_once_there_is_one(clock, capsys):
    bar = Bar()
    bar.note("first")
    bar.note("")
    bar.left(50.0)
    clock[0] += 10.0
    bar.note("then")
    bar.left(600.0)
    bar.note("later")
    assert said(capsys) == [
        "[   0 s] first",
        "[  10 s, about 40 s left] then",
        "[  10 s, about 10 min left] later",
    ]


def test_a_point_is_told_with_its_time_or_with_what_went_wrong(clock, capsys):
    bar = Bar()
    bar.point(checked(Record, record_of("table1", Entry("warp_bvh"), ms=12.345)))
    bar.point(checked(Record, record_of("table1", Entry("warp_bvh"), status="rejected")))
    assert said(capsys) == [
        "[   0 s] cloth, warp_bvh: 12.5 ms per frame",
        "[   0 s] cloth, warp_bvh: rejected: needs 9 pairs",
    ]


def test_the_estimate_scales_what_was_measured():
    estimate = Estimate(100.0)
    assert estimate.left() is None
    estimate.skipped(20.0)
    assert estimate.left() is None
    estimate.measured(10.0, 3.0)
    assert estimate.left() == pytest.approx(21.0)
    estimate.measured(70.0, 7.0)
    assert estimate.left() == 0.0


def test_small_scenes_are_measured_first_and_records_come_in_the_order_declared(tmp_path):
    small = write_scene(tmp_path / "small.obj")
    points = np.random.default_rng(1).random((300, 3))
    np.savez(tmp_path / "large.npz", V=points, F=np.arange(300).reshape(-1, 3))
    measured = []

    class Noted(Silent):
        def point(self, record):
            measured.append(record.scene["name"])

    scenes = [str(tmp_path / "large.npz"), small]
    records = Run(options(tmp_path / "out", scenes, ["warp_bvh"], rounds=1), Noted()).go()
    assert measured == ["small", "large"]
    assert [record.scene["name"] for record in records] == ["large", "small"]


def test_the_work_of_a_scene_is_known_before_it_is_made(tmp_path):
    preset = options(tmp_path, [], [], width=256, height=256, frames=2, rounds=1).preset
    assert list(TRIANGLES) == scene_names()
    work = [
        expected_work(name, preset)
        for name in ("bunny", "sibenik", "cloth", "balls-300k", "buddha", "balls-2m")
    ]
    assert work == sorted(work)
    declared = tmp_path / "a.toml"
    declared.write_text('mesh = "cloth"\n')
    assert all(expected_work(str(path), preset) > 0 for path in (declared, tmp_path, "nowhere.ply"))


@pytest.mark.parametrize("name", ["sibenik", "cloth"])
def test_the_triangles_of_a_stand_in_are_those_it_has(name):
    prepared = prepare(resolve(name))
    assert prepared.triangle_count == TRIANGLES[name]
    assert (prepared.frame_count > 1) == (name in ANIMATED)
