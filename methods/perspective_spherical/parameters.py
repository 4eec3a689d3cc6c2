"""What can be set of the paper's method. Defaults are the paper's at 1024x1024: 128 x 128 tiles, 16 slices."""

from __future__ import annotations

from dataclasses import dataclass

DEPTH_LISTS = ("spans", "nearest")


@dataclass(frozen=True)
class Build:
    """Grid parameters. None of them changes an answer.

    tile          side of a square image tile, pixels
    slices        slices of depth in the perspective grid, linear between nearest and farthest triangle
    light_tiles   tiles along azimuth and along elevation of a light grid
    light_slices  slices of distance in a light grid, linear between nearest and farthest shadow ray
    depth_lists   "spans": a triangle is listed in every slice it spans (the paper); "nearest": only in its first
    aimed         the light's frame looks at the middle of the hit points (otherwise along +x, y up)
    pair_capacity initial room for (triangle, cell) pairs; 0 chooses; grows as needed
    row_capacity  initial room for (large triangle, tile row) items; 0 chooses; grows as needed
    """

    tile: int = 8
    slices: int = 16
    light_tiles: int = 128
    light_slices: int = 16
    depth_lists: str = "spans"
    aimed: bool = True
    pair_capacity: int = 0
    row_capacity: int = 0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("tile", 1, 1024),
            ("slices", 1, 4096),
            ("light_tiles", 1, 4096),
            ("light_slices", 1, 4096),
            ("pair_capacity", 0, 2**30),
            ("row_capacity", 0, 2**28),
        ):
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"must lie in {low}..{high}")
        if self.light_tiles**2 * self.light_slices >= 2**30:
            raise ValueError("light_tiles^2 * light_slices must stay below 2^30 cells")
        if self.depth_lists not in DEPTH_LISTS:
            raise ValueError(f"must be one of {', '.join(DEPTH_LISTS)}")


@dataclass(frozen=True)
class Trace:
    """Tracing parameters. None of them changes an answer.

    r   rays a chunk at most (paper, section 4.3)
    """

    r: int = 64

    def __post_init__(self) -> None:
        if not 1 <= self.r <= 65536:
            raise ValueError("must lie in 1..65536")
