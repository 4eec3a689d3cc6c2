"""Processors for scoring alone, so that it goes on while samples are taken.

Scoring takes longer than samples. On a GPU where several runs take turns (:mod:`.runner.machine.lock`), it would hold up all
of them. With processors of its own it uses no GPU, has no share of the lock, and waits for nobody.
"""

import os

from ...errors import UserError

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
    if not set(found) <= set(range(os.cpu_count() or 1)):
        raise UserError(f"{PLACE}={given}: this machine has processors 0 to {(os.cpu_count() or 1) - 1}")
    if set(found) & os.sched_getaffinity(0):
        raise UserError(f"{PLACE}={given}: samples are taken on these too; keep the run off them, as by taskset")
    return found
