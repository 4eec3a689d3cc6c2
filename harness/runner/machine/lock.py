"""A lock per machine: several runs may prepare and score at the same time, but only one runs while it takes samples.

A run that makes scenes, compiles or scores would disturb the times of another run on the same machine. So every working
process holds the lock in shared mode, releases it for a process that waits to measure, and measures in exclusive mode.
The lock consists of files in the system's folder for temporary files, or in the folder given by the environment variable
``SHADOWBENCH_TURNS``; containers that share a machine must be given a common folder. The lock is released when its
process ends, for whatever reason. If the files cannot be created, there is no locking.

It uses flock. The shared lock of the filelock package is a database that must be writable for every user of the machine,
prefers shared over waiting exclusive users, and fails on file systems without locks.
"""

import contextlib
import fcntl
import os
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil

from ...errors import UserError

FOLDER = "SHADOWBENCH_TURNS"  # the environment variable that gives the folder of the lock files
PASSING_S = 0.05  # seconds after which a message says that this process waits; passing the gate takes less
LOWEST = 19  # what is added to the niceness of a process, so that it gets the time that others leave

FREE, SHARED, EXCLUSIVE = 0, fcntl.LOCK_SH, fcntl.LOCK_EX

WHAT_FOR = {SHARED: "has taken its samples", EXCLUSIVE: "has finished its current step"}
"""What this process waits for, by the requested mode of the lock."""


class InUse(UserError):
    """Another process has the machine, and this one does not wait."""


class MachineLock:
    """The lock on the machine, as held by this process.

    folder  folder of the lock files; only processes with the same folder exclude each other
    of      what is locked, in the files' names; empty: the machine. A GPU that several runs may use has a lock of its own
    say     called with a message when this process begins to wait, and with an empty text when it stops waiting
    wait    False: raise :class:`UserError` instead of waiting
    held    FREE, SHARED or EXCLUSIVE
    waited  seconds that this process has waited

    There are two lock files. A process that wants to measure locks the first one ("gate"), so that no other process can
    begin a step, and waits for the second one. Every process passes the gate before it locks the second file.
    """

    def __init__(self, folder: Path | None = None, of: str = ""):
        self.folder, self.of = folder, of
        self.say: Callable[[str], object] = lambda text: text and print(f"shadowbench: {text}", file=sys.stderr)
        self.held, self.wait, self.waited = FREE, True, 0.0
        self._beside = False
        self._files: tuple[int, int] | None = None

    def shared(self) -> contextlib.AbstractContextManager[None]:
        """Hold the lock in shared mode: no other process measures meanwhile. Inside :meth:`exclusive` it does nothing."""
        return self._holding(self.held or SHARED)

    def exclusive(self) -> contextlib.AbstractContextManager[None]:
        """Hold the lock exclusively, to measure: all other processes have finished their step and wait."""
        return self._holding(EXCLUSIVE)

    def released(self) -> contextlib.AbstractContextManager[None]:
        """Release the lock while waiting for other processes that take it themselves."""
        return self._holding(FREE)

    @contextlib.contextmanager
    def restored(self) -> Iterator[None]:
        """Give back at the end what :meth:`share` took within. Also a decorator, for functions that a script may call."""
        with self._holding(self.held):
            yield

    def share(self) -> None:
        """Hold the lock in shared mode until :meth:`release` or the end of the process."""
        self._change(self.held or SHARED)

    def share_beside(self, device: str) -> None:
        """As :meth:`share`, for a command that times nothing. On a CPU it waits for nobody: while another process
        measures it goes on without the lock, at the lowest priority, and that process notes the load of the machine. On
        a GPU it waits, since kernels of two processes take turns whatever their priority, and no load shows it.
        """
        self._beside = device == "cpu" and self.wait
        if self.held == FREE:
            self._share()

    def release(self) -> None:
        self._beside = False
        self._change(FREE)

    def give_way(self) -> None:
        """Between two steps of shared work: let a waiting process measure first. In other modes it does nothing."""
        if self.held == SHARED:
            self._change(FREE)
            self._share()

    def _share(self) -> None:
        """Take the lock in shared mode; beside a process that measures, go on without it."""
        try:
            self._change(SHARED, wait=self.wait and not self._beside)
        except InUse:
            if not self._beside:
                raise
            os.nice(LOWEST)

    @contextlib.contextmanager
    def _holding(self, kind: int) -> Iterator[None]:
        before = self.held
        self._change(kind)
        try:
            yield
        except KeyboardInterrupt:
            before = FREE  # an interrupted process does not wait for the lock
            raise
        finally:
            self._change(before)

    def _change(self, kind: int, wait: bool | None = None) -> None:
        files = self._open() if kind != self.held else None
        if files is not None:
            gate, turn = files
            _unlock(turn)
            self.held = FREE
            if kind:
                try:
                    for file in files:
                        self._lock(file, kind, self.wait if wait is None else wait)
                finally:
                    _unlock(gate)
        self.held = kind

    def _lock(self, file: int, kind: int, wait: bool) -> None:
        end = time.monotonic() + PASSING_S
        while not _locked(file, kind):
            if time.monotonic() < end:
                time.sleep(PASSING_S / 5)
                continue
            who, advice = in_the_way(file)
            if not wait:
                raise InUse(f"the machine is in use by {who}{advice}; wait for its end, or leave out --no-wait")
            self.say(f"waiting until {who} {WHAT_FOR[kind]}{advice}")
            fcntl.flock(file, kind)
            self.waited += time.monotonic() - end
            self.say("")
            return

    def _open(self) -> tuple[int, int] | None:
        if self._files is None:
            folder = self.folder or Path(os.environ.get(FOLDER) or tempfile.gettempdir())
            of = f"-{self.of}" if self.of else ""
            with contextlib.suppress(OSError):
                self._files = (_opened(folder / f"shadowbench-gate{of}"), _opened(folder / f"shadowbench-turn{of}"))
        return self._files


