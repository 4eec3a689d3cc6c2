"""Launches in several threads of a CPU: parts of one pass at the same time.

Warp runs a kernel on a CPU in the thread that launches it, and Python's lock is released while it runs. Warp's atomics are
plain instructions there: parts that run at the same time must write different words, or use :func:`raise_entry`-like
instructions of their own, or write the same value.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import warp as wp

MOST_THREADS = 16
"""Threads of one frame: each share of its work has queues of its own."""

Launch = Callable[[], None]


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def cpu_threads(wanted: int, device: str) -> int:
    """Threads that run a pass on a device: on a CPU ``wanted``, or with 0 one for each processor; 1 on other devices."""
    if wp.get_device(device).is_cuda:
        return 1
    return min(MOST_THREADS, wanted or processors())


def check_threads(threads: int) -> None:
    """Raise ValueError if this is no number of threads of a CPU; 0: one for each core."""
    if threads < 0:
        raise ValueError("threads must be 0 (all cores) or more")


@functools.cache
def _pool(workers: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(workers, thread_name_prefix="launch")


def beside(launches: Sequence[Launch]) -> Launch:
    """A launch of several parts, each in a thread of its own. At first in one, since kernels may have to be compiled."""
    if len(launches) == 1:
        return launches[0]
    known = False

    def launch() -> None:
        nonlocal known
        if known:
            _run(launches)
        else:
            for part in launches:
                part()
            known = True

    return launch


def _run(launches: Sequence[Launch]) -> None:
    pool = _pool(len(launches) - 1)
    others = [(part, pool.submit(part)) for part in launches[1:]]
    try:
        launches[0]()
    finally:
        # A part that no thread has begun runs here: the pool of a process that was forked has no threads.
        for part, future in others:
            if future.cancel():
                part()
            else:
                future.result()
