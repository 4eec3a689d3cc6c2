"""Runs on one machine at the same time: no one works while another measures."""

import contextlib
import errno
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers.tiny_runs import options, write_scene
from helpers.waiting import PATIENCE_S, until
from shadowbench.harness.commands.explain import explain
from shadowbench.harness.errors import UserError
from shadowbench.harness.runner import run as run_module
from shadowbench.harness.runner.machine.lock import EXCLUSIVE, FOLDER, FREE, MACHINE, SHARED, MachineLock
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.workers import pool as workers

STEP_S = 0.02
STEP_ENDS, SAMPLES_TAKEN = "has finished its current step", "has taken its samples"

OTHER = """
    import sys, time
    from pathlib import Path
    from shadowbench.harness.runner.machine.lock import MachineLock
    lock, log = MachineLock(Path(sys.argv[1])), open(sys.argv[2], "a", buffering=1)
    def note(what):
        print(time.monotonic(), what, file=log)
    lock.say = note
"""


def other(folder: Path, log: Path, body: str) -> subprocess.Popen:
    """Another process with a lock on the same folder."""
    code = textwrap.dedent(OTHER) + textwrap.dedent(body)
    return subprocess.Popen([sys.executable, "-c", code, str(folder), str(log)])


def lock_on(folder: Path) -> tuple[MachineLock, list[str]]:
    """A lock of this process, and what it says."""
    lock, said = MachineLock(folder), []
    lock.say = said.append
    return lock, said


def spans(log: Path, what: str) -> list[tuple[float, float]]:
    """(start, end) of what a process noted as "what (" and "what )"."""
    noted = [line.split() for line in log.read_text().splitlines()]
    times = [float(words[0]) for words in noted if words[1:] == [what]]
    return list(zip(times[::2], times[1::2], strict=True))


def overlap(one: tuple[float, float], two: tuple[float, float]) -> bool:
    return one[0] < two[1] and two[0] < one[1]


def noted(log: Path, text: str) -> bool:
    return log.exists() and text in log.read_text()


def until_noted(log: Path, text: str) -> None:
    until(lambda: noted(log, text), text)


MEASURE = "with lock.exclusive():\n    note('measuring')\n    time.sleep(600)"


@contextlib.contextmanager
def measuring(folder: Path) -> Iterator[subprocess.Popen]:
    """Another process that measures; it is killed at the end."""
    process = other(folder, folder / "log", MEASURE)
    try:
        until_noted(folder / "log", "measuring")
        yield process
    finally:
        process.kill()
        process.wait(PATIENCE_S)


def test_nobody_works_while_another_process_measures(tmp_path: Path) -> None:
    logs = [tmp_path / f"{i}.log" for i in range(3)]
    body = f"""
        with lock.shared():
            for step in range(12):
                note("work"); time.sleep({STEP_S}); note("work")
                lock.give_way()
                if step % 4 == 3:
                    with lock.exclusive():
                        note("measure"); time.sleep({STEP_S}); note("measure")
    """
    done = [other(tmp_path, log, body) for log in logs]
    assert [process.wait(PATIENCE_S) for process in done] == [0, 0, 0]
    for i, mine in enumerate(logs):
        assert len(spans(mine, "measure")) == 3
        for theirs in logs[:i] + logs[i + 1 :]:
            for measured in spans(mine, "measure"):
                for span in spans(theirs, "work") + spans(theirs, "measure"):
                    assert not overlap(measured, span)


def test_who_waits_to_measure_is_let_in_before_those_who_go_on_working(tmp_path: Path) -> None:
    log = tmp_path / "log"
    mine, said = lock_on(tmp_path)
    with mine.shared():
        process = other(tmp_path, log, "with lock.exclusive():\n    note('measuring'); time.sleep(0.5)")
        until_noted(log, STEP_ENDS)
        assert not noted(log, "measuring")
        mine.give_way()
        assert noted(log, "measuring")
    assert process.wait(PATIENCE_S) == 0
    assert [bool(text) for text in said] == [True, False], "an empty text says that the wait is over"


def test_whoever_waits_reads_for_which_process_and_what_to_do(tmp_path: Path) -> None:
    waiting = tmp_path / "waiting"
    with measuring(tmp_path) as process:
        others = [other(tmp_path, waiting, "with lock.shared():\n    note('in')")]
        until_noted(waiting, f"waiting until process {process.pid} (")
        assert noted(waiting, SAMPLES_TAKEN)
        assert not noted(waiting, "suspended")
        process.send_signal(signal.SIGSTOP)
        others.append(other(tmp_path, waiting, "with lock.shared():\n    note('in')"))
        until_noted(waiting, f"it is suspended: kill -CONT {process.pid} continues it")
    assert [one.wait(PATIENCE_S) for one in others] == [0, 0]


