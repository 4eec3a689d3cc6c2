"""The parameters of methods with one grid over all triangles."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Build:
    """How the grid is built.

    density   cells per triangle, divided among the axes in proportion to the scene's box; the default is lambda of
              Kalojanov & Slusallek
    capacity  initial capacity, (triangle, cell) pairs; 0: four per triangle; grows when a frame needs more
    """

    density: float = 5.0
    capacity: int = 0

    def __post_init__(self) -> None:
        if not 0.0 < self.density <= 1000.0:
            raise ValueError("density must lie between 0 and 1000 cells a triangle")
        if self.capacity < 0:
            raise ValueError("capacity must be 0 (automatic) or more pairs")
