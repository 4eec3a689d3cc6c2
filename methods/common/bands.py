"""Bands of the image: rows of pixels that threads of a CPU take at the same time.

The pixels of a band follow one another in memory, so a kernel of one thread a pixel serves a band, too: it is given the
band's part of every array and a camera of the band's height. On a GPU the only band is the image.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Camera, Hits, filled
from ...harness.frame.threads import Launch, beside
from .pixels import thread_count

ROWS = 4
"""A band has a multiple of this many rows, so that blocks of 8 x 4 pixels are those of the image."""


@dataclass(frozen=True, eq=False)
class Band:
    """Pixels ``first`` to ``end`` of a frame; ``camera`` and ``hits``: its part of the frame's, ``threads``: of a kernel
    that takes blocks of 8 x 4 pixels."""

    first: int
    end: int
    threads: int
    camera: Any
    hits: Any

    def of(self, pixels: wp.array) -> wp.array:
        """The band's part of an array [pixels]."""
        return pixels[self.first : self.end]


def bands_of(frame: Frame, number: int) -> list[Band]:
    """At most ``number`` bands of about the same height; the whole image if that is one."""
    if number == 1:
        threads = thread_count(frame.width, frame.height, True)
        return [Band(0, frame.pixels, threads, frame.camera, frame.hits(0))]
    rows = -(-frame.height // ROWS)
    cuts = sorted({min(frame.height, rows * k // number * ROWS) for k in range(number + 1)})
    cuts[-1] = frame.height
    bands = []
    for top, below in itertools.pairwise(cuts):
        first, end = top * frame.width, below * frame.width
        camera = filled(
            Camera, width=frame.width, height=below - top, eye=frame.eye, axes=frame.axes, tangents=frame.tangents,
            column=frame.column, row=frame.row[top:below],
        )  # fmt: skip
        of = frame.answers
        hits = filled(
            Hits, triangle=of.triangle[first:end], t=of.t[first:end], u=of.u[first:end], v=of.v[first:end]
        )
        threads = thread_count(frame.width, below - top, True)
        bands.append(Band(first, end, threads, camera, hits))
    return bands


def in_bands(bands: Sequence[Band], launch: Callable[[Band], None]) -> Launch:
    """``launch`` of each band, at the same time if there are several."""
    return beside([functools.partial(launch, band) for band in bands])
