"""The process between a run and a worker: whatever ends one of the two, nothing that the worker has started stays.

``python -m shadowbench.harness.runner.workers.guard PID``, where PID is the run, becomes two processes: the worker,
and this one, which waits for its end. A method is somebody else's code and may start processes of its own. These hold
the pipe of the worker's replies, and would outlive it; here they are ended with it, also those that have made
themselves orphans or a session of their own. The guard ends as the worker has ended: with its exit code or by its
signal.
"""

import contextlib
import ctypes
import gc
import os
import resource
import signal
import sys
from typing import NoReturn

PARENT_DIES, TAKE_ORPHANS = 1, 36  # prctl of Linux: a signal when the parent ends; to adopt orphaned descendants


def main() -> None:
    """Fork: the worker in one process, its guard in the other."""
    run, here = int(sys.argv[1]), os.getpid()
    signal.signal(signal.SIGTERM, lambda *_: _end(-signal.SIGTERM))
    _prctl(PARENT_DIES, signal.SIGTERM)
    _prctl(TAKE_ORPHANS, 1)
    if os.getppid() != run:  # it has ended before
        return
    worker = os.fork()
    if worker:
        _guard(worker)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _prctl(PARENT_DIES, signal.SIGKILL)  # even during a launch
    if os.getppid() == here:
        gc.disable()  # a search for garbage finds none in what is imported, and takes a sixth of the time
        from .executor import main as work

        gc.freeze()
        gc.enable()
        work()


def _guard(worker: int) -> NoReturn:
    null = os.open(os.devnull, os.O_RDWR)
    for pipe in (0, 1):  # their ends are the worker's
        os.dup2(null, pipe)
    ended, status = os.wait()
    while ended != worker:
        ended, status = os.wait()  # an orphan
    _end(os.waitstatus_to_exitcode(status))


def _end(code: int) -> NoReturn:
    """End all descendants, then this process, with an exit code or, where it is negative, by a signal."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # it ends already
    import psutil  # not before it is needed: there is a guard for every worker

    here = psutil.Process()
    with contextlib.suppress(ChildProcessError):
        while True:  # until there is none: one that is being ended may just have started another
            for one in here.children(recursive=True):
                with contextlib.suppress(psutil.NoSuchProcess):
                    one.kill()
            os.wait()
    if code < 0:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # the worker has left one already, if any
        if -code != signal.SIGKILL:
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(code)


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value)


if __name__ == "__main__":
    main()
