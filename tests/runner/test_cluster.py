"""Runs on a cluster: the same records as on one machine; a worker, a scheduler and a network that are lost."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.tiny_runs import install_misbehaving, options, write_scene
from shadowbench.harness.errors import UserError
from shadowbench.harness.results.schema import read_records
from shadowbench.harness.runner.cluster import spool
from shadowbench.harness.runner.experiment import Entry
from shadowbench.harness.runner.progress import Silent
from shadowbench.harness.runner.runner import Run

pytest.importorskip("distributed", reason="Dask distributed is not installed: the extra `cluster`")
from shadowbench.harness.runner.cluster.head import ClusterRun
from shadowbench.harness.runner.cluster.pool import connected

PATIENCE_S = 90.0
"""How long what must happen is waited for: the machine may have much else to do."""

TTL_S = 6
"""Seconds without a heartbeat after which the scheduler gives a worker up."""


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Cluster:
    """A scheduler and workers as a person starts them, each a process; ``inside``: a command before the worker's own."""

    def __init__(self, folder: Path, pythonpath: str, host: str = "127.0.0.1"):
        self.address = f"tcp://{host}:{free_port()}"
        self.log = (folder / "dask.log").open("ab")
        settings = {"DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": f"{TTL_S}s", "PYTHONPATH": pythonpath}
        self.environment = {**os.environ, **settings}
        self.workers: list[subprocess.Popen] = []
        self.scheduler = self._start("scheduler", "--host", host, "--port", self.address.rpartition(":")[2])

    def _start(self, what: str, *words: str, inside: tuple[str, ...] = ()) -> subprocess.Popen:
        module = f"distributed.cli.dask_{what}"
        command = [*inside, sys.executable, "-m", module, *words, "--no-dashboard"]
        return subprocess.Popen(command, env=self.environment, stdout=self.log, stderr=self.log)

    def worker(self, *inside: str) -> subprocess.Popen:
        words = ("--nthreads", "1", "--resources", "CPU=1", "--memory-limit", "0", "--no-nanny")
        self.workers.append(self._start("worker", self.address, *words, inside=inside))
        return self.workers[-1]

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
        self.log.close()


@pytest.fixture
def place(tmp_path, monkeypatch):
    """The folder of a test, with a scene in it; methods of another package, and shards in a folder of their own."""
    path = install_misbehaving(tmp_path / "packages")
    monkeypatch.syspath_prepend(tmp_path / "packages")
    monkeypatch.setenv("PYTHONPATH", path)
    monkeypatch.setenv(spool.PLACE, str(tmp_path / "shards"))
    write_scene(tmp_path / "tetra.obj")
    return tmp_path


@pytest.fixture
def cluster(place):
    with contextlib.closing(Cluster(place, os.environ["PYTHONPATH"])) as one:
        yield one


def slow(place: Path, rounds: int = 3, scenes: int = 1):
    """Options of a run whose rounds take about a second each."""
    names = [str(shutil.copy(place / "tetra.obj", place / f"tetra{i}.obj")) for i in range(scenes)]
    steady = Entry("steady", {"ms": "20"}, "Steady")
    return options(place / "out", names, [steady], rounds=rounds, frames=1, samples=7, most=7, budget_s=60.0)


class Started:
    """A run in another thread; :meth:`records` waits for its end."""

    def __init__(self, pool, chosen):
        self.run = ClusterRun(pool, chosen, Silent())
        self.result: list = []
        self.error: BaseException | None = None
        self.thread = threading.Thread(target=self._go, daemon=True)
        self.thread.start()

    def _go(self) -> None:
        try:
            self.result = self.run.go()
        except BaseException as error:
            self.error = error

    def records(self):
        self.thread.join(PATIENCE_S)
        assert not self.thread.is_alive(), "the run did not end"
        if self.error is not None:
            raise self.error
        return self.result


