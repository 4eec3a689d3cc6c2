"""Methods planned as for a GPU, where there is none: their passes, and what these launch."""

from typing import Any

import pytest
import warp as wp

REAL_DEVICE = wp.get_device


class PlannedForCuda(str):
    """The name of the CPU, where arrays lie; for a method that asks, a GPU."""

    is_cuda, is_cpu, sm_count = True, False, 132

    def __getattr__(self, name: str) -> Any:
        return getattr(REAL_DEVICE("cpu"), name)


def plan_for_cuda(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = method.plan

    def planned(*arguments: Any) -> Any:
        with monkeypatch.context() as patch:
            patch.setattr(wp, "get_device", lambda ident=None: PlannedForCuda("cpu"))
            return plan(*arguments)

    method.plan = planned
