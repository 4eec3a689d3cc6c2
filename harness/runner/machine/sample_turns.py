"""When a run may take samples: alone on the machine, or, on a cluster, alone on its card and beside other cards."""

from __future__ import annotations

import contextlib

from ..planning.run_options import Job
from .lock import MACHINE


class Turns:
    """One run measures on the machine: it holds the machine lock for all rounds of a scene."""

    def measuring(self) -> contextlib.AbstractContextManager[None]:
        """Around all rounds of a scene."""
        return MACHINE.exclusive()

    def round(self, job: Job) -> contextlib.AbstractContextManager[None]:
        """Around one round of a point."""
        return contextlib.nullcontext()


class CardTurns(Turns):
    """Several cards of a machine measure at the same time. The caller holds the lock of its card.

    The clock of a GPU times a captured graph, whatever the host does meanwhile. A method on the CPU, and one whose
    launches the host must issue in time, needs the machine alone: all others pause between two of their rounds.
    """

    def measuring(self) -> contextlib.AbstractContextManager[None]:
        return contextlib.nullcontext()

    def round(self, job: Job) -> contextlib.AbstractContextManager[None]:
        MACHINE.give_way()
        return MACHINE.exclusive() if on_host(job) else contextlib.nullcontext()


def on_host(job: Job) -> bool:
    """Whether the times of a point depend on what else the host does."""
    method = job.point.method
    return not str(method["device"]).startswith("cuda") or not method.get("capturable")
