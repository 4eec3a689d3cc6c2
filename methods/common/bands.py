"""Bands of the image: rows of pixels that threads of a CPU take at the same time.

The pixels of a band follow one another in memory, so a kernel of one thread a pixel serves a band, too: it is given the
band's part of every array and a camera of the band's height. On a GPU the only band is the image.
"""

import functools
import itertools
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Camera, filled
from ...harness.frame.schedule.threads import cpu_threads, launch_parts, ranges
from .pixels import thread_count

Part = TypeVar("Part")

TILE_THREADS = 32
"""Threads of a block of 8 x 4 pixels (:func:`.pixels.tile_pixel`)."""

ROWS = 4
"""A band has a multiple of this many rows, so that blocks of 8 x 4 pixels are those of the image."""


@dataclass(frozen=True, eq=False)
class Band:
    """Pixels ``first`` to ``end`` of a frame of ``pixels``; ``camera``: the frame's, of these rows."""

    first: int
    end: int
    pixels: int
    camera: Any

    def thread_count(self) -> int:
        """Threads of a kernel over the band."""
        return thread_count(self.camera.width, self.camera.height)

    def of(self, array: wp.array) -> wp.array:
        """The band's part of an array [pixels] or [rows, pixels]; the array itself if it is not of that size."""
        if array.shape[-1] != self.pixels or self.end - self.first == self.pixels:
            return array
        return array[self.first : self.end] if array.ndim == 1 else array[:, self.first : self.end]

    def fields_of(self, struct: Any) -> Any:
        """The band's part of a struct whose arrays are all [pixels], or empty."""
        if self.end - self.first == self.pixels:
            return struct
        kind = struct._cls
        arrays = {name: getattr(struct, name) for name in kind.vars}
        return filled(kind, **{name: self.of(array) for name, array in arrays.items() if array is not None})


def bands_of(frame: Frame, number: int) -> list[Band]:
    """At most ``number`` bands of about the same height; the whole image if that is one."""
    if number == 1:
        return [Band(0, frame.pixels, frame.pixels, frame.camera)]
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
        bands.append(Band(first, end, frame.pixels, camera))
    return bands


class Parts(Generic[Part]):
    """Parts of an image, and launches on all of them: on a CPU a thread each."""

    def __init__(self, parts: Sequence[Part]):
        self.parts = list(parts)
        self._compiled: set[tuple[Any, ...]] = set()

    def run(self, launch: Callable[..., None], *arguments: Hashable) -> None:
        """``launch(part, *arguments)`` of every part, at the same time; at first one after another, since kernels may have
        to be compiled.
        """
        # The function, not the method: the object whose method it is has these parts, and the two would keep one another,
        # with all arrays of the object, until garbage is collected.
        known = (getattr(launch, "__func__", launch), *arguments)
        launch_parts([functools.partial(launch, part, *arguments) for part in self.parts], known in self._compiled)
        self._compiled.add(known)


@dataclass(frozen=True)
class Threads:
    """``number`` threads of a kernel over an image (blocks of 8 x 4 pixels), from ``first`` on."""

    first: int
    number: int


class ThreadRanges(Parts[Threads]):
    """The threads of a kernel over the image of a frame, divided among ``threads`` of a CPU (0: one for each core).

    For a kernel that reads and writes its pixels by their numbers: it adds the first of its threads to its own number.
    """

    def __init__(self, frame: Frame, threads: int):
        tiles = thread_count(frame.width, frame.height) // TILE_THREADS
        parts = ranges(tiles, cpu_threads(threads, frame.device))
        super().__init__([Threads(TILE_THREADS * first, TILE_THREADS * number) for first, number in parts])


class Bands(Parts[Band]):
    """The bands of a frame: on a CPU a thread each, of ``threads`` (0: one for each core)."""

    def __init__(self, frame: Frame, threads: int):
        super().__init__(bands_of(frame, cpu_threads(threads, frame.device)))
        self._cpu = not wp.get_device(frame.device).is_cuda

    def run(self, launch: Callable[..., None], *arguments: Hashable, tests: wp.array | None = None) -> None:
        """``launch(band, *arguments)`` of every band, at the same time.

        tests  an array to count tests in: ``launch(band, *arguments, tests)`` of every band, one after another
        """
        if tests is None:
            super().run(launch, *arguments)
            return
        for band in self.parts:
            launch(band, *arguments, tests)

    def built(self) -> dict[str, int]:
        """For :meth:`...harness.frame.method.Method.built`: threads of a CPU."""
        return {"threads": len(self.parts)} if self._cpu else {}
