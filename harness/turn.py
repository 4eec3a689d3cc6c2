"""Whose turn it is: runs on one machine at the same time share it, but while one takes samples it has it alone.

A run that makes scenes, compiles or grades would falsify what another one measures beside it. So a process that works
holds the machine's turn together with all others, gives way where somebody waits to measure, and measures alone. The
turn is a lock on a file in the system's folder of temporary files: it goes with the process that held it, however that
ended. Where no such file can be had, nobody waits.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

Said = Callable[[str], None]

WAITING = "waiting until another run on this machine has taken its samples"


def _unsaid(text: str) -> None: ...


class Turn:
    """The turn of this process. ``folder``: where the lock files lie; processes with the same one heed each other.

    Two files: who wants to measure holds the gate and waits for the others to leave; who wants to share passes it.
    """

    def __init__(self, folder: Path | None = None):
        self.folder = folder or Path(tempfile.gettempdir())
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
    def alone(self, say: Said = _unsaid) -> Iterator[None]:
        """Measure: the others have come to the end of a step, and begin none. Shared again afterwards if it was before."""
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

    def _take(self, kind: int, say: Said) -> None:
        files = self._open()
        if files is None:
            return
        gate, turn = files
        for file, how in ((gate, fcntl.LOCK_EX), (turn, kind)):
            try:
                fcntl.flock(file, how | fcntl.LOCK_NB)
            except BlockingIOError:
                say(WAITING)
                fcntl.flock(file, how)
        fcntl.flock(gate, fcntl.LOCK_UN)

    def _leave(self) -> None:
        if self._files is not None:
            fcntl.flock(self._files[1], fcntl.LOCK_UN)

    def _open(self) -> tuple[int, int] | None:
        if self._files is None:
            try:
                self._files = _opened(self.folder / "shadowbench-gate"), _opened(self.folder / "shadowbench-turn")
            except OSError:
                return None
        return self._files


def _opened(path: Path) -> int:
    """A file to lock, whoever made it: for that it need not be writable."""
    try:
        return os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return os.open(path, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)


TURN = Turn()
"""This process's."""
