"""Runs on one machine at the same time: no one works while another measures."""

from __future__ import annotations

import errno
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest
from shadowbench.harness.runner import runner as run_module
from shadowbench.harness.runner.machine_lock import FOLDER, HALTING, WAITING, Turn
from shadowbench.harness.runner.worker_process import Remote, WorkerLostError

STEP_S = 0.02

OTHER = """
    import sys, time
    from pathlib import Path
    from shadowbench.harness.runner.machine_lock import Turn
    turn, log = Turn(Path(sys.argv[1])), open(sys.argv[2], "a", buffering=1)
    def note(what):
        print(time.monotonic(), what, file=log)
"""


def other(folder: Path, log: Path, body: str) -> subprocess.Popen:
    """Another process with its own turn in the same folder."""
    code = textwrap.dedent(OTHER) + textwrap.dedent(body)
    return subprocess.Popen([sys.executable, "-c", code, str(folder), str(log)])


def spans(log: Path, what: str) -> list[tuple[float, float]]:
    """(start, end) of what a process noted as "what (" and "what )"."""
    times = [float(line.split()[0]) for line in log.read_text().splitlines() if line.split()[1] == what]
    return list(zip(times[::2], times[1::2], strict=True))


def overlap(one: tuple[float, float], two: tuple[float, float]) -> bool:
    return one[0] < two[1] and two[0] < one[1]


def until(condition, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.01)


def test_nobody_works_while_another_process_measures(tmp_path: Path) -> None:
    logs = [tmp_path / f"{i}.log" for i in range(3)]
    body = f"""
        with turn.shared():
            for step in range(12):
                note("work"); time.sleep({STEP_S}); note("work")
                turn.give_way()
                if step % 4 == 3:
                    with turn.alone():
                        note("measure"); time.sleep({STEP_S}); note("measure")
    """
    done = [other(tmp_path, log, body) for log in logs]
    assert [process.wait(60) for process in done] == [0, 0, 0]
    for i, mine in enumerate(logs):
        assert len(spans(mine, "measure")) == 3
        for theirs in logs[:i] + logs[i + 1 :]:
            for measured in spans(mine, "measure"):
                for span in spans(theirs, "work") + spans(theirs, "measure"):
                    assert not overlap(measured, span)


def test_those_that_only_work_do_so_side_by_side(tmp_path: Path) -> None:
    one, two = Turn(tmp_path), Turn(tmp_path)
    said: list[str] = []
    with one.shared(said.append), two.shared(said.append):
        pass
    assert not said


def test_who_waits_to_measure_is_let_in_before_those_who_go_on_working(tmp_path: Path) -> None:
    log = tmp_path / "log"
    mine = Turn(tmp_path)
    with mine.shared():
        process = other(tmp_path, log, "with turn.alone(note):\n    note('measuring')")
        until(lambda: log.exists() and HALTING in log.read_text())
        assert "measuring" not in log.read_text()
        mine.give_way()
        assert "measuring" in log.read_text()
    assert process.wait(20) == 0


def test_the_turn_of_a_process_that_was_killed_is_free(tmp_path: Path) -> None:
    log = tmp_path / "log"
    process = other(tmp_path, log, "with turn.alone():\n    note('measuring')\n    time.sleep(60)")
    until(lambda: log.exists() and "measuring" in log.read_text())
    process.kill()
    process.wait(20)
    said: list[str] = []
    with Turn(tmp_path).alone(said.append):
        pass
    assert not said


def test_sharing_within_measuring_and_twice_does_nothing(tmp_path: Path) -> None:
    turn, log = Turn(tmp_path), tmp_path / "log"
    with turn.shared(), turn.shared():
        pass
    with turn.alone():
        with turn.shared():
            turn.give_way()
        process = other(tmp_path, log, "with turn.shared(note):\n    note('in')")
        until(lambda: log.exists() and WAITING in log.read_text())
    assert process.wait(20) == 0
    assert "in" in log.read_text()


def test_after_an_error_the_turn_is_free(tmp_path: Path) -> None:
    turn = Turn(tmp_path)
    with pytest.raises(ValueError, match="no"), turn.shared(), turn.alone():
        raise ValueError("no")
    said: list[str] = []
    with Turn(tmp_path).alone(said.append):
        pass
    assert not said


def test_where_no_lock_file_can_be_had_nobody_waits(tmp_path: Path) -> None:
    turn = Turn(tmp_path / "is not there")
    with turn.shared(), turn.alone():
        turn.give_way()


