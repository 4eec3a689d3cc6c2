"""A method that starts processes: none of them holds a run up, and none is left, however the run ends."""

import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from helpers.left_processes import MARK, alive, gone, marked_environment
from helpers.tiny_runs import go, options
from helpers.waiting import until
from shadowbench.harness.results.schema import read_records
from shadowbench.harness.runner.planning.experiment import Entry
from shadowbench.harness.scene.readers.apart import load

PROMPT_S = 60.0
"""Far more than the end of a run takes, and far less than what it would wait for (``timeout_s``)."""


def entry(how: str, then: str) -> Entry:
    return Entry("forks", {"how": how, "then": then}, f"{how} {then}")


@pytest.mark.slow
def test_a_worker_that_ends_or_hangs_takes_what_it_started_along(
    package: Path, scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark, environment = marked_environment()
    load(Path(scene))  # the process that reads files for this one stays, and begins before there is a mark
    monkeypatch.setenv(MARK, environment[MARK])
    entries = [entry(how, then) for how in ("copy", "orphan", "program") for then in ("ends", "on")]
    began = time.monotonic()
    chosen = options(tmp_path, [scene], [*entries, Entry("steady", {}, "steady")], timeout_s=10 * PROMPT_S)
    records = go(chosen)
    assert time.monotonic() - began < 10 * PROMPT_S, "nothing was waited for"
    for one in entries:
        wanted = ("ok", "") if one.settings["then"] == "on" else ("failed", "the worker exited with code 3: started")
        assert (records[one.label].status, records[one.label].reason) == wanted
    assert records["steady"].status == "ok"
    assert not gone(mark)


@contextlib.contextmanager
def started(out: Path, scene: str, environment: dict[str, str], how: str) -> Iterator[subprocess.Popen[bytes]]:
    """A run whose method has started another process, and hangs; it is ended, since it holds the lock of the machine."""
    words = f"run table1 --preset quick --size 8x8 --no-score --method forks --set forks.how={how} --timeout 3600"
    command = [sys.executable, "-m", "shadowbench.harness.cli", *words.split(), "--set", "forks.then=hangs"]
    command += ["--out", str(out), "--scene", scene]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    log = out / "logs" / "forks.log"

    def there() -> bool:
        assert process.poll() is None, "the run ended early"
        return log.exists() and "started" in log.read_text()

    try:
        until(there, "the method", 900.0)
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "number"), [("orphan", signal.SIGINT), ("copy", signal.SIGTERM), ("program", signal.SIGKILL)]
)
def test_a_run_that_is_ended_leaves_none(package: Path, scene: str, tmp_path: Path, how: str, number: int) -> None:
    mark, environment = marked_environment()
    with started(tmp_path / "out", scene, environment, how) as process:
        process.send_signal(number)
        assert process.wait(PROMPT_S) == (130 if number == signal.SIGINT else -number)
    assert not gone(mark)


@pytest.mark.slow
def test_a_run_goes_on_though_a_process_that_nobody_can_find_holds_the_pipe(
    package: Path, scene: str, tmp_path: Path
) -> None:
    """The guard is killed, too, and so nobody knows of the one that is in a session of its own."""
    mark, environment = marked_environment()
    with started(tmp_path / "out", scene, environment, "orphan") as process:
        children = psutil.Process(process.pid).children()
        guards = [one for one in children if "guard" in " ".join(one.cmdline())]
        (guard,) = until(lambda: [one for one in guards if forked(one)], "an orphan")
        guard.kill()
        assert process.wait(PROMPT_S) == 1
    (record,) = read_records(tmp_path / "out")
    assert (record.status, record.reason) == ("failed", "the worker was killed by signal 9: started")
    (left,) = alive(mark)
    left.kill()
    assert not gone(mark)


def forked(guard: psutil.Process) -> bool:
    """Whether the worker of a guard has another process beside it: an orphan is the guard's own child."""
    return len(guard.children()) == 2
