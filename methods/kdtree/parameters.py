"""The parameters of the kd-tree. None of them changes an answer."""

from __future__ import annotations

from dataclasses import dataclass

from ...harness.frame.schedule.threads import check_threads
from ..common.ray_launches import check_registers

SMALL = 64
"""Most triangles of a small node: a set of them has 64 bits."""

SMALL_DEPTH = 16
"""Most levels of the tree within a small node."""

LARGE_DEPTH = 40
"""Most levels of large nodes. Together with those of small nodes they must not exceed 64, because a ray keeps one bit per
level."""


STACKS = (1, 2, 4, 8, 16, 32, 64)


@dataclass(frozen=True)
class Build:
    """How the tree is built.

    small      nodes of at most this many triangles are split by the surface area heuristic, larger ones at the middle
               of their longest side (1 to 64)
    empty      share of a large node's side: as much empty space is cut off first
    traversal_cost  of an inner node, in triangle tests: C_t / C_i of the heuristic
    capacity   initial capacity, (triangle, node) pairs of a level; 0: three per triangle. All capacities grow when a
               frame needs more
    """

    small: int = SMALL
    empty: float = 0.25
    traversal_cost: float = 4.0
    capacity: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.small <= SMALL:
            raise ValueError(f"small must be in 1..{SMALL}")
        if not 0.05 <= self.empty <= 1.0:
            raise ValueError("empty must lie between 0.05 and 1 (never)")
        if not 0.0 < self.traversal_cost <= 100.0:
            raise ValueError("traversal_cost must lie between 0 and 100 triangle tests")
        if self.capacity < 0:
            raise ValueError("capacity must be 0 (automatic) or more pairs")


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    swizzle    whether 32 consecutive threads trace a block of 8x4 pixels (true) or 32 pixels of a row (false)
    stack      nodes that a ray's stack holds (1, 2, 4, 8, 16, 32 or 64)
    registers  limit of registers per thread on the GPU; 0: the compiler decides. 96 was the best on balls-40k and
               balls-300k
    threads    of a CPU: each traces a band of the image; 0: one for each core that this process may use, at most 16
    """

    swizzle: bool = True
    stack: int = 8
    registers: int = 96
    threads: int = 0

    def __post_init__(self) -> None:
        if self.stack not in STACKS:
            raise ValueError(f"stack must be one of {', '.join(map(str, STACKS))}")
        check_registers(self.registers)
        check_threads(self.threads)
