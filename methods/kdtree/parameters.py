"""What can be set of the kd-tree. Nothing here changes an answer."""

from __future__ import annotations

from dataclasses import dataclass

SMALL = 64
"""Triangles of a small node at most: a set of them is 64 bits."""

SMALL_DEPTH = 16
"""Levels of the tree within a small node at most."""

LARGE_DEPTH = 32
"""Levels of large nodes at most."""

STACK = SMALL_DEPTH + LARGE_DEPTH
"""A ray's stack holds at most one node for each level."""


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
    traversal_cost: float = 1.5
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

    swizzle  whether 32 consecutive threads trace a block of 8x4 pixels (true) or 32 pixels of a row (false)
    """

    swizzle: bool = True