def in_the_way(file: int) -> tuple[str, str]:
    """Which process holds a lock file, and what to do if that process is suspended."""
    with contextlib.suppress(psutil.Error, IndexError):  # the process may end meanwhile
        others = holders(file)
        suspended = [process for process in others if process.status() == psutil.STATUS_STOPPED]
        first = (suspended or others)[0]
        command = " ".join(Path(word).name if i < 2 else word for i, word in enumerate(first.cmdline()))
        who = f"process {first.pid} ({' '.join(command.split())[:60]})"
        advice = f"; it is suspended: kill -CONT {first.pid} continues it, kill {first.pid} ends it"
        return who, advice if suspended else ""
    return "another process", ""


def holders(file: int) -> list[psutil.Process]:
    """The other processes that lock a file, from Linux's list, which psutil lacks; empty on other systems."""
    found: list[psutil.Process] = []
    number = os.fstat(file).st_ino
    with contextlib.suppress(OSError, ValueError, psutil.Error):
        for words in map(str.split, Path("/proc/locks").read_text().splitlines()):
            if words[1] == "FLOCK" and words[5].endswith(f":{number}") and int(words[4]) != os.getpid():
                found.append(psutil.Process(int(words[4])))
    return found


def _locked(file: int, kind: int) -> bool:
    """Try to lock the file without waiting. On a file system without locks this always succeeds."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except OSError as error:
        return not isinstance(error, BlockingIOError)
    return True


def _unlock(file: int) -> None:
    with contextlib.suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_UN)


def _opened(path: Path) -> int:
    """Open a file to lock it. It may belong to another user and need not be writable. Anyone may have put something
    else in the folder for temporary files: opening a pipe would wait for its writer.
    """
    how = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK
    try:
        file = os.open(path, how)
    except FileNotFoundError:
        return os.open(path, how | os.O_CREAT, 0o644)
    if stat.S_ISREG(os.fstat(file).st_mode):
        return file
    os.close(file)
    raise UserError(f"{path}: not a regular file; remove it, or set {FOLDER} to another folder")


MACHINE = MachineLock()  # the lock of this process
