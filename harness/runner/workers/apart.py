"""Processors for scoring alone, so that it goes on while samples are taken.

Scoring takes longer than samples. On a GPU where several runs take turns (:mod:`.runner.machine.lock`), it would hold up all
of them. With processors of its own it uses no GPU, has no share of the lock, and waits for nobody.
"""

import contextlib
import os
from collections.abc import Collection, Iterator

from ...errors import UserError
from ...frame.schedule.threads import processors

PLACE = "SHADOWBENCH_JUDGES"
"""The environment variable that gives the numbers of these processors, as 8,9,10. A run must be kept off them, as by
``taskset``."""


def judges_processors() -> list[int]:
    """The processors that only scoring has; none: it works between samples, where all other work is done."""
    given = os.environ.get(PLACE, "")
    if not given:
        return []
    try:
        found = sorted({int(word) for word in given.split(",")})
    except ValueError:
        raise UserError(f"{PLACE}={given}: not numbers of processors, as 8,9,10") from None
    if not hasattr(os, "sched_setaffinity"):
        raise UserError(f"{PLACE}={given}: this system does not assign processors; unset it")
    if set(found) & os.sched_getaffinity(0):
        raise UserError(f"{PLACE}={given}: samples are taken on these too; keep the run off them, as by taskset")
    had: set[int] = set()
    with contextlib.suppress(OSError, ValueError, OverflowError), kept_to(found):
        had = os.sched_getaffinity(0)
    if had != set(found):
        raise UserError(f"{PLACE}={given}: this machine, or its container, does not have all of these processors")
    return found


@contextlib.contextmanager
def kept_to(chosen: Collection[int]) -> Iterator[None]:
    """In the block this thread, and the processes that it starts, have only these processors; none chosen: as before."""
    if not chosen:
        yield
        return
    own = os.sched_getaffinity(0)
    os.sched_setaffinity(0, chosen)
    try:
        yield
    finally:
        os.sched_setaffinity(0, own)


def graders(beside: int = 1) -> int:
    """Number of workers that score at the same time, by the processors for scoring, which runs ``beside`` each other share.
    Each has the scene in memory."""
    return max(1, min(8, (len(judges_processors()) or processors()) // 2 // beside))
