"""A folder for the temporary files of a run's workers, which goes with the run.

A worker may be ended at any moment, and leaves what the libraries in it have put into the folder for temporary files, such
as the compiled headers of kernels. So workers get a folder of their own there. It is removed when this process ends; if
this process is killed, the next run removes it. Whether a folder is still in use is told by a lock on it.
"""

import atexit
import contextlib
import fcntl
import os
import shutil
import tempfile
from pathlib import Path

from ..machine import lock as machine_lock

PREFIX = "shadowbench-scratch-"

_made: dict[int, tuple[Path, int]] = {}  # folder, open and locked, by process: a copy of a process has none


def environment() -> dict[str, str]:
    """A worker's environment: this one's, with another folder for temporary files, but the locks of all runs."""
    locks = os.environ.get(machine_lock.FOLDER) or tempfile.gettempdir()
    return {**os.environ, machine_lock.FOLDER: locks, "TMPDIR": str(folder())}


def folder() -> Path:
    """The folder of this process, made at the first call."""
    while os.getpid() not in _made:
        remove_abandoned()
        path = Path(tempfile.mkdtemp(prefix=PREFIX))
        with contextlib.suppress(FileNotFoundError):
            lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.flock(lock, fcntl.LOCK_SH)
            os.stat(path)  # another process may have taken it for abandoned before it was locked
            _made[os.getpid()] = path, lock
    return _made[os.getpid()][0]


@atexit.register
def remove() -> None:
    path, lock = _made.pop(os.getpid(), (None, -1))
    if path is not None:
        shutil.rmtree(path, ignore_errors=True)
        os.close(lock)


def remove_abandoned() -> None:
    """Remove the folders of this user's runs that were killed."""
    for path in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):
            here = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC | os.O_NOFOLLOW)
            try:
                found = os.fstat(here)
                if found.st_uid == os.geteuid() and not found.st_mode & 0o077:
                    fcntl.flock(here, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(path, ignore_errors=True)
            finally:
                os.close(here)
