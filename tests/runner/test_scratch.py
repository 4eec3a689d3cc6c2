"""The folder for the temporary files of workers goes with its run, also when that is killed."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from helpers.waiting import until
from shadowbench.harness.runner.machine import lock as machine_lock
from shadowbench.harness.runner.workers import scratch
from shadowbench.harness.runner.workers.handle import Remote

LEAVE = (
    "import os, signal, sys; from shadowbench.harness.runner.workers import scratch;"
    "place = scratch.folder(); (place / 'wp_pch_a').mkdir(); print(place, flush=True); {}"
)


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(scratch, "_made", {})
    yield tmp_path
    scratch.remove()


def started(end: str) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-c", LEAVE.format(end)], stdout=subprocess.PIPE, text=True)


def test_it_is_removed_at_the_end(temporary):
    with started("") as process:
        assert process.stdout.read().startswith(str(temporary))
    assert list(temporary.iterdir()) == []


def test_the_next_run_removes_it_where_a_run_was_killed(temporary):
    with started("os.kill(os.getpid(), signal.SIGKILL)") as process:
        process.wait()
    (left,) = temporary.iterdir()
    assert (left / "wp_pch_a").is_dir()
    own = scratch.folder()
    assert list(temporary.iterdir()) == [own]


def test_what_is_in_use_or_not_ours_stays(temporary):
    with subprocess.Popen(
        [sys.executable, "-c", LEAVE.format("sys.stdin.read()")],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        in_use = process.stdout.readline().strip()
        (temporary / f"{scratch.PREFIX}file").write_text("a file")
        (temporary / f"{scratch.PREFIX}folder").mkdir()
        (temporary / "elsewhere").mkdir(mode=0o700)
        (temporary / f"{scratch.PREFIX}link").symlink_to(temporary / "elsewhere")
        os.mkfifo(temporary / f"{scratch.PREFIX}pipe")
        before = set(temporary.iterdir())
        scratch.remove_abandoned()
        assert set(temporary.iterdir()) == before
        assert os.path.isdir(in_use)
        process.stdin.close()


def test_one_that_is_taken_for_abandoned_as_it_is_made_is_made_again(temporary, monkeypatch):
    make, made = tempfile.mkdtemp, []

    def raced(prefix):
        made.append(make(prefix=prefix))
        if len(made) < 3:
            os.rmdir(made[-1])
        return made[-1]

    monkeypatch.setattr(tempfile, "mkdtemp", raced)
    assert str(scratch.folder()) == made[2]
    assert list(temporary.iterdir()) == [scratch.folder()]


def test_a_worker_has_it_and_locks_the_machine_where_all_do(tmp_path, monkeypatch):
    monkeypatch.delenv(machine_lock.FOLDER, raising=False)
    found = scratch.environment()
    assert found["TMPDIR"] == str(scratch.folder())
    assert found[machine_lock.FOLDER] == str(tmp_path)
    worker = Remote("any", tmp_path / "logs" / "any.log")
    process = worker._start()
    try:
        given = until(Path(f"/proc/{process.pid}/environ").read_text, "the environment of a process that begins")
        assert f"TMPDIR={scratch.folder()}" in given.split("\0")
    finally:
        os.kill(process.pid, signal.SIGKILL)
        worker.stop()
