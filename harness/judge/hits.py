"""Exact answers of the referee: closest hits with their ties, and an occluder for each light."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import F32, F64, I32, Ints
from .arithmetic import whole_rows


@dataclass(eq=False)
class Hits:
    """Exact closest hits of n rays.

    triangle  int32 [n]: the lowest index of the tie set, -1 at a miss
    t         float64 [n]: the exact t rounded once, inf at a miss
    ratio     the exact t of each ray as (numerator, denominator), None at a miss
    ties      the whole tie set of each ray in ascending order, () at a miss
    """

    origins: F32
    directions: F32
    triangle: I32
    t: F64
    ratio: list[tuple[int, int] | None]
    ties: list[tuple[int, ...]]

    def __len__(self) -> int:
        return len(self.triangle)

    @cached_property
    def points(self) -> F64:
        """Exact hit points rounded once to float64, shape [n, 3]; NaN at a miss."""
        points = np.full((len(self), 3), np.nan)
        rows = np.nonzero(self.triangle >= 0)[0]
        for i, scale, ints in zip(
            rows, *whole_rows(np.hstack([self.origins[rows], self.directions[rows]])), strict=True
        ):
            ratio = self.ratio[i]
            assert ratio is not None
            over, under = ratio
            shift = under << scale if scale > 0 else under
            grow = 1 if scale > 0 else 1 << -scale
            points[i] = [(ints[j] * under + ints[3 + j] * over) * grow / shift for j in range(3)]
        return points

    def take(self, rows: Ints) -> Hits:
        """The hits of some of the rays."""
        return Hits(
            self.origins[rows],
            self.directions[rows],
            self.triangle[rows],
            self.t[rows],
            [self.ratio[i] for i in rows],
            [self.ties[i] for i in rows],
        )

    def put(self, i: int, found: list[tuple[int, int, int]]) -> None:
        """Set ray ``i`` to the nearest of exact hits, given as (numerator of t, denominator, triangle)."""
        over, under, _ = found[0]
        ties: list[int] = []
        for a, b, k in found:
            order = a * under - over * b
            if order < 0:
                over, under, ties = a, b, [k]
            elif order == 0:
                ties.append(k)
        ties.sort()
        self.triangle[i], self.t[i] = ties[0], over / under
        self.ratio[i], self.ties[i] = (over, under), tuple(ties)


@dataclass(frozen=True, eq=False)
class Exact:
    """The exact answers to n rays. ``occluders`` int32 [lights, n]: -1 if lit, or if the light has no shadow rays."""

    hits: Hits
    occluders: I32

    def take(self, rows: Ints) -> Exact:
        """The answers to some of the rays."""
        return Exact(self.hits.take(rows), self.occluders[:, rows])
