"""Host side of the perspective grid: its arrays and the launches of its passes."""

import math

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass
from ....harness.scene.effects import Effects
from ..lists.binning import BIN_BLOCK, TileBins
from ..lists.staging import block_for, staged
from ..parameters import TRIANGLE_TESTS, Build, Trace
from ..variants.split_lists import Items, count_tiles_kernel
from .ray_tests import WIDENINGS
from .tiles import ImageTiles, bin_kernel, project_kernel
from .trace import NO_NEAREST, make_resolve_kernel, make_trace_kernel


class CameraGrid:
    """The perspective grid of one frame, and the closest hits traced through it.

    hit      vec3d [pixels]: float64 hit points, the origins of the shadow rays
    records  vec4f [3 * triangle_count]: see :mod:`.camera.ray_tests`
    outward  how faces are wound, for culling; 0 keeps back faces
    """

    def __init__(
        self,
        frame: Frame,
        build: Build,
        trace: Trace,
        outward: float,
        capacity: tuple[int, ...],
        needs: wp.array,
        slot: int,
        effects: Effects,
    ):
        self.effects = effects
        self.frame, self.build, self.trace, self.outward = frame, build, trace, outward
        self.test = TRIANGLE_TESTS.index(build.triangle_test)
        self.widening = WIDENINGS[self.test]
        self.across = -(-frame.width // build.tile)
        self.down = -(-frame.height // build.tile)
        cells = self.across * self.down * build.slices
        if cells >= 2**30:
            raise ValueError(f"{cells:,} cells: choose a larger tile or fewer slices")
        self.bins = TileBins(
            frame.triangle_count, self.across * self.down, build.slices, capacity, needs, slot, build.sort,
            frame.device,
        )  # fmt: skip
        with wp.ScopedDevice(frame.device):
            self.depths = wp.zeros(self.bins.items, dtype=wp.vec2f)
            self.records = wp.zeros(3 * self.bins.items, dtype=wp.vec4f)
            self.depth_range = wp.zeros(2, dtype=wp.float32)
            self.no_range = wp.array([math.inf, -math.inf], dtype=wp.float32)
            self.hit = wp.zeros(frame.pixels, dtype=wp.vec3d)
            self.no_tests = wp.zeros(1, dtype=wp.int32)
            self.nearest = wp.zeros(frame.pixels if trace.triangle_chunk else 1, dtype=wp.uint64)
        self.tiles = filled(
            ImageTiles,
            tile=build.tile,
            across=self.across,
            slices=build.slices,
            spans=build.depth_lists == "spans",
            depth_range=self.depth_range,
        )
        split, sources = trace.triangle_chunk, self.across * self.down if trace.triangle_chunk else 1
        # A list of n pairs has at most one part and one for every full chunk.
        self.items = Items(sources, sources + (capacity[0] // split if split else 0), split, frame.device)
        self.item_need = wp.zeros(1, dtype=wp.int64, device=frame.device)

    def passes(self) -> list[Pass]:
        """Build and trace, in the order they run."""
        scene = ("points", "triangles", "camera")
        bins = self.bins
        return [
            Pass("camera grid: project", "build", scene, ("camera boxes",), self.launch_project),
            Pass(
                "camera grid: emit pairs", "build", (*scene, "camera boxes"), ("camera pairs",), self.launch_bin,
            ),
            Pass("camera grid: sort pairs", "build", ("camera pairs",), ("camera grid",), bins.launch_sort),
            Pass(
                "primary rays", "trace", (*scene, "camera grid", *self.effects.surface_reads()), ("hits",),
                self.launch_trace,
            ),
        ]  # fmt: skip

    def launch_project(self) -> None:
        f, b = self.frame, self.bins
        b.clear_queue()
        wp.copy(self.depth_range, self.no_range)
        inputs = [f.triangle_count, self.build.tile, self.widening, self.outward, self.test, f.camera, f.mesh]
        outputs = [b.boxes, self.depths, self.depth_range, self.records, b.queue]
        f.launch(project_kernel, -(-b.items // BIN_BLOCK) * BIN_BLOCK, inputs, outputs, BIN_BLOCK)

    def launch_bin(self) -> None:
        f, b = self.frame, self.bins
        b.clear_pairs()
        inputs = [self.widening, f.camera, f.mesh, self.tiles, b.boxes, self.depths, b.queue]
        f.launch(bin_kernel, b.threads, inputs, [b.pairs], BIN_BLOCK)

    def launch_trace(self, tests: wp.array | None = None) -> None:
        """Closest hits. ``tests`` (int32 [pixels]) is raised by the triangle tests of each pixel, if given."""
        f, bins, split = self.frame, self.bins, self.trace.triangle_chunk
        # A block takes one sorting tile of a split list; otherwise a tracing tile of k x k of them.
        k = 1 if split else self.trace.k
        sources = -(-self.across // k) * -(-self.down // k)
        if split:
            sources = self.items.capacity
            self.items.launch(count_tiles_kernel, [split, bins.lists], self.item_need, 0)
            self.nearest.fill_(int(NO_NEAREST))
        area = (k * self.build.tile) ** 2
        block = block_for(area)
        in_blocks = staged(self.trace.staging, f.device)
        kernel = make_trace_kernel(self.test, block if in_blocks else 0)
        outputs = [f.hits(0), self.hit, self.no_tests if tests is None else tests]
        inputs = [k, f.camera, f.mesh, f.alpha, self.tiles, bins.lists, self.records, self.items.parts, self.nearest]
        kernel = specialised(kernel, self.effects.switches())
        f.launch(kernel, sources * (-(-area // block) * block if in_blocks else area), inputs, outputs, block)
        if split:
            inputs = [f.camera, f.mesh, self.nearest]
            kernel = specialised(make_resolve_kernel(self.test), self.effects.switches())
            f.launch(kernel, f.pixels, inputs, outputs[:-1])
