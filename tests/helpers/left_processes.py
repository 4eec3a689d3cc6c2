"""Processes that a program has started, and that may have outlived it: those with a mark in their environment."""

import os
import time
import uuid

import psutil

MARK = "SHADOWBENCH_TEST_MARK"


def marked_environment() -> tuple[str, dict[str, str]]:
    """A mark, and an environment with it for a program whose processes are to be found."""
    mark = uuid.uuid4().hex
    return mark, {**os.environ, MARK: mark}


def alive(mark: str) -> list[psutil.Process]:
    """The living processes with a mark, without this one."""
    found = []
    for process in psutil.process_iter():
        try:
            own = process.environ().get(MARK) == mark and process.status() != psutil.STATUS_ZOMBIE
        except psutil.Error:
            continue
        if own and process.pid != os.getpid():
            found.append(process)
    return found


def gone(mark: str, seconds: float = 60.0) -> list[psutil.Process]:
    """The processes with a mark that do not end: they have so many seconds, far more than the end of a process takes."""
    end = time.monotonic() + seconds
    while (found := alive(mark)) and time.monotonic() < end:
        time.sleep(0.05)
    return found
