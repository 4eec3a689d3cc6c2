"""What can be set of the ray grids. None of it changes an answer."""

from __future__ import annotations

from dataclasses import dataclass

QUEUES = ("auto", "always", "never")


@dataclass(frozen=True)
class Build:
    """Ray grid parameters.

    cells          cells along a face of the light's cube, a multiple of 8; 0 chooses: as many as pixels along an
                   image side where triangles rival pixels, else half as many
    inline_cells   a triangle whose box covers at most so many cells looks up how many rays they hold
    inline_rays    and tests them in its own thread if they are at most so many
    queue          larger triangles go through queues: "auto" on the GPU only, "always", "never"
    item_capacity  initial room for queued work items; 0 chooses; grows as needed
    block_capacity initial room for queued (triangle, block) pairs; 0 chooses; grows as needed
    doubt_capacity initial room for (triangle, ray) pairs left to float64; 0 chooses; grows as needed
    strip_capacity initial room for queued rows of blocks; 0 chooses; grows as needed
    """

    cells: int = 0
    inline_cells: int = 64
    inline_rays: int = 48
    queue: str = "auto"
    item_capacity: int = 0
    block_capacity: int = 0
    strip_capacity: int = 0
    doubt_capacity: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.cells <= 8192 or self.cells % 8:
            raise ValueError("cells must be a multiple of 8 in 0..8192")
        if (
            min(
                self.inline_cells,
                self.inline_rays,
                self.item_capacity,
                self.strip_capacity,
                self.doubt_capacity,
            )
            < 0
        ):
            raise ValueError("must not be negative")
        if max(self.item_capacity, self.strip_capacity, self.doubt_capacity) > 2**28:
            raise ValueError("must be at most 2^28")
        if self.queue not in QUEUES:
            raise ValueError(f"must be one of {', '.join(QUEUES)}")
