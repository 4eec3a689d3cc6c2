"""The parent's side of a worker process: start it, send commands, stop it if it does not reply or has died. Scoring
takes longer than samples. Where several runs take turns on a GPU (:mod:`.runner.machine.lock`), it has processors of
its own: it uses no GPU, has no share of the lock, and waits for nobody.
"""

import contextlib
import json
import math
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

from ...errors import UserError
from ...frame.schedule.threads import processors
from ...results.record import STATUSES
from . import scratch
from .protocol import UNWRITABLE, check_reply

PLACE = "SHADOWBENCH_JUDGES"
"""The environment variable that gives the numbers of these processors, as 8,9,10. A run must be kept off them, as by
``taskset``.
"""

GRACE_S = 0.5  # additional time for a reply to arrive after its time limit, or after the end of its worker, seconds
STOP_S = 5.0  # time for a worker to end with all that it has started, seconds; then it is left to itself
MOST = 1 << 26  # Characters of a reply. A method can get hold of the pipe, and what it writes is held in this process.
POLL_S = 60.0  # waiting without a time limit is done in intervals of this many seconds

PACKAGE = __name__.rsplit(".", 1)[0]


def judges_processors() -> list[int]:
    """The processors that only scoring has; none: it works between samples, where all other work is done."""
    given = os.environ.get(PLACE, "")
    if not given:
        return []
    try:
        found = sorted({int(word) for word in given.split(",")})
    except ValueError:
        raise UserError(f"{PLACE}={given}: not numbers of processors, as 8,9,10") from None
    if not hasattr(os, "sched_setaffinity"):
        raise UserError(f"{PLACE}={given}: this system does not assign processors; unset it")
    if set(found) & os.sched_getaffinity(0):
        raise UserError(f"{PLACE}={given}: samples are taken on these too; keep the run off them, as by taskset")
    had: set[int] = set()
    with contextlib.suppress(OSError, ValueError, OverflowError), kept_to(found):
        had = os.sched_getaffinity(0)
    if had != set(found):
        raise UserError(f"{PLACE}={given}: this machine, or its container, does not have all of these processors")
    return found


@contextlib.contextmanager
def kept_to(chosen: Collection[int]) -> Iterator[None]:
    """In the block this thread, and the processes that it starts, have only these processors; none chosen: as before."""
    if not chosen:
        yield
        return
    own = os.sched_getaffinity(0)
    os.sched_setaffinity(0, chosen)
    try:
        yield
    finally:
        os.sched_setaffinity(0, own)


