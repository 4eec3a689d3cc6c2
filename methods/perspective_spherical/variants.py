"""The compiled variants of the tracing kernels: a short fixed list. Sizes and rectangles are run-time values."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from .parameters import TRIANGLE_TESTS, Build, Trace

BLOCKS = (32, 64, 128, 256)
"""Threads of a block on CUDA. On a CPU, blocks have one thread unless ``wp.config.enable_cpu_blocks`` is set."""


@dataclass(frozen=True)
class Variant:
    """What is decided when a tracing kernel is compiled: the triangle test, an index of TRIANGLE_TESTS."""

    test: int

    @staticmethod
    def of(build: Build) -> Variant:
        return Variant(TRIANGLE_TESTS.index(build.triangle_test))


VARIANTS = tuple(Variant(test) for test in range(len(TRIANGLE_TESTS)))


def block_for(threads: int) -> int:
    """The smallest block that holds ``threads``, or the largest there is."""
    return next((block for block in BLOCKS if block >= threads), BLOCKS[-1])


def wide(device: str) -> bool:
    """Whether thread blocks have more than one thread: on CUDA, and on a CPU with ``wp.config.enable_cpu_blocks``."""
    return wp.get_device(device).is_cuda or bool(wp.config.enable_cpu_blocks)


def staged(trace: Trace, device: str) -> bool:
    """Whether triangles are staged: where that is set, and blocks have more than one thread."""
    return trace.staging == "shared" and wide(device)
