"""What can be set of the ray grids. None of it changes an answer."""

from __future__ import annotations

from dataclasses import dataclass

QUEUES = ("auto", "always", "never")


@dataclass(frozen=True)
class Build:
    """Ray grid parameters.

    cells          cells along a face of the light's cube, a multiple of 8; 0 chooses: as many as pixels along an
                   image side where triangles rival pixels, or (seen on the device, each frame) where one face holds
                   all rays; else half as many
    inline_pixels  a triangle whose box on the image holds at most so many pixels tests them in its own thread
    inline_cells   a triangle whose box on a face covers at most so many cells (in at most 16 rows) looks up how many
                   rays they hold
    inline_rays    and tests them in its own thread if they are at most so many, on one face; a second one is queued
    part           pixels or rays of a queued group of 32 rows that one warp tests at a time: groups with more are cut in
                   parts
    beside         with queues: lights that the GPU sees to at once, each with queues and rays of its own
    shares         with queues: parts of the triangles that the GPU streams at once, each with queues of its own
    queue          larger triangles go through queues: "auto" on the GPU only, "always", "never"
    item_capacity  initial room for queued work items, and for triangles waiting to become some; 0 chooses; grows as needed
    part_capacity  initial room for further parts of items with many pixels or rays; 0 chooses; grows as needed
    doubt_capacity initial room for (triangle, pixel or ray) pairs left to float64; 0 chooses; grows as needed
    """

    cells: int = 0
    inline_pixels: int = 40
    inline_cells: int = 64
    inline_rays: int = 32
    part: int = 256
    beside: int = 2
    shares: int = 2
    queue: str = "auto"
    item_capacity: int = 0
    part_capacity: int = 0
    doubt_capacity: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.cells <= 8192 or self.cells % 8:
            raise ValueError("cells must be a multiple of 8 in 0..8192")
        room = (self.item_capacity, self.part_capacity, self.doubt_capacity)
        if min(self.inline_pixels, self.inline_cells, self.inline_rays, *room) < 0:
            raise ValueError("must not be negative")
        if self.part < 1:
            raise ValueError("part must be at least 1")
        if not (1 <= self.beside <= 16 and 1 <= self.shares <= 16):
            raise ValueError("beside and shares must be in 1..16")
        if max(room) > 2**28:
            raise ValueError("must be at most 2^28")
        if self.queue not in QUEUES:
            raise ValueError(f"must be one of {', '.join(QUEUES)}")
