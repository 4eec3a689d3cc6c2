"""For tests of runs on a cluster: a scheduler and workers as processes, a run in a thread, a network that can be cut."""

import contextlib
import functools
import os
import socket
import subprocess
import sys
import threading
from pathlib import Path

from helpers.waiting import PATIENCE_S, until
from shadowbench.harness.errors import UserError
from shadowbench.harness.runner.cluster.head import ClusterRun
from shadowbench.harness.runner.cluster.pool import connected
from shadowbench.harness.runner.progress import Silent

TTL_S = 6
"""Seconds without a heartbeat after which the scheduler gives a worker up."""


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Cluster:
    """A scheduler and workers as a person starts them, each a process; ``inside``: a command before the worker's own."""

    def __init__(self, folder: Path, pythonpath: str, host: str = "127.0.0.1", scheme: str = "tcp"):
        self.address = f"{scheme}://{host}:{free_port()}"
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


@contextlib.contextmanager
def connected_when_ready(cluster: Cluster):
    """The pool, as soon as the scheduler and a worker are there."""
    with contextlib.ExitStack() as stack:

        def entered():
            with contextlib.suppress(UserError):
                return stack.enter_context(connected(cluster.address, None))

        yield until(entered, "a cluster")


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