def test_who_will_not_wait_is_refused(tmp_path: Path) -> None:
    lock, said = lock_on(tmp_path)
    lock.wait = False
    with measuring(tmp_path) as process:
        refused = rf"^the machine is in use by process {process.pid} \(.*leave out --no-wait$"
        with pytest.raises(UserError, match=refused):
            lock.share()
    lock.share()
    assert (lock.held, said) == (SHARED, []), "the lock of a process that was killed is free"
    lock.release()
    assert lock.held == FREE


def test_what_times_nothing_waits_for_nobody_on_a_cpu(tmp_path: Path, monkeypatch) -> None:
    waiting, nicer = tmp_path / "waiting", []
    monkeypatch.setattr(os, "nice", nicer.append)
    lock, said = lock_on(tmp_path)
    with measuring(tmp_path) as process:
        lock.share_beside("cpu")
        lock.give_way()
        assert (lock.held, said, nicer) == (FREE, [], [19])
        lock.release()
        lock.wait = False
        with pytest.raises(UserError, match="is in use"):
            lock.share_beside("cpu")
        waits = other(tmp_path, waiting, "lock.share_beside('cuda:0')")
        until_noted(waiting, f"waiting until process {process.pid} (")
    assert waits.wait(PATIENCE_S) == 0
    lock.wait = True
    lock.share_beside("cpu")
    assert (lock.held, nicer) == (SHARED, [19]), "alone it holds the lock, so that who measures next waits for its step"
    lock.release()


def test_what_times_nothing_goes_on_when_who_measures_comes_later(tmp_path: Path, monkeypatch) -> None:
    log, nicer = tmp_path / "log", []
    monkeypatch.setattr(os, "nice", nicer.append)
    lock, said = lock_on(tmp_path)
    lock.share_beside("cpu")
    process = other(tmp_path, log, MEASURE)
    try:
        until_noted(log, STEP_ENDS)
        lock.give_way()
        until_noted(log, "measuring")
        assert (lock.held, said, nicer) == (FREE, [], [19])
    finally:
        process.kill()
        process.wait(PATIENCE_S)


def test_sharing_within_measuring_and_twice_does_nothing(tmp_path: Path) -> None:
    lock, log = MachineLock(tmp_path), tmp_path / "log"
    with lock.shared(), lock.shared():
        pass
    with lock.exclusive():
        with lock.shared(), lock.exclusive():
            lock.give_way()
        lock.share()
        process = other(tmp_path, log, "with lock.shared():\n    note('in')")
        until_noted(log, SAMPLES_TAKEN)
        assert not noted(log, "in\n")
    assert process.wait(PATIENCE_S) == 0
    assert noted(log, "in\n")


