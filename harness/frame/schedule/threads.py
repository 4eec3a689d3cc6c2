"""Launches in several threads of a CPU: parts of one pass at the same time.

Warp runs a kernel on a CPU in the thread that launches it, and Python's lock is released while it runs. Warp's atomics are
plain instructions there: parts that run at the same time must write different words, or use :func:`raise_entry`-like
instructions of their own, or write the same value.
"""

import contextlib
import functools
import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import warp as wp

MOST_THREADS = 16  # threads of one frame: each share of its work has queues of its own

Launch = Callable[[], None]


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def cpu_threads(wanted: int, device: str) -> int:
    """Threads that run a pass on a device: on a CPU ``wanted``, or with 0 one for each processor; 1 on other devices."""
    if wp.get_device(device).is_cuda:
        return 1
    return min(MOST_THREADS, wanted or processors())


def ranges(count: int, parts: int) -> list[tuple[int, int]]:
    """``count`` elements in at most so many ranges of about the same length: the first of each, and how many it has."""
    cuts = sorted({count * k // parts for k in range(parts + 1)})
    return [(first, end - first) for first, end in itertools.pairwise(cuts)]


def threads_given(*parameters: Any) -> int:
    """The ``threads`` of a method's parameters (0: one for each processor); 1 where it has no such parameter."""
    return next((given.threads for given in parameters if hasattr(given, "threads")), 1)


def check_threads(threads: int) -> None:
    """Raise ValueError if this is no number of threads of a CPU; 0: one for each core."""
    if threads < 0:
        raise ValueError("threads must be 0 (all cores) or more")


@functools.cache
def _pool(workers: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(workers, thread_name_prefix="launch")


def at_once(launches: Sequence[Launch]) -> Launch:
    """A launch of several parts, each in a thread of its own. At first in one, since kernels may have to be compiled."""
    known = False

    def launch() -> None:
        nonlocal known
        launch_parts(launches, known)
        known = True

    return launch


def in_ranges(launch: Callable[[int, int], None], count: int, threads: int, device: str) -> Launch:
    """A launch of ``launch(first, number)`` for ``count`` elements: on a CPU in ``threads`` (:func:`cpu_threads`)."""
    parts = ranges(count, cpu_threads(threads, device))
    return at_once([functools.partial(launch, *part) for part in parts])


def launch_parts(launches: Sequence[Launch], compiled: bool) -> None:
    """Launch several parts, each in a thread of its own if their kernels are compiled; else one after another."""
    if not compiled or len(launches) < 2:
        for part in launches:
            part()
        return
    # The stack waits for every part, even if another one fails.
    with contextlib.ExitStack() as ends:
        pool = _pool(len(launches) - 1)
        for part in launches[1:]:
            ends.callback(_finish, part, pool.submit(part))
        launches[0]()


def _finish(part: Launch, future: Future[None]) -> None:
    """Wait for a part. One that no thread has begun runs here: the pool of a process that was forked has no threads."""
    if future.cancel():
        part()
    else:
        future.result()
