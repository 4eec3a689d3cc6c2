"""A uniform grid rebuilt every frame by sorting (triangle, cell) pairs: Kalojanov & Slusallek 2009.

"A Parallel Algorithm for Construction of Uniform Grids" (HPG). The grid serves any ray, so primary and shadow rays share
it.
"""

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import filled
from ..grids.build import Build, TriangleGrid, cells_for
from ..grids.cells import Cells, make_kernels
from ..rays.structure import Built, RayStructure


class UniformGrid(RayStructure):
    """See the package."""

    name = "uniform_grid"
    title = "Uniform grid"
    ROOMS = ("(triangle, cell) pairs",)
    BUILT = ("density",)
    Build = Build

    def first_capacity(self, frame: Frame) -> list[int]:
        return [self.build.capacity or 4 * frame.triangle_count]

    def structure(self, frame: Frame) -> Built:
        cells = cells_for(frame.triangle_count, self.build.density, self._memory)
        self._grid = grid = TriangleGrid(frame, cells, self._capacity[0])
        walked = filled(Cells, grid=grid.grid, lists=grid.pairs)
        return Built(grid.built(self._need, 0), walked, TriangleGrid.RESOURCES, make_kernels())

    def counted(self) -> dict[str, int]:
        return self._grid.counters()


METHOD = UniformGrid
