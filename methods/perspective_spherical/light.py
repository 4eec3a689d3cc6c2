"""Host side of one spherical light grid: its arrays and the launches of its passes."""

from __future__ import annotations

import warp as wp

from ...harness.frame import Frame
from ...harness.passes import Pass
from ..common.pairs import mark_lists_kernel
from . import light_grid as grid
from . import shadow_rays as rays
from .binning import TileBins
from .parameters import Build, Trace


class LightGrid:
    """The spherical grid of one light, and the shadow rays traced through it.

    place      vec3d [pixels]: azimuth, elevation, distance of each hit point seen from the light
    extent     float64 [8]: lowest then highest azimuth, elevation, distance of the rays: the clamped rectangle
    ray_keys, ray_values  int32 [2 * pixels]: (light tile, primary ray) pairs, sorted
    chunks     int32 [tiles]: chunks of each tile; first vec2i [C_total at most]: tile and first ray of each chunk
    """

    def __init__(
        self,
        frame: Frame,
        index: int,
        hit: wp.array,
        build: Build,
        trace: Trace,
        capacity: tuple[int, int],
        needs: wp.array,
        slot: int,
    ):
        self.frame, self.index, self.hit, self.build, self.trace = frame, index, hit, build, trace
        n = build.light_tiles
        self.tile_count = n * n
        self.bins = TileBins(
            frame.triangle_count, n * n * build.light_slices, capacity, needs, slot, frame.device
        )
        # C_total = sum of ceil(R_j / r) is at most one chunk a non-empty tile and one for every r rays.
        self.chunk_capacity = min(frame.pixels, n * n) + frame.pixels // trace.r
        self.key_bits = self.tile_count.bit_length()
        self.reduce_threads = -(-frame.pixels // int(rays.SHARE))
        with wp.ScopedDevice(frame.device):
            self.spans = wp.zeros(self.bins.triangles, dtype=wp.vec2i)
            self.box = wp.zeros(rays.EXTENT, dtype=wp.float64)
            self.extent = wp.zeros(rays.EXTENT, dtype=wp.float64)
            self.axes = wp.zeros(1, dtype=wp.mat33d)
            self.place = wp.zeros(frame.pixels, dtype=wp.vec3d)
            self.ray_keys = wp.zeros(2 * frame.pixels, dtype=wp.int32)
            self.ray_values = wp.zeros(2 * frame.pixels, dtype=wp.int32)
            self.ray_begin = wp.zeros(self.tile_count, dtype=wp.int32)
            self.ray_end = wp.zeros(self.tile_count, dtype=wp.int32)
            self.chunks = wp.zeros(self.tile_count, dtype=wp.int32)
            self.chunk_scan = wp.zeros(self.tile_count, dtype=wp.int32)
            self.first = wp.zeros(self.chunk_capacity, dtype=wp.vec2i)
            self.no_tests = wp.zeros(1, dtype=wp.int32)

    def passes(self) -> list[Pass]:
        """Map and sort the rays, build the grid clamped to them, trace."""
        i, bins = self.index, self.bins
        light, effect = f"light/{i}", f"shadows/{i}"
        build, shadow = "light build", "shadow"
        rect, grid_name, ray_name = f"light rectangle/{i}", f"light grid/{i}", f"light rays/{i}"
        scene = ("points", "triangles", light, rect)
        return [
            Pass(f"light {i}: map rays", shadow, ("hits", light), (rect,), self.launch_map, effect),
            Pass(f"light {i}: sort rays", shadow, ("hits", rect), (f"sorted rays/{i}",), self.launch_sort_rays, effect),
            Pass(f"light {i}: chunks", shadow, (f"sorted rays/{i}",), (ray_name,), self.launch_chunks, effect),
            Pass(f"light {i}: bound triangles", build, scene, (f"light boxes/{i}",), self.launch_bound, effect),
            Pass(
                f"light {i}: count", build, (*scene, f"light boxes/{i}"), (f"light counts/{i}",),
                lambda: bins.launch_count(self.launch_small, self.launch_large), effect,
            ),
            Pass(
                f"light {i}: emit pairs", build, (*scene, f"light counts/{i}"), (f"light pairs/{i}",),
                lambda: bins.launch_emit(self.launch_small, self.launch_large), effect,
            ),
            Pass(f"light {i}: sort pairs", build, (f"light pairs/{i}",), (grid_name,), bins.launch_sort, effect),
            Pass(
                f"light {i}: shadow rays", shadow, ("points", "triangles", "hits", light, grid_name, ray_name),
                (f"visibility/{i}",), self.launch_trace, effect,
            ),
        ]  # fmt: skip

    def launch_map(self) -> None:
        f = self.frame
        device = f.device
        wp.launch(rays.reset_kernel, dim=rays.EXTENT, outputs=[self.box, self.extent], device=device)
        wp.launch(
            rays.box_kernel,
            dim=self.reduce_threads,
            inputs=[f.pixels, f.answers.triangle, self.hit],
            outputs=[self.box],
            device=device,
        )
        wp.launch(
            rays.aim_kernel,
            dim=1,
            inputs=[self.index, self.build.aimed, f.lights, self.box],
            outputs=[self.axes],
            device=device,
        )
        wp.launch(
            rays.map_kernel,
            dim=self.reduce_threads,
            inputs=[f.pixels, self.index, f.lights, self.axes, f.answers.triangle, self.hit],
            outputs=[self.place, self.extent],
            device=device,
        )

    def launch_sort_rays(self) -> None:
        f = self.frame
        wp.launch(
            rays.key_kernel,
            dim=f.pixels,
            inputs=[self.build.light_tiles, f.answers.triangle, self.place, self.extent],
            outputs=[self.ray_keys, self.ray_values, f.answers.visibility, self.index],
            device=f.device,
        )
        wp.utils.radix_sort_pairs(self.ray_keys, self.ray_values, f.pixels, 0, self.key_bits)

    def launch_chunks(self) -> None:
        f, r = self.frame, self.trace.r
        self.ray_begin.zero_()
        self.ray_end.zero_()
        wp.launch(
            mark_lists_kernel,
            dim=f.pixels,
            inputs=[self.tile_count, self.ray_keys],
            outputs=[self.ray_begin, self.ray_end],
            device=f.device,
        )
        wp.launch(
            rays.chunk_count_kernel,
            dim=self.tile_count,
            inputs=[r, self.ray_begin, self.ray_end],
            outputs=[self.chunks],
            device=f.device,
        )
        wp.utils.array_scan(self.chunks, self.chunk_scan, inclusive=True)
        wp.launch(
            rays.chunk_kernel,
            dim=self.tile_count,
            inputs=[r, self.ray_begin, self.chunks, self.chunk_scan],
            outputs=[self.first],
            device=f.device,
        )

    def launch_bound(self) -> None:
        f, b = self.frame, self.bins
        b.launch_clear()
        wp.launch(
            grid.bound_kernel,
            dim=b.triangles,
            inputs=[
                f.triangle_count, self.index, self.build.light_tiles, self.build.light_slices, f.lights, self.axes,
                self.extent, f.points, f.triangles, f.valid,
            ],
            outputs=[b.boxes, self.spans, b.rows, b.row_count],
            device=f.device,
        )  # fmt: skip

    def _grid(self) -> list[object]:
        f, spans = self.frame, self.build.depth_lists == "spans"
        return [
            self.index, self.build.light_tiles, self.build.light_slices, spans, f.lights, self.axes, self.extent,
            f.points, f.triangles, self.bins.boxes, self.spans,
        ]  # fmt: skip

    def _pairs(self) -> list[wp.array]:
        pairs = self.bins.pairs
        return [pairs.count, pairs.scan, pairs.keys, pairs.values]

    def launch_small(self, mode: int) -> None:
        wp.launch(
            grid.bin_triangles_kernel,
            dim=self.bins.triangles,
            inputs=[mode, *self._grid()],
            outputs=self._pairs(),
            device=self.frame.device,
        )

    def launch_large(self, mode: int) -> None:
        wp.launch(
            grid.bin_rows_kernel,
            dim=self.bins.rows.shape[0],
            inputs=[mode, self.bins.triangles, *self._grid(), self.bins.rows, self.bins.row_count],
            outputs=self._pairs(),
            device=self.frame.device,
        )

    def launch_trace(self, tests: wp.array | None = None) -> None:
        """Shadow bits. ``tests`` (int32 [pixels]) is raised by the triangle tests of each pixel's ray, if given."""
        f, pairs = self.frame, self.bins.pairs
        wp.launch(
            rays.shadow_kernel,
            dim=self.chunk_capacity * self.trace.r,
            inputs=[
                self.index, self.trace.r, self.build.light_tiles, self.build.light_slices, f.lights, f.eye,
                f.points, f.triangles, f.weld, f.answers.triangle, self.hit, self.place, self.extent,
                self.chunk_scan, self.first, self.ray_end, self.ray_values, pairs.begin, pairs.end, pairs.values,
            ],
            outputs=[f.answers.visibility, self.no_tests if tests is None else tests],
            device=f.device,
        )  # fmt: skip
