"""Host side of one light grid: its arrays and the launches of its passes."""

from __future__ import annotations

import warp as wp

from ...harness.frame import Frame
from ...harness.passes import Pass
from ...harness.scene import Effects
from ...harness.specialise import specialised
from ..common.bounds import launch_bounds
from . import light_frame as rays
from .binning import BIN_BLOCK, MOST_COUNTED, TileBins
from .camera import CameraGrid
from .chunks import Chunks
from .items import Items, count_chunks_kernel
from .light_bounds import make_bound_kernel
from .light_grid import LightTiles, bin_kernel
from .light_rectangle import clamp_kernel, scene_kernel
from .light_tiles import edges_kernel
from .parameters import CLAMPS, LIGHT_MAPS, TRIANGLE_TESTS, Build, Trace
from .ray_tests import WIDENINGS
from .shadow import make_shadow_kernel
from .staged import make_staged_shadow_kernel
from .variants import Variant, block_for, staged, wide

FLOAT64_PAD, FLOAT32_PAD = 4.0e-14, 64 * 2.0**-24
"""What a ray's direction from the light is known to, relative to its length."""

PARALLEL_PAD = 2.0**-45
"""How far the rays of a directional light turn, seen from its post 2^24 scene radii away: 2 (2^-24)^2, and twice that
again."""

REDUCE_BLOCK, REDUCE_THREADS = 256, 1 << 17


