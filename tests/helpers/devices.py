"""The devices that tests run on: the CPU everywhere, and one GPU where there is one."""

import pytest
from shadowbench.harness.frame.devices import start_warp

start_warp()

import warp as wp  # noqa: E402  (started without chatter first)

needs_gpu = pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device on this machine")

DEVICES = ("cpu", pytest.param("cuda:0", marks=(pytest.mark.gpu, needs_gpu)))