def test_the_environment_names_the_folder_in_common(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    with Turn().shared():
        assert {path.name for path in tmp_path.iterdir()} == {"shadowbench-gate", "shadowbench-turn"}


def test_on_a_disk_without_locks_nobody_waits(tmp_path: Path, monkeypatch) -> None:
    def none_here(file, kind):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("shadowbench.harness.runner.machine_lock.fcntl.flock", none_here)
    turn, said = Turn(tmp_path), []
    with turn.shared(said.append), turn.alone(said.append):
        turn.give_way(said.append)
    assert not said


def test_what_others_do_for_a_process_stands_still_while_somebody_measures(tmp_path: Path) -> None:
    ticks, measured = tmp_path / "ticks", tmp_path / "measured"
    ticking = other(tmp_path, ticks, "while True:\n    note('tick')\n    time.sleep(0.005)")
    turn = Turn(tmp_path)
    try:
        until(lambda: ticks.exists() and len(ticks.read_text().splitlines()) > 3)
        with (
            turn.shared(),
            turn.pausing(
                lambda: ticking.send_signal(signal.SIGSTOP), lambda: ticking.send_signal(signal.SIGCONT)
            ),
        ):
            body = "with turn.alone():\n    note('measure'); time.sleep(0.4); note('measure')"
            assert other(tmp_path, measured, body).wait(30) == 0
            count = len(ticks.read_text().splitlines())
            until(lambda: len(ticks.read_text().splitlines()) > count + 3)
        assert turn._somebody_wants_to_measure() is False
    finally:
        ticking.kill()
        ticking.wait(10)
    ((start, end),) = spans(measured, "measure")
    times = [float(line.split()[0]) for line in ticks.read_text().splitlines() if line.endswith("tick")]
    assert not [time for time in times if start < time < end]
    assert min(times) < start
    assert max(times) > end


def test_an_interrupted_run_does_not_wait_for_whoever_measures(tmp_path: Path) -> None:
    log, halted = tmp_path / "log", threading.Event()
    turn = Turn(tmp_path)
    interrupted = []

    def grading() -> None:
        with turn.shared(), turn.pausing(halted.set, lambda: None):
            body = "with turn.alone():\n    note('measuring')\n    time.sleep(60)"
            interrupted.append(other(tmp_path, log, body))
            until(lambda: halted.is_set() and log.exists() and "measuring" in log.read_text())
            interrupted.append(time.monotonic())
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        grading()
    process, began = interrupted
    assert time.monotonic() - began < 5
    process.kill()
    process.wait(10)


def test_measuring_within_measuring_gives_nothing_up(tmp_path: Path) -> None:
    turn, log = Turn(tmp_path), tmp_path / "log"
    with turn.alone():
        with turn.alone():
            pass
        process = other(tmp_path, log, "with turn.shared(note):\n    note('in')")
        until(lambda: log.exists() and WAITING in log.read_text())
        assert "in\n" not in log.read_text()
    assert process.wait(20) == 0


def test_a_reply_that_came_while_this_process_stood_still_counts(tmp_path: Path, monkeypatch) -> None:
    worker = Remote("any", tmp_path / "log")
    try:
        worker.ask(60.0, do="free")
        worker.send(do="free")
        worker._asked -= 100.0  # so long ago
        assert worker.receive(1.0) == {"ok": True}
    finally:
        worker.stop()


def test_the_last_words_of_a_worker_are_its_own(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("a line of an earlier run\n")
    worker = Remote("any", tmp_path / "log")
    try:
        worker.ask(60.0, do="free")
        process = worker._process
        assert process is not None
        process.kill()
        process.wait(10)
        worker.send(do="free")
        with pytest.raises(WorkerLostError) as lost:
            worker.receive(10.0)
        assert "earlier run" not in lost.value.reason
    finally:
        worker.stop()


def test_a_worker_that_is_paused_is_not_too_slow(tmp_path: Path) -> None:
    worker = Remote("any", tmp_path / "log")
    try:
        worker.ask(60.0, do="free")
        worker.pause()
        worker.send(do="free")
        threading.Timer(1.5, worker.resume).start()
        began = time.monotonic()
        assert worker.receive(0.5) == {"ok": True}
        assert time.monotonic() - began > 1.0
        worker.pause()
        worker.resume()
        worker.send(do="free")
        assert worker.receive(60.0) == {"ok": True}
        assert worker.generation == 1
    finally:
        worker.stop()


def test_a_run_takes_its_rounds_alone_and_does_the_rest_shared(tmp_path, monkeypatch) -> None:
    from shadowbench.harness.commands.run import plan_run

    turn = Turn(tmp_path)
    monkeypatch.setattr(run_module, "TURN", turn)
    told: list[tuple[str, bool, bool]] = []

    class Watching(run_module.Run):
        def _command(self, worker, **command):
            told.append((command["do"], turn.sharing, turn.measuring))
            return super()._command(worker, **command)

    class Quiet:
        def steps(self, count): ...
        def doing(self, text): ...
        def note(self, text): ...
        def done(self, count=1): ...
        def point(self, record): ...

    options = plan_run(
        "table1", "quick", "cpu", ["cloth"], ["bvh"], out=tmp_path / "out", size="32x32",
        overrides={"frames": 1, "rounds": 2, "budget_s": 1.0},
    )  # fmt: skip
    Watching(options, Quiet()).go()
    kinds = {kind for kind, _, _ in told}
    assert {"load", "prepare", "round", "free"} <= kinds
    for kind, sharing, measuring in told:
        assert (sharing, measuring) == ((False, True) if kind == "round" else (True, False)), kind
    assert not turn.sharing
    assert not turn.measuring
