"""Host side of the perspective grid: its arrays and the launches of its passes."""

import math

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.schedule.passes import Pass
from ...common.pairs import zeroed
from ..lists.binning import BIN_BLOCK, GridSettings, TileBins
from ..lists.staging import block_for, staged
from ..variants.split_lists import Items, count_tiles_kernel
from .ray_tests import WIDENINGS
from .tiles import ImageTiles, bin_kernel, project_kernel
from .trace import NO_NEAREST, Traced, make_resolve_kernel, make_trace_kernel


class CameraGrid:
    """The perspective grid of one frame, and the closest hits traced through it.

    grid  :class:`.tiles.ImageTiles`     out  :class:`.trace.Traced`
    """

    def __init__(self, settings: GridSettings):
        self.settings = settings
        frame, build, split = settings.frame, settings.build, settings.trace.triangle_chunk
        self.across, self.down = -(-frame.width // build.tile), -(-frame.height // build.tile)
        tiles = self.across * self.down
        if tiles * build.slices >= 2**30:
            raise ValueError(f"{tiles * build.slices:,} cells: choose a larger tile or fewer slices")
        self.bins = bins = TileBins(frame.triangle_count, tiles, build.slices, settings)
        with wp.ScopedDevice(frame.device):
            self.grid = zeroed(
                ImageTiles, tile=build.tile, across=self.across, slices=build.slices,
                every_slice=build.depth_lists == "spans", widening=WIDENINGS[settings.test], depths=bins.items,
                depth_range=2, records=3 * bins.items, lists=bins.lists,
            )  # fmt: skip
            self.no_range = wp.array([math.inf, -math.inf], dtype=wp.float32)
            self.no_tests = wp.zeros(1, dtype=wp.int32)
            self.out = zeroed(
                Traced, frame.pixels, nearest=frame.pixels if split else 1, hits=frame.hits(0), tests=self.no_tests
            )
            self.item_need = wp.zeros(1, dtype=wp.int64)
        # A list of n pairs has at most one part and one for every full chunk.
        sources, parts = (tiles, settings.capacity[0] // split) if split else (1, 0)
        self.items = Items(sources, sources + parts, split, frame.device)

    def passes(self) -> list[Pass]:
        """Build and trace, in the order they run."""
        scene, boxes, pairs, grid = ("points", "triangles", "camera"), "camera boxes", "camera pairs", "camera grid"
        seen = (*scene, grid, *self.settings.effects.surface_reads())
        return [
            Pass("camera grid: project", "build", scene, (boxes,), self.launch_project),
            Pass("camera grid: emit pairs", "build", (*scene, boxes), (pairs,), self.launch_bin),
            Pass("camera grid: sort pairs", "build", (pairs,), (grid,), self.bins.launch_sort),
            Pass("primary rays", "trace", seen, ("hits",), self.launch_trace),
        ]

    def launch_project(self) -> None:
        f, bins = self.settings.frame, self.bins
        bins.clear_queue()
        wp.copy(self.grid.depth_range, self.no_range)
        inputs = [self.settings.test, self.settings.outward, f.camera, f.mesh, self.grid, bins.bins]
        f.launch(project_kernel, -(-bins.items // BIN_BLOCK) * BIN_BLOCK, inputs, block=BIN_BLOCK)

    def launch_bin(self) -> None:
        f, bins = self.settings.frame, self.bins
        bins.clear_pairs()
        f.launch(bin_kernel, bins.threads, [f.camera, f.mesh, self.grid, bins.bins], block=BIN_BLOCK)

    def launch_trace(self, tests: wp.array | None = None) -> None:
        """Closest hits. ``tests`` (int32 [pixels]) is raised by the triangle tests of each pixel, if given."""
        settings, out = self.settings, self.out
        f, build, trace = settings.frame, settings.build, settings.trace
        out.tests = self.no_tests if tests is None else tests
        # A block takes one sorting tile of a split list; otherwise a tracing tile of k x k of them.
        k = 1 if trace.triangle_chunk else trace.k
        sources = -(-self.across // k) * -(-self.down // k)
        if trace.triangle_chunk:
            sources = self.items.capacity
            self.items.launch(count_tiles_kernel, [trace.triangle_chunk, self.bins.lists], self.item_need, 0)
            out.nearest.fill_(int(NO_NEAREST))
        area = (k * build.tile) ** 2
        block = block_for(area)
        in_blocks = staged(trace.staging, f.device)
        kernel = specialised(make_trace_kernel(settings.test, block if in_blocks else 0), settings.effects.switches())
        inputs = [k, f.camera, f.mesh, f.alpha, self.grid, self.items.parts, out]
        f.launch(kernel, sources * (-(-area // block) * block if in_blocks else area), inputs, block=block)
        if trace.triangle_chunk:
            kernel = specialised(make_resolve_kernel(settings.test), settings.effects.switches())
            f.launch(kernel, f.pixels, [f.camera, f.mesh, out])
