"""Host side of the perspective grid: its arrays and the launches of its passes."""

from __future__ import annotations

import warp as wp

from ...harness.frame import Frame
from ...harness.passes import Pass
from . import camera_grid as kernels
from .binning import TileBins
from .parameters import TRIANGLE_TESTS, Build, Trace
from .primary import make_trace_kernel
from .ray_tests import WIDENING
from .variants import Variant, block_for


@wp.kernel(enable_backward=False)
def reset_range_kernel(depth_range: wp.array(dtype=wp.float32)):
    depth_range[0] = wp.INF
    depth_range[1] = -wp.INF


class CameraGrid:
    """The perspective grid of one frame, and the closest hits traced through it.

    hit      vec3d [pixels]: float64 hit points, the origins of the shadow rays
    records  vec4f [3 * triangle_count]: see :mod:`.ray_tests`
    outward  how faces are wound, for culling; 0 keeps back faces
    """

    def __init__(
        self,
        frame: Frame,
        build: Build,
        trace: Trace,
        outward: float,
        capacity: tuple[int, int],
        needs: wp.array,
        slot: int,
    ):
        self.frame, self.build, self.trace, self.outward = frame, build, trace, outward
        self.widening = 0.0 if build.triangle_test == "exact" else WIDENING
        self.across = -(-frame.width // build.tile)
        self.down = -(-frame.height // build.tile)
        cells = self.across * self.down * build.slices
        if cells >= 2**30:
            raise ValueError(f"{cells:,} cells: choose a larger tile or fewer slices")
        self.bins = TileBins(
            frame.triangle_count, self.across * self.down, build.slices, capacity, needs, slot, frame.device
        )
        with wp.ScopedDevice(frame.device):
            self.depths = wp.zeros(self.bins.items, dtype=wp.vec2f)
            self.records = wp.zeros(3 * self.bins.items, dtype=wp.vec4f)
            self.depth_range = wp.zeros(2, dtype=wp.float32)
            self.hit = wp.zeros(frame.pixels, dtype=wp.vec3d)
            self.no_tests = wp.zeros(1, dtype=wp.int32)

    def passes(self) -> list[Pass]:
        """Build and trace, in the order they run."""
        scene = ("points", "triangles", "camera")
        bins = self.bins
        return [
            Pass("camera grid: project", "build", scene, ("camera boxes",), self.launch_project),
            Pass(
                "camera grid: count", "build", (*scene, "camera boxes"), ("camera counts",),
                lambda: bins.launch_count(self.launch_small, self.launch_large),
            ),
            Pass(
                "camera grid: emit pairs", "build", (*scene, "camera boxes", "camera counts"), ("camera pairs",),
                lambda: bins.launch_emit(self.launch_small, self.launch_large),
            ),
            Pass("camera grid: sort pairs", "build", ("camera pairs",), ("camera grid",), bins.launch_sort),
            Pass("primary rays", "trace", (*scene, "camera grid"), ("hits",), self.launch_trace),
        ]  # fmt: skip

    def launch_project(self) -> None:
        f, b = self.frame, self.bins
        b.launch_clear()
        wp.launch(reset_range_kernel, dim=1, outputs=[self.depth_range], device=f.device)
        wp.launch(
            kernels.project_kernel,
            dim=b.items,
            inputs=[
                f.triangle_count, f.width, f.height, self.build.tile, self.widening, self.outward,
                TRIANGLE_TESTS.index(self.build.triangle_test), f.eye, f.axes, f.tangents, f.points, f.triangles,
                f.weld, f.valid,
            ],
            outputs=[b.boxes, self.depths, self.depth_range, self.records, b.rows, b.row_count],
            device=f.device,
        )  # fmt: skip

    def _grid(self) -> list[object]:
        f, spans = self.frame, self.build.depth_lists == "spans"
        return [
            f.width, f.height, self.build.tile, self.build.slices, spans, self.widening, f.eye, f.axes,
            f.tangents, f.points, f.triangles, self.bins.boxes, self.depths, self.depth_range,
        ]  # fmt: skip

    def _pairs(self) -> list[wp.array]:
        pairs = self.bins.pairs
        return [pairs.count, pairs.scan, pairs.keys, pairs.values]

    def launch_small(self, mode: int) -> None:
        wp.launch(
            kernels.bin_triangles_kernel,
            dim=self.bins.items,
            inputs=[mode, *self._grid()],
            outputs=self._pairs(),
            device=self.frame.device,
        )

    def launch_large(self, mode: int) -> None:
        wp.launch(
            kernels.bin_rows_kernel,
            dim=self.bins.rows.shape[0],
            inputs=[mode, self.bins.items, *self._grid(), self.bins.rows, self.bins.row_count],
            outputs=self._pairs(),
            device=self.frame.device,
        )

    @property
    def threads(self) -> int:
        """Threads of the tracing kernels: whole tracing tiles of k x k sorting tiles."""
        k = self.trace.k
        return -(-self.across // k) * -(-self.down // k) * (k * self.build.tile) ** 2

    def launch_trace(self, tests: wp.array | None = None) -> None:
        """Closest hits. ``tests`` (int32 [pixels]) receives the triangle tests of each pixel, if given."""
        f, a, pairs = self.frame, self.frame.answers, self.bins.pairs
        wp.launch(
            make_trace_kernel(Variant.of(self.build)),
            dim=self.threads,
            inputs=[
                f.width, f.height, self.build.tile, self.trace.k, self.build.slices, f.eye, f.column, f.row,
                f.points, f.triangles, f.weld, self.depth_range, pairs.begin, pairs.end, pairs.keys, pairs.values,
                self.records,
            ],
            outputs=[a.triangle, a.t, a.u, a.v, self.hit, self.no_tests if tests is None else tests],
            block_dim=block_for((self.trace.k * self.build.tile) ** 2),
            device=f.device,
        )  # fmt: skip
