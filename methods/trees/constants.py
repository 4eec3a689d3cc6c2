"""Constants that the speed of trees depends on, and no answer. Where each was measured: docs/methods/bvh2.md."""

from __future__ import annotations

KEY_BITS = 24
"""Bits of the Morton keys that triangles are sorted by: a pass of the sort for each 8."""

RADIUS = 2
"""Places on either side of a cluster among which H-PLOC looks for the one to merge it with."""

SHARED_AREA = 1.25
"""Two triangles share a leaf where the area of their common box is at most this many times the sum of their own boxes'
areas."""

BLOCK = 128
"""Threads of a block of the kernels that trace: how pixels are divided, and the stacks of packets, depend on it."""

REGISTERS = 48
"""Registers a thread of the kernels that trace, at most."""

EYE_REGISTERS = 56
"""The same of rays from the eye, where float64 computes t, weights and hit point in the same kernel."""

RESOLVE_REGISTERS = 96
"""The same of the kernel that computes them for listed rays."""

RECORD_REGISTERS = 64
"""The same of the kernels that make records of triangles, which are limited by memory."""

SHARES = 2
"""Parts of the pixels that a GPU traces at once, where a tree traces the primary rays, too."""

UNDECIDED = 262_144
"""Pairs of a ray and a triangle left to float64 that there is room for at first, if that is no less than half of the
pixels."""

MOST_TRIANGLES = 2**24
"""A tree over fewer fits the stacks."""


def first_capacity(pixels: int) -> int:
    """:data:`UNDECIDED` of so many pixels."""
    return max(UNDECIDED, pixels // 2)