def until(there, what: str):
    """Wait for something, and return it."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        found = there()
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError(f"waited in vain for {what}")


def rounds_taken(place: Path) -> int:
    """Rounds in the journals of the shards under way."""
    journals = (place / "shards").glob("*/journal/*.jsonl")
    return sum(text.count('"event":"round"') for text in (path.read_text() for path in journals))


def events(place: Path, kind: str) -> list[dict]:
    lines = (place / "out" / "cluster.jsonl").read_text().splitlines()
    return [event for event in map(json.loads, lines) if event["event"] == kind]


def busy_worker(started: Started, cluster: Cluster) -> subprocess.Popen:
    """The process of the worker that has the shard, by its address."""
    (address,) = [at for at, task in started.run.tasks.items() if task.shard is not None]
    process = next(one["pid"] for at, one in pids(started.run.pool).items() if at == address)
    return next(one for one in cluster.workers if one.pid == process)


def pids(pool) -> dict:
    found = pool.client.run(os.getpid)
    return {address: {"pid": pid} for address, pid in found.items()}


def test_records_and_answers_are_those_of_a_run_on_one_machine(place):
    wanted = [["warp_bvh", Entry("steady", {}, "Steady"), "raises"], {"save_answers": True, "frames": 2}]
    alone = Run(options(place / "alone", [str(place / "tetra.obj")], *wanted[:1], **wanted[1]), Silent()).go()
    chosen = options(place / "out", [str(place / "tetra.obj")], *wanted[:1], **wanted[1])
    with connected("local", "cpu") as pool:
        found = ClusterRun(pool, chosen, Silent()).go()
        before = {path: path.stat().st_mtime_ns for path in (place / "out" / "records").iterdir()}
        again = ClusterRun(pool, chosen, Silent()).go()
        assert before == {path: path.stat().st_mtime_ns for path in before}, "nothing is measured twice"
        next(path for path in before if "steady" in path.name).unlink()
        third = ClusterRun(pool, chosen, Silent()).go()
    assert [(r.key, r.status, r.reason) for r in found] == [(r.key, r.status, r.reason) for r in alone]
    assert [r.status for r in found] == ["ok", "ok", "failed"]
    assert again == found == read_in_order(place / "out", found, third[1])
    answers = sorted(path.name for path in (place / "alone" / "answers").iterdir())
    assert answers == sorted(path.name for path in (place / "out" / "answers").iterdir()) != []
    for name in answers:
        with np.load(place / "alone" / "answers" / name) as a, np.load(place / "out" / "answers" / name) as b:
            assert a.files == b.files
            assert all(a[one].tobytes() == b[one].tobytes() for one in a.files)
    (shard, _, last) = events(place, "shard")
    assert {"before", "after", "card"} <= shard.keys()
    assert "before" in last
    assert [one["card"] for r in found for one in r.rounds] == [shard["card"]] * 4
    assert found[0].environment == alone[0].environment
    assert not list((place / "shards").iterdir()), "what is delivered is removed"
    assert not (place / "out" / "journal").exists() or not list((place / "out" / "journal").iterdir())


def read_in_order(folder: Path, found, changed):
    """The records on the disk in the order of ``found``; the one that was measured anew as it was before."""
    kept = {record.key: record for record in read_records(folder)}
    assert kept[changed.key] == changed != found[1]
    return [found[1] if record.key == changed.key else kept[record.key] for record in found]


def test_a_scheduler_that_is_not_there_is_one_line(place, monkeypatch):
    monkeypatch.setattr("shadowbench.harness.runner.cluster.pool.CONNECT_S", 1.0)
    with (
        pytest.raises(UserError, match="no Dask scheduler answers there") as caught,
        connected("tcp://127.0.0.1:9", None),
    ):
        pass
    assert "\n" not in str(caught.value)


def test_a_worker_that_is_killed_is_told_and_another_takes_its_points(place, cluster):
    cluster.worker()
    with connected_when_ready(cluster) as pool:
        started = Started(pool, slow(place, scenes=2))
        until(lambda: rounds_taken(place) >= 1, "a round")
        cluster.worker()
        victim = busy_worker(started, cluster)
        victim.send_signal(signal.SIGKILL)
        records = started.records()
    assert [record.status for record in records] == ["ok", "ok"]
    (lost,) = events(place, "lost")
    assert lost["attempt"] == 1
    assert lost["reason"] == "it ended, or does not answer"
    assert {event["attempt"] for event in events(place, "shard")} == {1, 2}
    assert all(sorted(one["round"] for one in record.rounds) == [0, 1, 2] for record in records)


@contextlib.contextmanager
def connected_when_ready(cluster: Cluster):
    """The pool, as soon as the scheduler and a worker are there."""
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            context = connected(cluster.address, None)
            pool = context.__enter__()
            break
        except UserError:
            assert time.monotonic() < end, "no cluster"
            time.sleep(0.3)
    try:
        yield pool
    finally:
        context.__exit__(None, None, None)


def test_a_scheduler_that_is_killed_ends_the_run_and_the_same_command_continues(place, cluster):
    cluster.worker()
    chosen = slow(place)
    with connected_when_ready(cluster) as pool:
        started = Started(pool, chosen)
        until(lambda: rounds_taken(place) >= 1, "a round")
        cluster.scheduler.kill()
        with pytest.raises(UserError, match="connection to the scheduler was lost; 0 of 1 scenes") as caught:
            started.records()
    assert "\n" not in str(caught.value)
    assert not (place / "out" / "records").exists()
    until(lambda: cluster.workers[0].poll() is not None, "the worker's end")
    with contextlib.closing(Cluster(place, os.environ["PYTHONPATH"])) as second:
        second.worker()
        with connected_when_ready(second) as pool:
            (record,) = ClusterRun(pool, chosen, Silent()).go()
    assert record.status == "ok"
    assert started.run.run in {one["run"] for one in record.rounds}, "the rounds that were taken are kept"


def test_a_worker_that_does_not_answer_is_told_and_another_takes_its_points(place):
    """Its network is cut, where a namespace may be made for it; elsewhere its process is frozen."""
    with contextlib.ExitStack() as stack:
        inside, host, cut = stack.enter_context(namespace()) or ((), "127.0.0.1", None)
        cluster = stack.enter_context(contextlib.closing(Cluster(place, os.environ["PYTHONPATH"], host)))
        first = cluster.worker(*inside)
        pool = stack.enter_context(connected_when_ready(cluster))
        started = Started(pool, slow(place))
        until(lambda: rounds_taken(place) >= 1, "a round")
        cut() if cut else first.send_signal(signal.SIGSTOP)
        frozen = time.monotonic()
        cluster.worker()
        until(lambda: "lost" in (place / "out" / "cluster.jsonl").read_text(), "the loss")
        assert time.monotonic() - frozen < 5 * TTL_S
        # Its card's lock is free when it ends, as it does when it finds that it was given up.
        first.kill()
        (record,) = started.records()
    assert record.status == "ok"
    assert [event["reason"] for event in events(place, "lost")] == ["it ended, or does not answer"]
    assert sorted(one["round"] for one in record.rounds) == [0, 1, 2]


@contextlib.contextmanager
def namespace():
    """A network namespace with one line to this one: a command that runs inside, the address here, and a cut of the line.

    None where none may be made.
    """
    name = f"sb{os.getpid() % 10000}"
    number = os.getpid() % 250

    def ip(*words: str) -> None:
        subprocess.run(["ip", *words], check=True, capture_output=True, timeout=20)

    try:
        ip("netns", "add", name)
        ip("link", "add", f"{name}a", "type", "veth", "peer", "name", f"{name}b", "netns", name)
        ip("addr", "add", f"10.213.{number}.1/24", "dev", f"{name}a")
        ip("link", "set", f"{name}a", "up")
        ip("netns", "exec", name, "ip", "addr", "add", f"10.213.{number}.2/24", "dev", f"{name}b")
        ip("netns", "exec", name, "ip", "link", "set", f"{name}b", "up")
        ip("netns", "exec", name, "ip", "link", "set", "lo", "up")
        made = True
    except (OSError, subprocess.SubprocessError):
        made = False
    cut = functools.partial(ip, "link", "set", f"{name}a", "down")
    try:
        yield (("ip", "netns", "exec", name), f"10.213.{number}.1", cut) if made else None
    finally:
        with contextlib.suppress(OSError, subprocess.SubprocessError):
            ip("netns", "del", name)
