"""Lists of candidate triangles, of many rays or segments, in flat arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import I32, I64, Bools, Ints


@dataclass(frozen=True, eq=False)
class Lists:
    """The candidates of n rays: all in one array, those of a ray in a row.

    found  int32 [all];  counts int32 [n]
    """

    found: I32
    counts: I32

    @staticmethod
    def of_pairs(ray: I32, triangle: I32, rays: int) -> Lists:
        """The lists of so many rays, from pairs in any order of rays."""
        return Lists(triangle[np.argsort(ray, kind="stable")], np.bincount(ray, minlength=rays).astype(np.int32))

    def __getitem__(self, ray: int) -> I32:
        start = self.starts[ray]
        return self.found[start : start + self.counts[ray]]

    def __len__(self) -> int:
        return len(self.counts)

    @cached_property
    def starts(self) -> I64:
        """The place of the first candidate of each ray."""
        return np.cumsum(self.counts, dtype=np.int64) - self.counts

    @property
    def of(self) -> NDArray[np.intp]:
        """The ray of each candidate."""
        return np.repeat(np.arange(len(self)), self.counts)

    def without(self, left_out: Bools) -> Lists:
        """The lists without some candidates [all]."""
        kept = np.bincount(self.of[~left_out], minlength=len(self)).astype(np.int32)
        return Lists(self.found[~left_out], kept)

    def some(self, rays: Ints, first: int, most: int) -> tuple[NDArray[np.intp], I32]:
        """Of some rays, each with more than ``first`` candidates, at most so many from that one on: ray and triangle."""
        counts = np.minimum(self.counts[rays] - first, most)
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.repeat(rays, counts), self.found[np.repeat(self.starts[rays] + first, counts) + within]


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments from hit points to lights, by the numbers of both: int32 [n] each."""

    row: I32
    light: I32

    @staticmethod
    def where(wanted: Bools) -> Segments:
        """Those that are wanted of each light to each hit point, bool [lights, hits]: light by light."""
        light, row = np.nonzero(wanted)
        return Segments(row.astype(np.int32), light.astype(np.int32))

    def __len__(self) -> int:
        return len(self.row)

    def __getitem__(self, part: slice | NDArray) -> Segments:
        return Segments(self.row[part], self.light[part])