class LightGrid:
    """The grid of one light, and the shadow rays traced through it.

    receiver   uint8 [pixels]: which pixels have a shadow ray
    place      vec4d [pixels]: where the ray lies in the light's rectangles, its distance, which rectangle
    pads       float64 [2]: what a ray's direction is known to, relative to its length; see :func:`.light_frame.aim_kernel`
    extent     float64 [faces, 8]: lowest then highest coordinates and distance: the clamped rectangles
    last_slice int32 [pixels]: last slice that a shadow ray reaches
    deepest    int32 [tiles]: last slice that a shadow ray of the tile reaches, -1 without rays
    ray_keys, ray_values  int32 [pixels or more]: (light tile, primary ray) pairs, sorted
    columns, rows         vec4d [faces * light_tiles]: edges of the tiles
    records    vec4f [6 * triangle_count]: see :mod:`.segment_tests`
    """

    def __init__(
        self,
        frame: Frame,
        index: int,
        camera: CameraGrid,
        build: Build,
        trace: Trace,
        outward: float,
        capacity: tuple[int, int, int],
        needs: wp.array,
        slot: int,
        effects: Effects,
    ):
        self.effects = effects
        self.needs, self.item_slot = needs, slot + 2
        self.frame, self.index, self.camera, self.build, self.trace = frame, index, camera, build, trace
        self.outward = outward
        self.map = LIGHT_MAPS.index(build.light_map)
        self.test = TRIANGLE_TESTS.index(build.triangle_test)
        self.widening = WIDENINGS[TRIANGLE_TESTS.index(build.triangle_test)]
        single = build.precision != "float64"
        self.pad = FLOAT32_PAD if single else FLOAT64_PAD
        if effects.is_directional(index):
            self.pad += PARALLEL_PAD
        self.distance_pad = FLOAT32_PAD if build.precision == "float32" else 1e-9
        self.of_scene = build.clamp == "scene"
        n, faces = build.light_tiles, build.light_faces
        self.tile_count = build.light_tile_count
        self.bins = TileBins(
            frame.triangle_count * faces,
            self.tile_count,
            build.light_slices,
            capacity,
            needs,
            slot,
            build.sort,
            frame.device,
        )
        self.chunks = Chunks(frame.pixels, self.tile_count, trace.r, trace.balancing, frame.device)
        split = trace.triangle_chunk
        self.items = Items(
            self.chunks.capacity if split else 1,
            capacity[2] or 2 * self.chunks.capacity if split else 1,
            frame.device,
        )
        self.counted = build.sort == "counting" and self.tile_count <= MOST_COUNTED
        self.key_bits = self.tile_count.bit_length()
        many = wide(frame.device)
        share = 1 if many else 128
        threads = min(REDUCE_THREADS, -(-frame.pixels // share))
        self.reduce_threads = -(-threads // REDUCE_BLOCK) * REDUCE_BLOCK if many else threads
        self.block = block_for(trace.r)
        self.lanes = self.block if many else 1
        with wp.ScopedDevice(frame.device):
            self.spans = wp.zeros(self.bins.items, dtype=wp.vec2i)
            self.records = wp.zeros(6 * max(1, frame.triangle_count), dtype=wp.vec4f)
            self.box = wp.zeros(6, dtype=wp.float64)
            self.extent = wp.zeros(faces * int(rays.EXTENT), dtype=wp.float64)
            self.axes = wp.zeros(1, dtype=wp.mat33d)
            self.eye = wp.zeros(1, dtype=wp.vec3f) if self.of_scene else frame.eye
            self.scene_box = wp.zeros(6 if self.of_scene else 0, dtype=wp.float32)
            self.ray_box = wp.zeros(6 if self.of_scene else 0, dtype=wp.float64)
            self.ray_extent = wp.zeros(self.extent.shape[0] if self.of_scene else 0, dtype=wp.float64)
            self.pads = wp.zeros(2, dtype=wp.float64)
            self.columns = wp.zeros(faces * n, dtype=wp.vec4d)
            self.rows = wp.zeros(faces * n, dtype=wp.vec4d)
            self.stretch = wp.zeros(faces, dtype=wp.vec2d)
            self.receiver = wp.zeros(frame.pixels, dtype=wp.uint8)
            self.place = wp.zeros(frame.pixels, dtype=wp.vec4d)
            # A radix sort works in place, in arrays twice as long; a counting sort from one array into another.
            length = frame.pixels if self.counted else 2 * frame.pixels
            self.ray_keys = wp.zeros(length, dtype=wp.int32)
            self.ray_values = wp.zeros(length, dtype=wp.int32)
            self.pixel_keys = wp.zeros(length, dtype=wp.int32) if self.counted else self.ray_keys
            self.pixel_values = wp.zeros(length, dtype=wp.int32) if self.counted else self.ray_values
            self.tile_rays = wp.zeros(self.tile_count if self.counted else 1, dtype=wp.int32)
            self.tile_end = wp.zeros(self.tile_count if self.counted else 1, dtype=wp.int32)
            self.last_slice = wp.zeros(frame.pixels, dtype=wp.int32)
            self.deepest = wp.zeros(self.tile_count, dtype=wp.int32)
            self.no_tests = wp.zeros(1, dtype=wp.int32)

        self.tiles = LightTiles()
        self.tiles.faces, self.tiles.tiles, self.tiles.slices = faces, n, build.light_slices
        self.tiles.spans = build.depth_lists == "spans"
        self.tiles.skip_empty = build.skip_empty and not self.of_scene
        self.tiles.extent, self.tiles.columns, self.tiles.rows = self.extent, self.columns, self.rows
        self.tiles.stretch, self.tiles.deepest = self.stretch, self.deepest

    def passes(self) -> list[Pass]:
        """Map and sort the rays, build the grid in their rectangle, trace."""
        i, bins = self.index, self.bins
        light, effect = f"light/{i}", f"shadows/{i}"
        build, shadow = "light build", "shadow"
        rect, grid_name, ray_name = f"light rectangle/{i}", f"light grid/{i}", f"light rays/{i}"
        view = ("camera", "camera boxes") if self.build.clamp == "view" else ()
        seen = ("hits", light, *view, *self.effects.mask_reads(i))
        occupied = (f"sorted rays/{i}",) if self.tiles.skip_empty else ()
        scene = ("points", "triangles", light, rect, *occupied)
        place = rect
        first = [Pass(f"light {i}: map rays", shadow, seen, (rect,), self.launch_map, effect)]
        if self.of_scene:
            # The rectangle knows nothing of the rays, so the grid stays where only the camera moves.
            place = f"ray places/{i}"
            around = ("points", "triangles", "reach", light)
            first = [
                Pass(f"light {i}: rectangle", build, around, (rect,), self.launch_rectangle, effect),
                Pass(f"light {i}: map rays", shadow, (*seen, rect), (place,), self.launch_map_rays, effect),
            ]
        mapped = ("hits", rect, place)
        parts: tuple[str, ...] = ()
        split = []
        if self.trace.triangle_chunk:
            # Apart from tracing: it takes scratch memory, and bits may not be set where nothing receives the light.
            parts = (f"list parts/{i}",)
            reads = (grid_name, ray_name)
            split = [Pass(f"light {i}: split lists", shadow, reads, parts, self.launch_split, effect, True)]
        return [
            *first,
            Pass(f"light {i}: sort rays", shadow, mapped, (f"sorted rays/{i}",), self.launch_sort_rays, effect, True),
            Pass(f"light {i}: chunks", shadow, (f"sorted rays/{i}",), (ray_name,), self.launch_chunks, effect, True),
            Pass(f"light {i}: bound triangles", build, scene, (f"light boxes/{i}",), self.launch_bound, effect),
            Pass(
                f"light {i}: emit pairs", build, (*scene, f"light boxes/{i}"), (f"light pairs/{i}",), self.launch_bin,
                effect,
            ),
            Pass(f"light {i}: sort pairs", build, (f"light pairs/{i}",), (grid_name,), bins.launch_sort, effect, True),
            *split,
            Pass(
                f"light {i}: shadow rays", shadow,
                (
                    "points", "triangles", "hits", light, grid_name, ray_name, *parts, *self.effects.surface_reads(),
                ),
                (f"visibility/{i}",), self.launch_trace, effect,
            ),
        ]  # fmt: skip

    def launch_rectangle(self) -> None:
        """The light's axes, the rectangles around the scene and the edges of their tiles, without any ray."""
        f, b = self.frame, self.build
        launch_bounds(f, self.scene_box)
        self._launch(
            scene_kernel,
            b.light_faces,
            [self.index, self.map, b.aimed, f.posts, f.spots, self.scene_box, f.reach],
            [self.box, self.eye, self.extent],
        )
        self._aim()
        self._edges()

    def launch_map_rays(self) -> None:
        """Receivers and the place of every ray, in rectangles that are there."""
        self._launch(rays.reset_kernel, self.ray_extent.shape[0], [], [self.ray_box, self.ray_extent])
        self._box(self.ray_box)
        self._map(self.ray_extent)

    def launch_map(self) -> None:
        """Receivers, the light's axes, the place of every ray, the rectangles and the edges of their tiles."""
        f, b = self.frame, self.build
        self._launch(rays.reset_kernel, self.extent.shape[0], [], [self.box, self.extent])
        self._box(self.box)
        self._aim()
        self._map(self.extent)
        if b.clamp != "hits":
            self._launch(
                clamp_kernel,
                b.light_faces,
                [
                    self.index, self.map, b.light_faces, CLAMPS.index(b.clamp), b.aimed, 6, f.posts, f.spots,
                    self.axes, f.eye, f.axes, f.tangents, self.camera.depth_range,
                ],
                [self.extent],
            )  # fmt: skip
        self._edges()

    def _box(self, box: wp.array) -> None:
        f = self.frame
        wp.launch(
            specialised(rays.box_kernel, self.effects.switches(self.index)),
            dim=self.reduce_threads,
            inputs=[
                f.pixels,
                self.reduce_threads,
                self.index,
                f.answers.triangle,
                self.camera.hit,
                f.receivers,
            ],
            outputs=[self.receiver, box],
            block_dim=REDUCE_BLOCK,
            device=f.device,
        )

    def _aim(self) -> None:
        f, b = self.frame, self.build
        centred = b.precision == "float32-centred"
        self._launch(
            rays.aim_kernel,
            1,
            [self.index, b.aimed, f.posts, f.spots, self.box, centred, self.pad],
            [self.axes, self.pads],
        )

    def _map(self, extent: wp.array) -> None:
        f, b = self.frame, self.build
        wp.launch(
            rays.map_kernel,
            dim=self.reduce_threads,
            inputs=[
                f.pixels, self.reduce_threads, self.index, self.map, b.precision != "float64", f.posts, self.axes,
                self.receiver, self.camera.hit, self.box, self.pads,
            ],
            outputs=[self.place, extent],
            block_dim=REDUCE_BLOCK,
            device=f.device,
        )  # fmt: skip

    def _edges(self) -> None:
        b = self.build
        self._launch(
            edges_kernel,
            b.light_faces * b.light_tiles,
            [self.map, b.light_tiles, self.extent],
            [self.columns, self.rows, self.stretch],
        )

    def launch_sort_rays(self) -> None:
        f, b, chunks = self.frame, self.build, self.chunks
        self.deepest.fill_(-1)
        if self.counted:
            self.tile_rays.zero_()
            self.ray_keys.fill_(self.tile_count)
        self._launch(
            rays.key_kernel,
            f.pixels,
            [
                b.light_tiles, b.light_faces, b.light_slices, self.distance_pad, self.receiver, self.place,
                self.extent,
            ],
            [
                self.pixel_keys, self.pixel_values, self.last_slice, self.deepest, f.answers.visibility, self.index,
                self.counted, self.tile_rays,
            ],
        )  # fmt: skip
        if not self.counted:
            wp.utils.radix_sort_pairs(self.ray_keys, self.ray_values, f.pixels, 0, self.key_bits)
            return
        wp.utils.array_scan(self.tile_rays, self.tile_end, inclusive=True)
        self._launch(
            rays.place_rays_kernel,
            max(f.pixels, self.tile_count),
            [self.tile_count, self.pixel_keys, self.pixel_values, self.tile_rays, self.tile_end],
            [self.ray_keys, self.ray_values, chunks.begin, chunks.end],
        )

    def launch_chunks(self) -> None:
        self.chunks.launch(self.ray_keys, self.counted)

    def launch_bound(self) -> None:
        f, b, bins = self.frame, self.build, self.bins
        bins.clear_queue()
        self._launch(
            make_bound_kernel(self.map, b.light_bounds),
            bins.items,
            [
                f.triangle_count, self.index, b.light_faces, b.light_tiles, b.light_slices, self.widening,
                self.pads, self.distance_pad, self.outward, self.test, self.tiles.skip_empty, self.deepest, self.eye,
                self.box, f.lights, f.posts, self.axes, self.extent, f.points, f.triangles, f.weld, f.valid, bins.lanes,
                bins.slot + 1,
            ],
            [bins.boxes, self.spans, self.records, bins.queue, bins.needs],
        )  # fmt: skip

    def launch_bin(self) -> None:
        f, bins = self.frame, self.bins
        bins.clear_pairs()
        wp.launch(
            bin_kernel,
            dim=bins.threads,
            inputs=[
                self.tiles, bins.lanes, self.index, self.widening, self.pads, f.posts, self.axes, f.points,
                f.triangles, bins.boxes, self.spans, bins.queue, bins.pairs,
            ],
            block_dim=BIN_BLOCK,
            device=f.device,
        )  # fmt: skip

    def traced(self) -> bool:
        """Whether the last frame traced rays to this light; else what is here is of an older frame. Reads back."""
        return not self.effects.masked(self.index) or bool(self.frame.reached.numpy()[self.index])

    def launch_split(self) -> None:
        """The parts of lists that are tested apart."""
        pairs, chunks = self.bins, self.chunks
        self.items.launch(
            count_chunks_kernel,
            [
                self.trace.triangle_chunk, self.ray_keys, chunks.outArr, chunks.numCBlocks, pairs.begin, pairs.end,
            ],
            self.needs,
            self.item_slot,
        )  # fmt: skip

    def launch_trace(self, tests: wp.array | None = None) -> None:
        """Shadow bits. ``tests`` (int32 [pixels]) is raised by the triangle tests of each pixel's ray, if given."""
        f, pairs, chunks, split = self.frame, self.bins, self.chunks, self.trace.triangle_chunk
        blocks = chunks.capacity
        if split:
            blocks = self.items.capacity
            if tests is not None:
                f.answers.visibility[
                    self.index
                ].zero_()  # traced before: rays that are set would be left alone
        variant = Variant.of(self.build)
        in_blocks = staged(self.trace, f.device)
        lanes = self.block if in_blocks else self.lanes
        kernel = make_staged_shadow_kernel(variant, self.block) if in_blocks else make_shadow_kernel(variant)
        wp.launch(
            specialised(kernel, self.effects.switches(self.index)),
            dim=blocks * lanes,
            inputs=[
                self.index, lanes, self.build.light_slices, split, f.lights, f.eye, f.points,
                f.triangles, f.weld, f.answers.triangle, self.camera.hit, self.last_slice, self.ray_keys,
                self.ray_values, chunks.outArr, chunks.numCBlocks, pairs.begin, pairs.end, pairs.keys, pairs.values,
                self.records, f.alpha, self.items.items, self.items.scan,
            ],
            outputs=[f.answers.visibility, self.no_tests if tests is None else tests],
            block_dim=self.block,
            device=f.device,
        )  # fmt: skip

    def _launch(self, kernel: wp.Kernel, dim: int, inputs: list, outputs: list) -> None:
        wp.launch(kernel, dim=dim, inputs=inputs, outputs=outputs, device=self.frame.device)
