"""The parent's end of a worker: replies that come late or are none, and what a lost worker leaves."""

import subprocess
from pathlib import Path

import pytest
from shadowbench.harness.runner.workers.handle import Remote, WorkerError, WorkerLostError

REPLY = '{"ok": true, "room": 0.5}\n'


@pytest.fixture
def worker(tmp_path: Path):
    """A worker that writes nothing: a test puts its replies into the queue."""
    remote = Remote("any", tmp_path / "log")
    remote._process = subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    yield remote
    remote.stop()


def test_a_reply_that_came_while_this_process_stood_still_counts(worker) -> None:
    worker.send(do="free")
    worker._replies.put(REPLY)
    worker._asked -= 1000.0  # it was asked for so long ago
    assert worker.receive(1.0)["ok"]


def test_the_wait_for_the_machine_does_not_count(worker) -> None:
    worker.send(do="free")
    worker._asked -= 1000.0  # only a wait that was said makes up for it
    for line in ('{"waiting": "until another has measured"}', '{"waiting": ""}', REPLY):
        worker._replies.put(line)
    assert worker.receive(100.0)["ok"]
    assert worker.running


def test_the_last_words_of_a_worker_are_its_own(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("a line of an earlier run\n")
    worker = Remote("any", tmp_path / "log")
    process = worker._start()
    process.kill()
    process.wait()
    worker.send(do="free")
    with pytest.raises(WorkerLostError, match="was killed by signal 9") as lost:
        worker.receive(120.0)
    assert "earlier run" not in lost.value.reason


@pytest.mark.parametrize("line", ["5", "[]", "null", "nonsense", "[" * 100_000, '{"ok": true'])
def test_a_line_that_is_no_reply_ends_the_worker(worker, line: str) -> None:
    """As a method may write that has got hold of the pipe."""
    worker._replies.put(line + "\n")
    worker.send(do="free")
    with pytest.raises(WorkerLostError, match="the worker wrote something that is not a reply"):
        worker.receive(120.0)
    assert not worker.running


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ('{"ok": true}', "no record can hold what the worker replied: it has no room"),
        ('{"ok": true, "room": "much"}', "no record can hold what the worker replied: room is 'much', not a number"),
        ('{"error": "odd", "reason": "\\ud800"}', "?"),
        ('{"error": 5}', ""),
    ],
)
def test_a_reply_of_another_shape_fails_its_command(worker, line: str, reason: str) -> None:
    worker._replies.put(line + "\n")
    worker.send(do="free")
    with pytest.raises(WorkerError) as failed:
        worker.receive(120.0)
    assert (failed.value.status, failed.value.reason) == ("failed", reason)
    assert worker.running