def graders(apart: Collection[int], beside: int = 1) -> int:
    """Workers that score at a time: by the processors ``apart`` that only scoring has, or by all where there are none, which
    runs ``beside`` each other share. Each has the scene in memory.
    """
    return max(1, min(8, (len(apart) or processors()) // 2 // beside))


class WorkerError(Exception):
    """A command failed. ``status`` is the status for the record of the point; the text is the reason."""

    def __init__(self, status: str, reason: str):
        super().__init__(reason)
        self.status, self.reason = status, reason


class WorkerLostError(WorkerError):
    """The worker has ended, and everything that it had prepared is lost."""


class Remote:
    """One worker process. It starts with the first command, and again with the first command after it has ended.
    ``generation`` counts the starts; points prepared in an earlier generation are lost. ``command``: what was sent
    last. ``apart``: the only processors that it uses, and then no GPU (:mod:`.handle`).
    """

    def __init__(self, name: str, log: Path, apart: Sequence[int] = ()):
        self.name, self.log, self.apart = name, log, apart
        self._process: subprocess.Popen[str] | None = None
        self._replies: queue.Queue[str | None] = queue.Queue()
        self._asked, self.command = 0.0, ""
        self._log_start = self.generation = 0

    @property
    def running(self) -> bool:
        return self._process is not None

    def send(self, **command: Any) -> None:
        """Send a command without waiting; :meth:`receive` must follow."""
        process = self._process or self._start()
        self._asked, self.command = time.monotonic(), command["do"]
        with contextlib.suppress(OSError):  # the worker has died; receive() reports it
            assert process.stdin is not None
            process.stdin.write(json.dumps(command) + "\n")
            process.stdin.flush()

    def receive(self, timeout: float) -> dict[str, Any]:
        """The reply to the last command, within ``timeout`` seconds. Waiting for the machine lock does not count.
        Raises :class:`WorkerError` with the worker's reason, and :class:`WorkerLostError` if it died or did not reply;
        it is then stopped.
        """
        reply = self._reply(timeout)
        while "waiting" in reply:
            self._asked = math.inf if reply["waiting"] else time.monotonic()
            reply = self._reply(timeout)
        if "error" in reply:
            status = reply["error"] if reply["error"] in (*STATUSES, UNWRITABLE) else "failed"
            raise WorkerError(status, str(reply.get("reason", "")).encode(errors="replace").decode())
        try:
            check_reply(self.command, reply)
        except ValueError as error:
            raise WorkerError("failed", f"no record can hold what the worker replied: {error}") from error
        return reply

    def _reply(self, timeout: float) -> dict[str, Any]:
        line = self._line(timeout)
        if line is None:
            raise WorkerLostError("failed", self._epitaph())
        try:
            reply = json.loads(line)
        except (ValueError, RecursionError):
            reply = None
        if not isinstance(reply, dict):
            self.stop()
            reason = f"the worker wrote something that is not a reply: {line.strip()[:80]}"
            raise WorkerLostError("failed", reason)
        return reply

    def _line(self, timeout: float) -> str | None:
        """The next line that the worker wrote; None at the end of its output."""
        while (left := self._asked + timeout - time.monotonic()) > 0:
            with contextlib.suppress(queue.Empty):
                return self._replies.get(timeout=min(left, POLL_S))
        # This process may have been suspended, and the reply may have arrived meanwhile.
        with contextlib.suppress(queue.Empty):
            return self._replies.get(timeout=GRACE_S)
        self.stop()
        raise WorkerLostError("timeout", f"no answer within {timeout:g} s; the worker was stopped")

    def _start(self) -> subprocess.Popen[str]:
        self.log.parent.mkdir(parents=True, exist_ok=True)
        with open(self.log, "ab") as log, kept_to(self.apart):
            self._log_start = log.tell()
            self._process = subprocess.Popen(
                [sys.executable, "-m", f"{PACKAGE}.guard", str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                encoding="utf-8",
                errors="replace",
                env={**scratch.environment(), **({"CUDA_VISIBLE_DEVICES": ""} if self.apart else {})},
                # The parent handles Ctrl-C and stops its workers.
                start_new_session=True,
            )
        self.generation += 1
        self._replies = queue.Queue()
        threading.Thread(target=_follow, args=(self._process, self._replies), daemon=True).start()
        return self._process

    def _epitaph(self) -> str:
        assert self._process is not None
        code = self._process.wait()
        self._process = None
        lines = self.log.read_bytes()[self._log_start :].decode("utf-8", errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        how = f"was killed by signal {-code}" if code < 0 else f"exited with code {code}"
        return f"the worker {how}" + (f": {last[:200]}" if last else "")

    def end(self) -> None:
        """Have the process end, and all that it has started, at once; :meth:`stop` must follow."""
        if self._process is not None:
            self._process.terminate()  # its guard ends what it guards

    def stop(self) -> None:
        self.end()
        process, self._process = self._process, None
        if process is None:
            return
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            _end_group(process.pid)
        with contextlib.suppress(OSError):
            assert process.stdin is not None
            process.stdin.close()


def _follow(process: subprocess.Popen[str], replies: queue.Queue[str | None]) -> None:
    """Pass on the lines of a process, then None when it has ended, though another process may hold its end of the pipe."""
    reader = threading.Thread(target=_read, args=(process.stdout, replies), daemon=True)
    reader.start()
    with contextlib.suppress(ChildProcessError):  # its end was seen by :meth:`Remote.stop`
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        _end_group(process.pid)  # its guard may have been killed
    reader.join(GRACE_S)
    replies.put(None)


def _read(stream: IO[str], replies: queue.Queue[str | None]) -> None:
    with stream:
        while line := stream.readline(MOST):
            replies.put(line)


def _end_group(leader: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(leader, signal.SIGKILL)
