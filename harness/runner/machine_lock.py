"""Whose turn it is: runs on one machine at the same time share it, but while one takes samples it has it alone.

A run that makes scenes, compiles or grades would falsify what another one measures beside it. So a process that works
holds the machine's turn together with all others, gives way where somebody waits to measure, and measures alone. The
turn is a lock on a file in the system's folder of temporary files, or in the one that the environment names
(``SHADOWBENCH_TURNS``: for containers that share a machine). It goes with the process that held it, however that
ended. Where no such file can be had, nobody waits.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

Said = Callable[[str], None]

FOLDER = "SHADOWBENCH_TURNS"
"""The variable of the environment that names the folder of lock files."""

POLL_S = 0.05
"""How often it is asked whether somebody wants to measure, seconds."""

WAITING = "waiting until another run on this machine has taken its samples"
HALTING = "waiting until the other runs on this machine come to the end of a step"


def _unsaid(text: str) -> None: ...


class Turn:
    """The turn of this process. ``folder``: where the lock files lie; processes with the same one heed each other.

    Two files: who wants to measure holds the gate and waits for the others to leave; who wants to share passes it.
    """

    def __init__(self, folder: Path | None = None):
        self.folder = folder
        self.sharing = False
        self.measuring = False
        self._files: tuple[int, int] | None = None

    @contextlib.contextmanager
    def shared(self, say: Said = _unsaid) -> Iterator[None]:
        """Work beside others, but not while one of them measures. Within itself, or :meth:`alone`, it does nothing."""
        if self.sharing or self.measuring:
            yield
            return
        self._take(fcntl.LOCK_SH, say)
        self.sharing = True
        try:
            yield
        finally:
            self.sharing = False
            self._leave()

    def give_way(self, say: Said = _unsaid) -> None:
        """Let whoever waits measure first. For between the steps of work that is shared; elsewhere it does nothing."""
        if self.sharing:
            self._leave()
            self._take(fcntl.LOCK_SH, say)

    @contextlib.contextmanager
    def pausing(self, stop: Callable[[], None], go: Callable[[], None]) -> Iterator[threading.Lock]:
        """Long work that other processes do for this one: ``stop`` halts them while somebody measures, ``go`` ends that.

        Both are called by another thread, never while the lock that this yields is held: for starting processes. Inside,
        the turn is that thread's: nothing else of this class may be called.
        """
        starting, ended = threading.Lock(), threading.Event()
        shared = True

        def watch() -> None:
            nonlocal shared
            while not ended.wait(POLL_S):
                if self._somebody_wants_to_measure():
                    with starting:
                        stop()
                        try:
                            self._leave()
                            shared = self._take(fcntl.LOCK_SH, _unsaid, ended)
                        finally:
                            go()

        if not self.sharing:
            yield starting
            return
        watching = threading.Thread(target=watch, daemon=True)
        watching.start()
        try:
            yield starting
        finally:
            ended.set()
            watching.join()
        # Not where an error ends it all (Ctrl-C, say): that does not wait for anybody.
        if not shared:
            self._take(fcntl.LOCK_SH, _unsaid)

    @contextlib.contextmanager
    def alone(self, say: Said = _unsaid) -> Iterator[None]:
        """Measure: the others have come to the end of a step, and begin none. Shared again afterwards if it was before."""
        if self.measuring:
            yield
            return
        shared, self.sharing = self.sharing, False
        if shared:
            self._leave()
        self._take(fcntl.LOCK_EX, say)
        self.measuring = True
        try:
            yield
        finally:
            self.measuring = False
            self._leave()
            if shared:
                self._take(fcntl.LOCK_SH, say)
                self.sharing = True

    def _take(self, kind: int, say: Said, ended: threading.Event | None = None) -> bool:
        """Wait for the turn; False where ``ended`` was set before it came."""
        files = self._open()
        if files is None:
            return True
        gate, turn = files
        try:
            return _lock(gate, kind, say, WAITING, ended) and _lock(
                turn, kind, say, WAITING if kind == fcntl.LOCK_SH else HALTING, ended
            )
        finally:
            _unlock(gate)

    def _somebody_wants_to_measure(self) -> bool:
        files = self._open()
        return files is not None and not _locked(files[0], fcntl.LOCK_SH, keep=False)

    def _leave(self) -> None:
        if self._files is not None:
            _unlock(self._files[1])

    def _open(self) -> tuple[int, int] | None:
        if self._files is None:
            folder = self.folder or Path(os.environ.get(FOLDER) or tempfile.gettempdir())
            try:
                self._files = (
                    _opened(folder / "shadowbench-gate"),
                    _opened(folder / "shadowbench-turn"),
                )
            except OSError:
                return None
        return self._files


def _locked(file: int, kind: int, keep: bool = True) -> bool:
    """Whether the file could be locked at once. On a disk that has no locks everything can."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    if not keep:
        _unlock(file)
    return True


def _unlock(file: int) -> None:
    with contextlib.suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_UN)


def _lock(file: int, kind: int, say: Said, waiting: str, ended: threading.Event | None) -> bool:
    """Lock the file, and say so if that takes longer than others take to pass. False where ``ended`` came first."""
    for _ in range(5):
        if _locked(file, kind):
            return True
        time.sleep(POLL_S / 5)
    say(waiting)
    if ended is None:
        fcntl.flock(file, kind)
        return True
    while not ended.wait(POLL_S):
        if _locked(file, kind):
            return True
    return False


def _opened(path: Path) -> int:
    """A file to lock, whoever made it: for that it need not be writable."""
    try:
        return os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return os.open(path, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)


TURN = Turn()
"""This process's."""
