"""The parameters of the ray grids. None of them changes an answer."""

from __future__ import annotations

from dataclasses import dataclass

QUEUES = ("auto", "always", "never")


@dataclass(frozen=True)
class Streams:
    """Parameters of every stream of triangles over cells of rays: its cells, the work of a single thread, and its
    queues."""

    cells: int = 0
    inline_pixels: int = 40
    inline_cells: int = 64
    beside: int = 2
    shares: int = 2
    item_capacity: int = 0
    part_capacity: int = 0
    doubt_capacity: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.cells <= 8192 or self.cells % 8:
            raise ValueError("cells must be a multiple of 8 in 0..8192")
        room = (self.item_capacity, self.part_capacity, self.doubt_capacity)
        if min(self.inline_pixels, self.inline_cells, *room) < 0:
            raise ValueError("must not be negative")
        if not (1 <= self.beside <= 16 and 1 <= self.shares <= 16):
            raise ValueError("beside and shares must be in 1..16")
        if max(room) > 2**28:
            raise ValueError("must be at most 2^28")


@dataclass(frozen=True)
class Build(Streams):
    """How triangles are streamed over the rays.

    cells          cells along each side of a face of the light's cube, a multiple of 8; 0 chooses in each frame: about
                   the square root of the number of pixels where one face holds all rays, or where triangles are more
                   than half as many as pixels; else half of that
    inline_pixels  a triangle whose box on the image holds at most this many pixels tests them in its own thread; a
                   larger one is queued
    inline_cells   a triangle whose box on a face covers at most this many cells, in at most 16 rows, counts the rays in
                   them; a larger one is queued
    inline_rays    a triangle that has counted at most this many rays, on one face, tests them in its own thread; with
                   more, or on a second face, it is queued
    part           pixels or rays of a queued group of 32 rows that one warp tests; larger groups are split into parts
    beside         with queues: lights whose passes run at the same time on the GPU, each with queues and rays of its own
    shares         with queues: parts of the triangles that are streamed at the same time on the GPU, each with queues of
                   its own
    queue          whether larger triangles go through queues: "auto" (on the GPU only), "always", "never"
    threads        of a CPU: each streams a part of the triangles and resolves a band of the image; 0: one for each core
                   that this process may use, at most 16
    item_capacity  initial capacity, entries, of the queues of work items and of large triangles; 0 chooses; grows when a
                   frame needs more
    part_capacity  initial capacity, entries, of the queue of further parts of work items; 0 chooses; grows when a frame
                   needs more
    doubt_capacity  initial capacity, entries, of the queue of (triangle, pixel) pairs that float64 decides; 0 chooses;
                   grows when a frame needs more
    """

    inline_rays: int = 32
    part: int = 256
    queue: str = "auto"
    threads: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inline_rays < 0:
            raise ValueError("must not be negative")
        if self.part < 1:
            raise ValueError("part must be at least 1")
        if self.threads < 0:
            raise ValueError("threads must be 0 (all cores) or more")
        if self.queue not in QUEUES:
            raise ValueError(f"must be one of {', '.join(QUEUES)}")
