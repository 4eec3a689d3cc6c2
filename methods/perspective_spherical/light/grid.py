"""Host side of one light grid: its arrays and the launches of its passes."""

from typing import Any

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass
from ....harness.scene.effects import Effects
from ..camera.grid import CameraGrid
from ..camera.ray_tests import WIDENINGS
from ..lists.binning import BIN_BLOCK, TileBins
from ..lists.chunks import Chunks
from ..lists.sorting import TileSort
from ..lists.staging import block_for, staged, wide
from ..parameters import TRIANGLE_TESTS, Build, Trace
from ..variants.split_lists import Items, count_chunks_kernel
from .placement import LightPlaces
from .rays import key_kernel
from .tile_edges import LightTiles
from .tiles import bin_kernel, make_bound_kernel
from .trace import make_shadow_kernel


class LightGrid:
    """The grid of one light, and the shadow rays traced through it.

    places     :class:`.light.placement.LightPlaces`: where the rays lie in the light's rectangles
    last_slice int32 [pixels]: last slice that a shadow ray reaches
    deepest    int32 [tiles]: last slice that a shadow ray of the tile reaches, -1 without rays
    rays       the pixels of each tile
    records    vec4f [6 * triangle_count]: see :mod:`.light.segment_tests`
    """

    def __init__(
        self,
        frame: Frame,
        build: Build,
        trace: Trace,
        index: int,
        camera: CameraGrid,
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
        self.places = places = LightPlaces(frame, index, camera, build, effects)
        self.test = TRIANGLE_TESTS.index(build.triangle_test)
        self.widening = WIDENINGS[self.test]
        tiles, pixels, device = build.light_tile_count, frame.pixels, frame.device
        self.bins = TileBins(
            frame.triangle_count * build.light_faces, tiles, build.light_slices, capacity, needs, slot, build.sort, device
        )  # fmt: skip
        # Every pixel is a pair; those without a shadow ray belong to no tile.
        written = wp.array([pixels], dtype=wp.int64, device=device)
        self.rays = TileSort(tiles, 1, pixels, written, 0, build.sort, device)
        self.chunks = Chunks(self.rays.lists, pixels, tiles, trace.r, trace.balancing, device)
        self.items = Items(
            self.chunks.capacity if trace.triangle_chunk else 1, capacity[2], trace.triangle_chunk, device
        )
        self.block = block_for(trace.r)
        self.lanes = self.block if wide(device) else 1
        with wp.ScopedDevice(device):
            self.spans = wp.zeros(self.bins.items, dtype=wp.vec2i)
            self.records = wp.zeros(6 * max(1, frame.triangle_count), dtype=wp.vec4f)
            self.last_slice = wp.zeros(pixels, dtype=wp.int32)
            self.deepest = wp.zeros(tiles, dtype=wp.int32)
            self.no_tests = wp.zeros(1, dtype=wp.int32)
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

    def passes(self) -> list[Pass]:
        """Map and sort the rays, build the grid in their rectangle, trace."""
        i, bins = self.index, self.bins
        light, effect = f"light/{i}", f"shadows/{i}"
        boxes, pairs, grid = f"light boxes/{i}", f"light pairs/{i}", f"light grid/{i}"
        rays, chunks = f"sorted rays/{i}", f"light rays/{i}"
        parts = (f"list parts/{i}",) if self.trace.triangle_chunk else ()
        first, rect, place = self.places.passes()
        scene = ("points", "triangles", light, rect, *((rays,) if self.tiles.skip_empty else ()))
        traced = ("points", "triangles", "hits", light, grid, chunks, *parts, *self.effects.surface_reads())

        def one(name: str, part: str, reads: tuple[str, ...], writes: str, launch: Any, scratch: bool = False) -> Pass:
            return Pass(f"light {i}: {name}", part, reads, (writes,), launch, effect, scratch)

        passes = [
            *first,
            one("sort rays", "shadow", ("hits", rect, place), rays, self.launch_sort_rays, True),
            one("chunks", "shadow", (rays,), chunks, self.chunks.launch, True),
            one("bound triangles", "light build", scene, boxes, self.launch_bound),
            one("emit pairs", "light build", (*scene, boxes), pairs, self.launch_bin),
            one("sort pairs", "light build", (pairs,), grid, bins.launch_sort, True),
        ]
        if parts:
            # Apart from tracing: it takes scratch memory, and bits may not be set where nothing receives the light.
            passes.append(one("split lists", "shadow", (grid, chunks), parts[0], self.launch_split, True))
        return [*passes, one("shadow rays", "shadow", traced, f"shadowed/{i}", self.launch_trace)]

    def launch_sort_rays(self) -> None:
        rays, places = self.rays, self.places
        self.deepest.fill_(-1)
        rays.clear()
        if rays.counted:
            rays.lists.keys.fill_(rays.cells)  # behind the rays that are sorted
        self._launch(
            key_kernel,
            self.frame.pixels,
            [places.space, self.tiles, places.receiver, places.place],
            [rays.pairs, self.last_slice, self.frame.answers.shadowed],
        )
        rays.launch_sort()

    def launch_bound(self) -> None:
        f, b, bins, places = self.frame, self.build, self.bins, self.places
        bins.clear_queue()
        kernel = make_bound_kernel(b.light_map if b.light_bounds == "exact" else b.light_bounds)
        self._launch(
            specialised(kernel, self.effects.switches(self.index)),
            bins.items,
            [f.triangle_count, self.test, self.widening, self.outward, places.space, self.tiles, f.mesh],
            [bins.boxes, self.spans, self.records, bins.queue],
        )

    def launch_bin(self) -> None:
        bins, places = self.bins, self.places
        bins.clear_pairs()
        inputs = [self.widening, places.space, self.tiles, self.frame.mesh, bins.boxes, self.spans, bins.queue]
        self._launch(bin_kernel, bins.threads, inputs, [bins.pairs], BIN_BLOCK)

    def traced(self) -> bool:
        """Whether the last frame traced rays to this light; else what is here is of an older frame. Reads back."""
        conditional = self.effects.has_receivers(self.index) and not self.places.marks
        return not conditional or bool(self.frame.reached.numpy()[self.index])

    def launch_split(self) -> None:
        """The parts of lists that are tested apart."""
        inputs = [self.trace.triangle_chunk, self.chunks.of_rays, self.bins.lists]
        self.items.launch(count_chunks_kernel, inputs, self.needs, self.item_slot)

    def launch_trace(self, tests: wp.array | None = None) -> None:
        """Shadow bits. ``tests`` (int32 [pixels]) is raised by the triangle tests of each pixel's ray, if given."""
        f, split = self.frame, self.trace.triangle_chunk
        if split and tests is not None:
            # Set by an earlier trace: rays whose bit is set would be skipped.
            f.answers.shadowed[self.index].zero_()
        blocks = self.items.capacity if split else self.chunks.capacity
        in_blocks = staged(self.trace.staging, f.device)
        kernel = make_shadow_kernel(self.test, self.block if in_blocks else 0)
        self._launch(
            specialised(kernel, self.effects.switches(self.index)),
            blocks * self.lanes,
            [
                self.lanes, self.build.light_slices, self.places.space, f.camera, f.mesh, f.alpha, f.hits(0),
                self.camera.hit, self.last_slice, self.chunks.of_rays, self.bins.lists, self.records, self.items.parts,
            ],
            [f.answers.shadowed, self.no_tests if tests is None else tests],
            self.block,
        )  # fmt: skip

    def _launch(self, kernel: wp.Kernel, dim: int, inputs: list, outputs: list, block: int = 256) -> None:
        self.frame.launch(kernel, dim, inputs, outputs, block)
