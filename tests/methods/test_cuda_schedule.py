"""Passes of every method, planned as for a GPU, fork only where a graph may: without a GPU."""

from __future__ import annotations

from typing import Any

import pytest
import warp as wp
from helpers.brute_force import make_scene, soup
from shadowbench.harness.frame.passes import refuse_shared
from shadowbench.harness.frame.registry import make_method, method_names
from shadowbench.harness.frame.session import Session

VARIANTS: list[tuple[str, dict[str, str]]] = [(name, {}) for name in method_names()] + [
    ("bvh2", {"precision": "float32"}),
    ("bvh2", {"shares": "1"}),
    ("bvh2", {"update": "refit", "shares": "3"}),
    ("hybrid", {"shares": "2"}),
    ("hybrid", {"shadows": "grid"}),
]
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


@pytest.mark.parametrize(("name", "settings"), VARIANTS, ids=str)
def test_concurrent_passes_share_nothing_that_one_writes(name, settings, monkeypatch):
    prepared = make_scene(*soup(7, 300), [(0.1, 0.2, 0.3), (5.0, 4.0, 3.0)])
    method = make_method(name, settings)
    if not method.capturable:
        pytest.skip(f"{name} is not captured as a graph")
    plan_for_cuda(method, monkeypatch)
    session = Session(method, prepared, 32, 32, "cpu")
    refuse_shared(session.passes)
    branched = [work for work in session.passes if work.branch]
    assert branched or name not in ("bvh2", "hybrid", "ray_grids", "visibility_buffer")
