"""Read scene files in a process of its own, so that no file can end this one, hold it up or fill its memory.

Files come from anywhere, and the libraries that decode them are large. A helper process (:mod:`.readers.helper`) reads
them within limits on memory and time, and sends back the arrays. Whatever happens to it is one line here, which names the
file. It is started for the first file, used for all others, and ended with this process.
"""

import atexit
import contextlib
import itertools
import os
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from os.path import exists, isfile
from pathlib import Path
from typing import Any

from ...errors import UserError, warn
from . import helper
from .checks import Loaded, broken, some

MEMORY, TIME = "SHADOWBENCH_READ_GIB", "SHADOWBENCH_READ_SECONDS"
"""Environment variables that give other limits on reading one file or sequence."""

GIB = 1 << 30
LEAST_MEMORY, MEMORY_SHARE, MOST_MEMORY = 2 * GIB, 32, 16 * GIB
"""Bytes that a reader may take: at least these, and so many times the size of its files, up to a maximum."""

LEAST_SECONDS, SECONDS_PER_MB = 20, 2.0  # seconds of the processor that a reader may take, and more for each megabyte
PATIENCE = 4  # how many times as long the clock may run: the machine may have other work, and a disk may be slow

REFERRING = (".gltf", ".usd", ".usda", ".usdc")
"""Formats whose files may refer to others; what lies beside them counts as part of them for the limits."""

MOST_BESIDE = 10_000  # files beside a file that are counted for its limits

ENVIRONMENT = {  # each thread of a machine with many cores would take address space from the limit
    "MALLOC_ARENA_MAX": "2",
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "PXR_WORK_THREAD_LIMIT": "4",
}


def load(path: str | Path, *more: Any) -> Loaded:
    """What :func:`.readers.load.load` reads. Raises :class:`UserError` as it does, and if its process fails."""
    return _read("load", [Path(path)], Path(path), *more)


def load_sequence(paths: Sequence[Path], *more: Any) -> Loaded:
    """What :func:`.readers.load.load_sequence` reads, as :func:`load`."""
    return _read("load_sequence", paths, list(paths), *more)


def _read(task: str, paths: Sequence[Path], *arguments: Any) -> Loaded:
    for path in paths:  # what is missing is reported where it is read
        if exists(path) and not (isfile(path) or path.is_dir()):
            raise UserError(f"{path}: not a regular file; give a file or a folder of frames")
    return _told(_HELPER.ask(task, arguments, paths), paths)


def _told(loaded: Loaded, named: Sequence[Path]) -> Loaded:
    """The same, after a warning where a file has led to others outside its folder."""
    homes = [path if path.is_dir() else path.parent for path in map(Path.resolve, named)]
    beyond = [str(path) for path in loaded.files if not any(path.resolve().is_relative_to(home) for home in homes)]
    if beyond:
        warn(f"{named[0]}: refers to files outside its folder: {some(beyond)}")
    return loaded


def limits(paths: Sequence[Path]) -> tuple[int, int]:
    """Bytes and seconds that reading may take: in proportion to the files, or as the environment says."""
    size = sum(_size(path) for path in paths)
    memory = min(max(LEAST_MEMORY, MEMORY_SHARE * size), MOST_MEMORY)
    seconds = LEAST_SECONDS + SECONDS_PER_MB * size / 1e6
    return int(_given(MEMORY, memory / GIB) * GIB), int(_given(TIME, seconds)) or 1


def _size(path: Path) -> int:
    """Bytes of a file and of what it may refer to beside it, or of the files in a folder."""
    folder = path if path.is_dir() else path.parent if path.suffix.lower() in REFERRING else None
    if folder is None:
        return path.stat().st_size if exists(path) else 0
    beside = (os.path.join(place, name) for place, _, names in os.walk(folder) for name in names)
    total = 0
    for name in itertools.islice(beside, MOST_BESIDE):
        with contextlib.suppress(OSError):
            found = os.lstat(name)
            total += found.st_size if stat.S_ISREG(found.st_mode) else 0
    return total


def _given(name: str, otherwise: float) -> float:
    text = os.environ.get(name)
    if not text:
        return otherwise
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1e6:
        raise UserError(f"{name}={text}: give a number above 0, or leave it unset")
    return value


class _Helper:
    """The helper process of this process, or none yet."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._line: Connection | None = None
        self._owner = 0

    def ask(self, task: str, arguments: Sequence[Any], files: Sequence[Path]) -> Any:
        """What a task returns. ``files``: those that the limits depend on; an error names the first."""
        path, (memory, seconds) = files[0], limits(files)
        request = {"task": task, "arguments": arguments, "folder": os.getcwd(), "memory": memory, "seconds": seconds}
        most = f"{memory / GIB:.3g} GiB of memory"
        with self._lock:
            line, process = self._started()
            clock = threading.Timer(PATIENCE * seconds, process.kill)
            clock.daemon = True  # this process may end before it does
            end = time.monotonic() + PATIENCE * seconds
            clock.start()
            try:
                helper.send(line, request)
                reply = helper.received(line, memory)
            except (OSError, EOFError):
                late = time.monotonic() >= end
                code = self.stop(patience=10)
                if late or code == -signal.SIGXCPU:
                    raise _beyond(path, f"takes more than {PATIENCE * seconds if late else seconds} s", TIME) from None
                how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
                way_out = f"it is damaged, nested too deep, or needs more memory: export it again, or set {MEMORY}"
                raise broken(path, f"its reader ended by {how} (within {most})", way_out) from None
            except BaseException as error:  # the rest of the answer would be taken for the next one's
                self.stop()
                if isinstance(error, MemoryError) or not isinstance(error, Exception):  # not the reader's fault
                    raise
                raise broken(path, f"its reader sent a wrong reply ({error})") from error
            finally:
                clock.cancel()
        if "memory" in reply:
            self.stop()  # what it has taken is not all given back
            raise _beyond(path, f"needs more than {most}", MEMORY)
        if "fault" in reply:
            problem = f"its reader failed ({reply['fault']:.160})"
            raise broken(path, problem, "this is a fault of the program: report it with the file")
        if "error" in reply:
            raise UserError(reply["error"])
        return reply["result"]

    def _started(self) -> tuple[Connection, subprocess.Popen[bytes]]:
        if self._owner != os.getpid():  # a copy of the process that started it
            self._process = self._line = None
        if self._process is None or self._process.poll() is not None or self._line is None:
            self.stop()
            self._line, other = Pipe()
            start = f"from {helper.__name__} import serve; serve({other.fileno()})"
            with other:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-c", start],
                    stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                    pass_fds=[other.fileno()], env={**os.environ, **ENVIRONMENT},
                )  # fmt: skip
            self._owner = os.getpid()
        return self._line, self._process

    def stop(self, patience: float = 0.0) -> int:
        """End the process, if it does not within so many seconds. What it ended with, as Popen's ``returncode``."""
        process, line = self._process, self._line
        self._process = self._line = None
        if line is not None:
            line.close()
        if process is None or self._owner != os.getpid():
            return 0
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
        process.kill()
        return process.wait()


def _beyond(path: Path, problem: str, variable: str) -> UserError:
    return broken(path, f"{problem} to read", f"make it smaller, or set {variable} to a higher limit")


_HELPER = _Helper()
atexit.register(_HELPER.stop)
