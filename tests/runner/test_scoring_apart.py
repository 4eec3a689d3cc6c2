"""Scoring on processors of its own (``workers/handle.py``): it waits for nobody, and nobody for it."""

import contextlib
import errno
import os
import subprocess
from collections.abc import Iterator
from dataclasses import replace

import psutil
import pytest
from helpers.tiny_runs import options, write_scene
from helpers.waiting import PATIENCE_S
from shadowbench.harness.errors import UserError
from shadowbench.harness.results.folder import ResultsFolder
from shadowbench.harness.runner import run as run_module
from shadowbench.harness.runner.cluster.shard import introduce
from shadowbench.harness.runner.machine.lock import FOLDER, FREE, MachineLock
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.workers import handle as apart_module
from shadowbench.harness.runner.workers import pool
from shadowbench.harness.runner.workers.handle import PLACE
from shadowbench.harness.runner.workers.pool import Workers


@pytest.fixture
def apart(monkeypatch) -> Iterator[int]:
    """The number of a processor that only scoring has: this process is kept off it."""
    had = os.sched_getaffinity(0)
    if len(had) < 2:
        pytest.skip("needs two processors")
    os.sched_setaffinity(0, {min(had)})
    monkeypatch.setenv(PLACE, f"{max(had)}")
    yield max(had)
    os.sched_setaffinity(0, had)


def test_graders_on_processors_of_their_own_wait_for_nobody_and_use_no_gpu(tmp_path, monkeypatch, apart) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    chosen = replace(options(tmp_path / "out", [write_scene(tmp_path / "tetra.obj")], ["warp_bvh"]), device="cuda:0")
    crew, lock, asked = Workers(ResultsFolder(chosen.out), chosen, [apart]), MachineLock(tmp_path), dict[str, object]()
    try:
        with lock.exclusive():
            for name in ("grading.1", "warp_bvh"):
                crew.send(crew.get(name), do="free")
                asked[name] = crew.get(name)._reply(PATIENCE_S)
        assert asked["grading.1"].keys() == {"ok", "room"}
        assert "waiting" in asked["warp_bvh"]
        process = psutil.Process(crew.get("grading.1")._process.pid)
        for one in (process, *process.children()):
            assert (one.cpu_affinity(), one.environ()["CUDA_VISIBLE_DEVICES"]) == ([apart], "")
        monkeypatch.setattr(pool, "grade_command", lambda options, folder, job, device: {"device": device})
        monkeypatch.setattr(crew, "send", lambda worker, **command: asked.update(command))
        crew.score("grading.1", None)
        assert asked["device"] == "cpu"
    finally:
        crew.stop()


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ("a", "not numbers"),
        ("own", "samples are taken on"),
        ("apart,9999", "this machine, or its container, does not have all"),
        ("-1", "this machine, or its container, does not have all"),
        (f"{10**30}", "this machine, or its container, does not have all"),
    ],
)
def test_processors_for_scoring_that_cannot_be_had_are_named(given, reason, apart, monkeypatch, tmp_path) -> None:
    own = os.sched_getaffinity(0)
    given = given.replace("own", f"{min(own)}").replace("apart", f"{apart}")
    monkeypatch.setenv(PLACE, given)
    with pytest.raises(UserError, match=f"{PLACE}={given}: {reason}"):
        run_module.Run(options(tmp_path / "out", [], []), Silent())
    assert os.sched_getaffinity(0) == own


def test_processors_that_a_container_does_not_have_are_named(apart, monkeypatch, tmp_path) -> None:
    """It has some of those that the machine counts; the system refuses the others, or leaves them out."""

    def refused(process, chosen):
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))

    for given in (refused, lambda process, chosen: None):
        with monkeypatch.context() as patch:
            patch.setattr(os, "sched_setaffinity", given)
            with pytest.raises(UserError, match="or its container, does not have all of these"):
                run_module.Run(options(tmp_path / "out", [], []), Silent())


def test_a_grader_apart_begins_there(tmp_path, monkeypatch, apart) -> None:
    """Its guard makes the worker at once: on a busy machine it would be too late to move it when it runs."""
    own, begun, start = os.sched_getaffinity(0), [], subprocess.Popen

    def watched(*arguments, **more):
        begun.append(os.sched_getaffinity(0))
        return start(*arguments, **more)

    monkeypatch.setattr(subprocess, "Popen", watched)
    chosen = options(tmp_path / "out", [], [])
    crew = Workers(ResultsFolder(chosen.out), chosen, [apart])
    try:
        for name in ("grading.1", "warp_bvh"):
            crew.send(crew.get(name), do="free")
    finally:
        crew.stop()
    assert begun == [{apart}, own]
    assert os.sched_getaffinity(0) == own


def test_as_many_score_as_their_processors_allow(monkeypatch) -> None:
    monkeypatch.setattr(apart_module, "processors", lambda: 12)
    assert [apart_module.graders((), beside) for beside in (1, 2, 99)] == [6, 3, 1]
    assert [apart_module.graders((8, 9, 10, 11), beside) for beside in (1, 2, 99)] == [2, 1, 1]


def test_the_processors_for_scoring_are_asked_for_once_in_a_run(tmp_path, monkeypatch) -> None:
    """Their number gives that of the graders, which get them; runs beside this one share them."""
    asked = []
    monkeypatch.setattr(run_module, "judges_processors", lambda: asked.append(1) or [4, 5, 6, 7])
    runs = [run_module.Run(options(tmp_path / "out", [], []), Silent(), beside=n) for n in (1, 2)]
    assert ([run.graders for run in runs], len(asked)) == ([2, 1], 2)
    run = runs[0]
    assert (run.workers.apart, run.workers.get("grading.1").apart, run.workers.get("warp_bvh").apart) == (
        [4, 5, 6, 7], [4, 5, 6, 7], (),
    )  # fmt: skip


def test_a_worker_of_a_cluster_whose_scoring_has_no_place_is_given_no_shard(monkeypatch) -> None:
    """It would lose each of them, and their points would count as failed."""
    monkeypatch.setenv(PLACE, "a")
    with pytest.raises(UserError, match="not numbers of processors"):
        introduce("cpu")


def test_a_run_whose_scoring_is_apart_does_not_wait_to_end(tmp_path, monkeypatch, apart) -> None:
    """Another one measures while it compares the scores of its points, and for long after that."""
    lock, charge = MachineLock(tmp_path), run_module.charged_records
    for module in (run_module, pool):
        monkeypatch.setattr(module, "MACHINE", lock)
    with contextlib.ExitStack() as still:

        def charged(*arguments):
            still.enter_context(MachineLock(tmp_path).exclusive())
            lock.wait = False
            return charge(*arguments)

        monkeypatch.setattr(run_module, "charged_records", charged)
        scene = write_scene(tmp_path / "tetra.obj")
        (record,) = run_module.Run(options(tmp_path / "out", [scene], ["uniform_grid"], frames=1), Silent()).go()
    assert (record.status, lock.held) == ("ok", FREE)


def test_scores_by_graders_apart_are_those_of_others(tmp_path, apart, monkeypatch) -> None:
    scene = write_scene(tmp_path / "tetra.obj")
    found = []
    for out in ("apart", "among"):
        records = run_module.Run(
            options(tmp_path / out, [scene], ["uniform_grid"], frames=1, score=True), Silent()
        ).go()
        found.append([one.frames[0].score for one in records])
        monkeypatch.delenv(PLACE, raising=False)
    assert found[0] == found[1] != [None]
