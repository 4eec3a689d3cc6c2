"""Host side of one light grid: its arrays and the launches of its passes."""

from __future__ import annotations

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass
from ....harness.scene.effects import Effects
from ..camera.grid import CameraGrid
from ..camera.ray_tests import WIDENINGS
from ..lists.binning import BIN_BLOCK, MOST_COUNTED, TileBins
from ..lists.chunks import Chunks, RayChunks
from ..lists.items import Items, count_chunks_kernel
from ..parameters import TRIANGLE_TESTS, Build, Trace
from ..variants import Variant, block_for, staged, wide
from . import frame as rays
from .bounds import make_bound_kernel
from .placement import LightPlaces
from .space import LightTiles
from .tiles import bin_kernel
from .trace import make_shadow_kernel
from .trace_staged import make_staged_shadow_kernel


class LightGrid:
    """The grid of one light, and the shadow rays traced through it.

    places     :class:`.light.placement.LightPlaces`: where the rays lie in the light's rectangles
    last_slice int32 [pixels]: last slice that a shadow ray reaches
    deepest    int32 [tiles]: last slice that a shadow ray of the tile reaches, -1 without rays
    ray_keys, ray_values  int32 [pixels or more]: (light tile, primary ray) pairs, sorted
    records    vec4f [6 * triangle_count]: see :mod:`.light.segment_tests`
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
        self.places = LightPlaces(frame, index, camera, build, effects)
        self.test = TRIANGLE_TESTS.index(build.triangle_test)
        self.widening = WIDENINGS[TRIANGLE_TESTS.index(build.triangle_test)]
        self.tile_count = build.light_tile_count
        self.bins = TileBins(
            frame.triangle_count * build.light_faces,
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
            split,
            frame.device,
        )
        self.counted = build.sort == "counting" and self.tile_count <= MOST_COUNTED
        self.key_bits = self.tile_count.bit_length()
        many = wide(frame.device)
        self.block = block_for(trace.r)
        self.lanes = self.block if many else 1
        with wp.ScopedDevice(frame.device):
            self.spans = wp.zeros(self.bins.items, dtype=wp.vec2i)
            self.records = wp.zeros(6 * max(1, frame.triangle_count), dtype=wp.vec4f)
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

        places = self.places
        self.tiles = filled(
            LightTiles,
            faces=build.light_faces,
            tiles=build.light_tiles,
            slices=build.light_slices,
            spans=build.depth_lists == "spans",
            skip_empty=build.skip_empty and not places.of_scene,
            extent=places.extent,
            columns=places.columns,
            rows=places.rows,
            stretch=places.stretch,
            deepest=self.deepest,
        )
        self.ray_chunks = filled(
            RayChunks,
            tiles=self.ray_keys,
            pixels=self.ray_values,
            first=self.chunks.outArr,
            total=self.chunks.numCBlocks,
        )

    def passes(self) -> list[Pass]:
        """Map and sort the rays, build the grid in their rectangle, trace."""
        i, bins = self.index, self.bins
        light, effect = f"light/{i}", f"shadows/{i}"
        build, shadow = "light build", "shadow"
        grid_name, ray_name = f"light grid/{i}", f"light rays/{i}"
        first, rect, place = self.places.passes()
        occupied = (f"sorted rays/{i}",) if self.tiles.skip_empty else ()
        scene = ("points", "triangles", light, rect, *occupied)
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
                (f"shadowed/{i}",), self.launch_trace, effect,
            ),
        ]  # fmt: skip

    def launch_sort_rays(self) -> None:
        f, chunks, places = self.frame, self.chunks, self.places
        self.deepest.fill_(-1)
        if self.counted:
            self.tile_rays.zero_()
            self.ray_keys.fill_(self.tile_count)
        self._launch(
            rays.key_kernel,
            f.pixels,
            [self.counted, places.space, self.tiles, places.receiver, places.place],
            [self.pixel_keys, self.pixel_values, self.last_slice, self.tile_rays, f.answers.shadowed],
        )
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
        f, b, bins, places = self.frame, self.build, self.bins, self.places
        bins.clear_queue()
        self._launch(
            specialised(make_bound_kernel(places.map, b.light_bounds), self.effects.switches(self.index)),
            bins.items,
            [
                f.triangle_count, self.test, self.widening, self.outward, places.space, self.tiles, f.mesh,
            ],
            [bins.boxes, self.spans, self.records, bins.queue],
        )  # fmt: skip

    def launch_bin(self) -> None:
        f, bins = self.frame, self.bins
        bins.clear_pairs()
        wp.launch(
            bin_kernel,
            dim=bins.threads,
            inputs=[self.widening, self.places.space, self.tiles, f.mesh, bins.boxes, self.spans, bins.queue],
            outputs=[bins.pairs],
            block_dim=BIN_BLOCK,
            device=f.device,
        )

    def traced(self) -> bool:
        """Whether the last frame traced rays to this light; else what is here is of an older frame. Reads back."""
        conditional = self.effects.has_receivers(self.index) and not self.places.marks
        return not conditional or bool(self.frame.reached.numpy()[self.index])

    def launch_split(self) -> None:
        """The parts of lists that are tested apart."""
        inputs = [self.trace.triangle_chunk, self.ray_chunks, self.bins.lists]
        self.items.launch(count_chunks_kernel, inputs, self.needs, self.item_slot)

    def launch_trace(self, tests: wp.array | None = None) -> None:
        """Shadow bits. ``tests`` (int32 [pixels]) is raised by the triangle tests of each pixel's ray, if given."""
        f, split = self.frame, self.trace.triangle_chunk
        blocks = self.chunks.capacity
        if split:
            blocks = self.items.capacity
            if tests is not None:
                # Set by an earlier trace: rays whose bit is set would be skipped.
                f.answers.shadowed[self.index].zero_()
        variant = Variant.of(self.build)
        in_blocks = staged(self.trace, f.device)
        lanes = self.block if in_blocks else self.lanes
        kernel = make_staged_shadow_kernel(variant, self.block) if in_blocks else make_shadow_kernel(variant)
        wp.launch(
            specialised(kernel, self.effects.switches(self.index)),
            dim=blocks * lanes,
            inputs=[
                lanes, self.build.light_slices, self.places.space, f.camera, f.mesh, f.alpha, f.hits(0),
                self.camera.hit, self.last_slice, self.ray_chunks, self.bins.lists, self.records, self.items.parts,
            ],
            outputs=[f.answers.shadowed, self.no_tests if tests is None else tests],
            block_dim=self.block,
            device=f.device,
        )  # fmt: skip

    def _launch(self, kernel: wp.Kernel, dim: int, inputs: list, outputs: list) -> None:
        wp.launch(kernel, dim=dim, inputs=inputs, outputs=outputs, device=self.frame.device)
