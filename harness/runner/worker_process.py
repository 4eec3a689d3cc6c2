"""The parent's end of a worker process: start it, ask it, give it up when it is silent or dead."""

from __future__ import annotations

import contextlib
import json
import math
import queue
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import IO, Any

GRACE_S = 0.5
"""How long a reply may be on its way after its time, seconds."""

POLL_S = 60.0
"""A wait without an end is made of waits of this many seconds."""

PACKAGE = __name__.rsplit(".", 1)[0]


class WorkerError(Exception):
    """A command came to nothing. ``status`` is the status of the point's record; the text is the reason."""

    def __init__(self, status: str, reason: str):
        super().__init__(reason)
        self.status = status
        self.reason = reason


class WorkerLostError(WorkerError):
    """The worker is gone, and with it everything that it had prepared."""


class Remote:
    """One worker process. It starts with the first request and again with the first after it was lost.

    ``generation`` counts the starts: what was prepared in an earlier one is gone.
    """

    def __init__(self, name: str, log: Path):
        self.name = name
        self.log = log
        self._process: subprocess.Popen[str] | None = None
        self._replies: queue.Queue[str | None] = queue.Queue()
        self._asked = 0.0
        self._log_start = 0
        self.generation = 0

    @property
    def running(self) -> bool:
        """Whether there is a process that has not been lost."""
        return self._process is not None

    def ask(self, timeout: float, **command: Any) -> dict[str, Any]:
        """Send a command and wait for its reply, at most ``timeout`` seconds.

        Raises :class:`WorkerError` with the reason that the worker gave, :class:`WorkerLostError` where it died or
        stayed silent; it is stopped then.
        """
        self.send(**command)
        return self.receive(timeout)

    def send(self, **command: Any) -> None:
        """Send a command without waiting; :meth:`receive` must follow."""
        process = self._process or self._start()
        self._asked = time.monotonic()
        try:
            assert process.stdin is not None
            process.stdin.write(json.dumps(command) + "\n")
            process.stdin.flush()
        except OSError:
            pass  # it is dead: receive() finds the end of its output and says so

    def receive(self, timeout: float) -> dict[str, Any]:
        """The reply to the last command, within ``timeout`` seconds. Waiting for the machine does not count."""
        reply = self._reply(timeout)
        while "waiting" in reply:
            self._asked = math.inf if reply["waiting"] else time.monotonic()
            reply = self._reply(timeout)
        if "error" in reply:
            raise WorkerError(reply["error"], reply["reason"])
        return reply

    def _reply(self, timeout: float) -> dict[str, Any]:
        line = self._line(timeout)
        if line is None:
            raise WorkerLostError("failed", self._epitaph())
        try:
            return json.loads(line)
        except ValueError:
            self.stop()
            reason = f"the worker said something else than a reply: {line.strip()[:80]}"
            raise WorkerLostError("failed", reason) from None

    def _line(self, timeout: float) -> str | None:
        """The next line that the worker wrote; None at the end of its output."""
        while (left := self._asked + timeout - time.monotonic()) > 0:
            with contextlib.suppress(queue.Empty):
                return self._replies.get(timeout=min(left, POLL_S))
        # This process may itself have been suspended, and the reply be here all the while.
        with contextlib.suppress(queue.Empty):
            return self._replies.get(timeout=GRACE_S)
        self.stop()
        raise WorkerLostError("timeout", f"no answer within {timeout:g} s; the worker was stopped")

    def _start(self) -> subprocess.Popen[str]:
        self.log.parent.mkdir(parents=True, exist_ok=True)
        with open(self.log, "ab") as log:
            self._log_start = log.tell()
            self._process = subprocess.Popen(
                [sys.executable, "-m", f"{PACKAGE}.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                encoding="utf-8",
                # Ctrl-C is the parent's to handle: it stops its workers in order.
                start_new_session=True,
            )
        self.generation += 1
        self._replies = queue.Queue()
        assert self._process.stdout is not None
        threading.Thread(target=_pump, args=(self._process.stdout, self._replies), daemon=True).start()
        return self._process

    def _epitaph(self) -> str:
        assert self._process is not None
        code = self._process.wait()
        self._process = None
        lines = self.log.read_bytes()[self._log_start :].decode("utf-8", errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        how = f"was killed by signal {-code}" if code < 0 else f"exited with code {code}"
        return f"the worker {how}" + (f": {last[:200]}" if last else "")

    def stop(self) -> None:
        """End the process, at once."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                try:
                    if pipe:
                        pipe.close()
                except OSError:
                    pass


def _pump(stream: IO[str], replies: queue.Queue[str | None]) -> None:
    try:
        for line in stream:
            replies.put(line)
    except ValueError:
        pass  # closed by stop()
    replies.put(None)