def test_after_an_error_the_lock_is_free_in_the_folder_that_the_environment_names(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    lock = MachineLock()
    with pytest.raises(ValueError, match="no"), lock.shared(), lock.exclusive():
        raise ValueError("no")
    assert {path.name for path in tmp_path.iterdir()} == {"shadowbench-gate", "shadowbench-turn"}
    free, said = lock_on(tmp_path)
    with free.exclusive():
        pass
    assert said == []


@pytest.mark.parametrize("reason", ["no folder", "no locks on the disk"])
def test_where_no_lock_can_be_had_nobody_waits(tmp_path: Path, monkeypatch, reason: str) -> None:
    def none_here(file, kind):
        raise OSError(errno.ENOLCK, "No locks available")

    if reason != "no folder":
        monkeypatch.setattr("shadowbench.harness.runner.machine.lock.fcntl.flock", none_here)
    lock, said = lock_on(tmp_path / "is not there" if reason == "no folder" else tmp_path)
    with lock.shared(), lock.exclusive():
        lock.give_way()
    assert said == []


def test_an_interrupted_run_does_not_wait_for_whoever_measures(tmp_path: Path) -> None:
    lock = MachineLock(tmp_path)
    with contextlib.ExitStack() as still:
        with pytest.raises(KeyboardInterrupt), lock.shared(), lock.released():  # noqa: PT012
            process = still.enter_context(measuring(tmp_path))
            raise KeyboardInterrupt
        assert process.poll() is None, "it measures still"
        assert lock.held == FREE


# --- whole runs -----------------------------------------------------------------------------------------------


def test_a_run_takes_its_rounds_alone_and_does_the_rest_shared(tmp_path, monkeypatch) -> None:
    """Grading is done under locks of the graders' own: this process has none that they would wait for."""
    lock, send = MachineLock(tmp_path), workers.Workers.send
    close, charge = run_module.Run._close, run_module.charged_records
    for module in (run_module, workers):
        monkeypatch.setattr(module, "MACHINE", lock)
    held: dict[str, set[int]] = {}

    def watched(crew, worker, **command):
        send(crew, worker, **command)
        held.setdefault(command["do"], set()).add(lock.held)

    def closed(run, job):
        held.setdefault("close", set()).add(lock.held)
        close(run, job)

    def charged(*arguments):
        held.setdefault("charge", set()).add(lock.held)
        return charge(*arguments)

    monkeypatch.setattr(workers.Workers, "send", watched)
    monkeypatch.setattr(run_module.Run, "_close", closed)
    monkeypatch.setattr(run_module, "charged_records", charged)
    scene = write_scene(tmp_path / "tetra.obj")
    run_module.Run(options(tmp_path / "out", [scene], ["uniform_grid"], frames=1, score=True), Silent()).go()
    wanted = {"load": SHARED, "prepare": SHARED, "round": EXCLUSIVE, "grade": FREE, "free": SHARED}
    wanted |= {"close": SHARED, "charge": SHARED}
    assert held == {kind: {one} for kind, one in wanted.items()}
    assert lock.held == FREE


def test_who_waits_to_measure_is_let_in_before_the_next_record_is_written(tmp_path, monkeypatch) -> None:
    lock, close = MachineLock(tmp_path), run_module.Run._close
    for module in (run_module, workers):
        monkeypatch.setattr(module, "MACHINE", lock)
    other, said = lock_on(tmp_path)
    threads, measured = [], []

    def measure() -> None:
        with other.exclusive():
            until(lambda: lock.held == FREE, "that the other says so, which it does once it has let go")
            measured.append(lock.held)

    def closed(run, job):
        close(run, job)
        if not threads:
            threads.append(threading.Thread(target=measure))
            threads[0].start()
            until(lambda: said, "another that waits")
        else:
            assert measured == [FREE]

    monkeypatch.setattr(run_module.Run, "_close", closed)
    chosen = options(tmp_path / "out", [write_scene(tmp_path / "tetra.obj")], ["uniform_grid", "warp_bvh"], frames=1)
    assert len(run_module.Run(chosen, Silent()).go()) == 2
    threads[0].join(PATIENCE_S)


def test_graders_wait_while_another_process_measures(tmp_path, monkeypatch) -> None:
    """Their time limit stands still meanwhile."""
    from shadowbench.harness.runner.workers.handle import Remote

    monkeypatch.setenv(FOLDER, str(tmp_path))
    load = {
        "do": "load", "scene": write_scene(tmp_path / "tetra.obj"), "scene_dir": None, "frames": 1, "width": 8, "height": 8,
        "shared": str(tmp_path / "scene.npz"), "lighting": {}, "make": True,
    }  # fmt: skip
    worker, lock = Remote("grading", tmp_path / "grading.log"), MachineLock(tmp_path)
    try:
        worker.send(do="free")
        worker.receive(PATIENCE_S)
        with lock.exclusive():
            worker.send(**load, share=True)
            reply = worker._reply(PATIENCE_S)
            assert reply["waiting"].startswith(f"waiting until process {os.getpid()} (")
            worker._replies.put('{"waiting": "again"}')  # as if receive() had read it
            time.sleep(0.3)
            assert worker._replies.qsize() == 1, "it has not begun"
            worker._asked -= 1000.0
        assert "scene" in worker.receive(PATIENCE_S)
    finally:
        worker.stop()


def test_a_command_called_from_a_script_does_not_keep_the_lock(tmp_path: Path) -> None:
    """Its arguments are read before it takes the lock; that there is no such frame is found while it holds it."""
    with pytest.raises(UserError, match="--frame 99"):
        explain(write_scene(tmp_path / "tetra.obj"), "0,0", frame=99, size="8x8", device="cpu")
    assert MACHINE.held == FREE


@pytest.mark.parametrize("name", ["shadowbench-gate", "shadowbench-turn"])
def test_a_pipe_in_the_place_of_a_lock_file_holds_nobody_up(tmp_path, name):
    os.mkfifo(tmp_path / name)
    lock, _ = lock_on(tmp_path)
    with pytest.raises(UserError, match=f"{name}: not a regular file; remove it, or set {FOLDER}"):
        lock.share()
