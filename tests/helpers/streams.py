"""Settings of the methods that stream triangles, and what only a GPU's kernels do."""

from typing import Any

import pytest
import warp as wp
from shadowbench.harness.frame.session import Session

on_gpu_side = pytest.mark.skipif(
    not wp.get_device("cpu").is_cuda,
    reason="lanes of a warp: tests/emulated/test_emulated_gpu.py runs this file on the side of the GPU",
)
"""For tests of kernels that a CPU never launches."""


def trial(**settings: object) -> dict[str, str]:
    """Parameters of a method with these settings in place of those that are chosen for a frame."""
    return {"trial": "+".join(f"{name}={value}" for name, value in settings.items())}


def placings_of_session(session: Session) -> list[Any]:
    """What places the rays of each light that has shadows, in their order."""
    return [work.launch.__self__ for work in session.planned if work.name.endswith("map rays")]


def lights_of_session(session: Session) -> list[Any]:
    """The rays of each light that has shadows, in their order."""
    return [placing.rays for placing in placings_of_session(session)]
