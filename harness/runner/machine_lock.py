"""The lock on the machine: runs at the same time share it, but while one takes samples it has the machine alone.

A run that makes scenes, compiles or grades would falsify what another one measures beside it. So a process that works
holds the lock shared with all others, gives way where somebody waits to measure, and measures holding it exclusively.
The lock is on files in the system's folder of temporary files, or in the one that the environment names
(``SHADOWBENCH_TURNS``: for containers that share a machine). It goes with the process that held it, however that
ended. Where no such file can be had, nobody waits.

It is made with flock: the lock of the filelock package that can be shared is a database which must be writable for
every user of the machine, lets those who share it in before who waits to have it alone, and fails where a disk has
no locks.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil

from ..errors import UserError

FOLDER = "SHADOWBENCH_TURNS"
"""The variable of the environment that names the folder of lock files."""

PASSING_S = 0.05
"""Others need no longer to pass the gate, seconds: who waits longer is told so."""

FREE, SHARED, EXCLUSIVE = 0, fcntl.LOCK_SH, fcntl.LOCK_EX

WHAT_FOR = {SHARED: "has taken its samples", EXCLUSIVE: "comes to the end of a step"}
"""What the process that is in the way is waited for, by how the lock is wanted."""


def _to_stderr(text: str) -> None:
    if text:
        print(f"shadowbench: {text}", file=sys.stderr)


class MachineLock:
    """The lock as this process holds it.

    folder  where the lock files lie; processes with the same one heed each other
    say     is given a line where this process begins to wait, and an empty text when it need wait no longer
    wait    False: raise :class:`UserError` instead of waiting
    held    FREE, SHARED or EXCLUSIVE
    waited  seconds that this process has waited

    Two files: who wants to measure holds the gate and waits for the others to leave; who wants to share passes it.
    """

    def __init__(self, folder: Path | None = None):
        self.folder = folder
        self.say: Callable[[str], None] = _to_stderr
        self.wait = True
        self.held = FREE
        self.waited = 0.0
        self._files: tuple[int, int] | None = None

    @contextlib.contextmanager
    def shared(self) -> Iterator[None]:
        """Work beside others, but not while one of them measures. Inside :meth:`exclusive` it does nothing."""
        with self._holding(self.held or SHARED):
            yield

    @contextlib.contextmanager
    def exclusive(self) -> Iterator[None]:
        """Measure: the others have come to the end of a step, and begin none."""
        with self._holding(EXCLUSIVE):
            yield

    @contextlib.contextmanager
    def released(self) -> Iterator[None]:
        """Wait for processes that hold the lock themselves, which could not while this one has it."""
        with self._holding(FREE):
            yield

    def share(self) -> None:
        """Work beside others from here on, to the end of the process or to :meth:`release`."""
        self._change(self.held or SHARED)

    def release(self) -> None:
        """Hold the lock no longer."""
        self._change(FREE)

    def give_way(self) -> None:
        """Let whoever waits measure first. For between the steps of work that is shared; elsewhere it does nothing."""
        if self.held == SHARED:
            self._change(FREE)
            self._change(SHARED)

    @contextlib.contextmanager
    def _holding(self, kind: int) -> Iterator[None]:
        before = self.held
        self._change(kind)
        try:
            yield
        except KeyboardInterrupt:
            before = FREE  # who is interrupted waits for nobody
            raise
        finally:
            self._change(before)

    def _change(self, kind: int) -> None:
        if kind == self.held:
            return
        files = self._open()
        if files is not None:
            gate, turn = files
            _unlock(turn)
            self.held = FREE
            if kind:
                try:
                    self._lock(gate, kind)
                    self._lock(turn, kind)
                finally:
                    _unlock(gate)
        self.held = kind

    def _lock(self, file: int, kind: int) -> None:
        end = time.monotonic() + PASSING_S
        while not _locked(file, kind):
            if time.monotonic() < end:
                time.sleep(PASSING_S / 5)
                continue
            who, advice = in_the_way(file)
            if not self.wait:
                raise UserError(
                    f"the machine is in use by {who}{advice}; wait for its end, or leave out --no-wait"
                )
            self.say(f"waiting until {who} {WHAT_FOR[kind]}{advice}")
            fcntl.flock(file, kind)
            self.waited += time.monotonic() - end
            self.say("")
            return

    def _open(self) -> tuple[int, int] | None:
        if self._files is None:
            folder = self.folder or Path(os.environ.get(FOLDER) or tempfile.gettempdir())
            with contextlib.suppress(OSError):
                self._files = _opened(folder / "shadowbench-gate"), _opened(folder / "shadowbench-turn")
        return self._files


def in_the_way(file: int) -> tuple[str, str]:
    """Which process holds a lock file, and what to do where that process is suspended."""
    with contextlib.suppress(psutil.Error, IndexError):  # it may end while it is looked at
        others = holders(file)
        suspended = [process for process in others if process.status() == psutil.STATUS_STOPPED]
        first = (suspended or others)[0]
        command = " ".join(Path(word).name if i < 2 else word for i, word in enumerate(first.cmdline()))
        who = f"process {first.pid} ({' '.join(command.split())[:60]})"
        advice = f"; it is suspended: kill -CONT {first.pid} lets it go on, kill {first.pid} ends it"
        return who, advice if suspended else ""
    return "another process", ""


def holders(file: int) -> list[psutil.Process]:
    """The other processes that hold a lock on a file, as Linux lists them; none where the system does not say.

    psutil does not tell who holds a lock.
    """
    found: list[psutil.Process] = []
    number = os.fstat(file).st_ino
    with contextlib.suppress(OSError, ValueError, psutil.Error):
        for line in Path("/proc/locks").read_text().splitlines():
            words = line.split()
            if words[1] == "FLOCK" and words[5].endswith(f":{number}") and int(words[4]) != os.getpid():
                found.append(psutil.Process(int(words[4])))
    return found


def _locked(file: int, kind: int) -> bool:
    """Whether the file could be locked at once. On a disk that has no locks everything can."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def _unlock(file: int) -> None:
    with contextlib.suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_UN)


def _opened(path: Path) -> int:
    """A file to lock, whoever made it: for that it need not be writable."""
    try:
        return os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return os.open(path, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)


MACHINE = MachineLock()
"""This process's."""
