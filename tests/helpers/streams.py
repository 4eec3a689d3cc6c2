"""Settings of the methods that stream triangles, and what only a GPU's kernels do."""

import pytest
import warp as wp

on_gpu_side = pytest.mark.skipif(
    not wp.get_device("cpu").is_cuda,
    reason="lanes of a warp: tests/emulated/test_emulated_gpu.py runs this file on the side of the GPU",
)
"""For tests of kernels that a CPU never launches."""


def trial(**settings: object) -> dict[str, str]:
    """Parameters of a method with these settings in place of those that are chosen for a frame."""
    return {"trial": "+".join(f"{name}={value}" for name, value in settings.items())}
