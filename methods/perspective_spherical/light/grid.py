"""Host side of one light grid: its arrays and the launches of its passes."""

from typing import Any

import warp as wp

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.schedule.passes import Pass
from ..camera.grid import CameraGrid
from ..lists.binning import BIN_BLOCK, GridSettings, TileBins
from ..lists.chunks import Chunks
from ..lists.sorting import TileSort
from ..lists.staging import block_for, staged, wide
from ..variants.split_lists import Items, count_chunks_kernel
from .placement import LightPlaces
from .rays import key_kernel
from .tiles import bin_kernel, make_bound_kernel
from .trace import make_shadow_kernel


class LightGrid:
    """The grid of one light, and the shadow rays traced through it.

    places  :class:`.placement.LightPlaces`: its rays, rectangles and tiles
    sorted  the pixels of each tile
    """

    def __init__(self, settings: GridSettings, index: int, camera: CameraGrid):
        self.settings, self.index = settings, index
        frame, build, trace = settings.frame, settings.build, settings.trace
        self.places = places = LightPlaces(settings, index, camera)
        tiles, pixels, device = build.light_tile_count, frame.pixels, frame.device
        self.bins = TileBins(frame.triangle_count * build.light_faces, tiles, build.light_slices, settings)
        places.grid.lists = self.bins.lists
        # Every pixel is a pair; those without a shadow ray belong to no tile.
        written = wp.array([pixels], dtype=wp.int64, device=device)
        self.sorted = TileSort(tiles, 1, pixels, written, 0, build.sort, device)
        self.chunks = chunks = Chunks(self.sorted.lists, pixels, tiles, trace.r, trace.balancing, device)
        split = trace.triangle_chunk
        self.items = Items(chunks.capacity if split else 1, settings.capacity[2], split, device)
        self.block = block_for(trace.r)
        self.lanes = self.block if wide(device) else 1
        self.no_tests = wp.zeros(1, dtype=wp.int32, device=device)

    def passes(self) -> list[Pass]:
        """Map and sort the rays, build the grid in their rectangle, trace."""
        i, bins = self.index, self.bins
        light, effect = f"light/{i}", f"shadows/{i}"
        boxes, pairs, grid = f"light boxes/{i}", f"light pairs/{i}", f"light grid/{i}"
        rays, chunks = f"sorted rays/{i}", f"light rays/{i}"
        parts = (f"list parts/{i}",) if self.items.parts.split else ()
        first, rect, place = self.places.passes()
        scene = ("points", "triangles", light, rect, *((rays,) if self.places.grid.skip_empty else ()))
        traced = ("points", "triangles", "hits", light, grid, chunks, *parts, *self.settings.effects.surface_reads())

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
        frame, places, pairs = self.settings.frame, self.places, self.sorted
        places.grid.deepest.fill_(-1)
        pairs.clear()
        if pairs.counted:
            pairs.lists.keys.fill_(pairs.cells)  # behind the rays that are sorted
        inputs = [places.space, places.grid, places.rays, pairs.pairs]
        frame.launch(key_kernel, frame.pixels, inputs, [frame.answers.shadowed])
        pairs.launch_sort()

    def launch_bound(self) -> None:
        settings, bins, places = self.settings, self.bins, self.places
        build = settings.build
        bins.clear_queue()
        kernel = make_bound_kernel(build.light_map if build.light_bounds == "exact" else build.light_bounds)
        inputs = [settings.test, settings.outward, places.space, places.grid, settings.frame.mesh, bins.bins]
        settings.frame.launch(specialised(kernel, settings.effects.switches(self.index)), bins.items, inputs)

    def launch_bin(self) -> None:
        frame, bins, places = self.settings.frame, self.bins, self.places
        bins.clear_pairs()
        frame.launch(bin_kernel, bins.threads, [places.space, places.grid, frame.mesh, bins.bins], block=BIN_BLOCK)

    def traced(self) -> bool:
        """Whether the last frame traced rays to this light; else what is here is of an older frame. Reads back."""
        conditional = self.settings.effects.has_receivers(self.index) and not self.places.marks
        return not conditional or bool(self.settings.frame.reached.numpy()[self.index])

    def launch_split(self) -> None:
        """The parts of lists that are tested apart."""
        inputs = [self.items.parts.split, self.chunks.of_rays, self.bins.lists]
        self.items.launch(count_chunks_kernel, inputs, self.settings.needs, self.settings.slot + 2)

    def launch_trace(self, tests: wp.array | None = None) -> None:
        """Shadow bits. ``tests`` (int32 [pixels]) is raised by the triangle tests of each pixel's ray, if given."""
        settings, places, parts = self.settings, self.places, self.items.parts
        f, shadowed = settings.frame, settings.frame.answers.shadowed
        if parts.split and tests is not None:
            # Set by an earlier trace: rays whose bit is set would be skipped.
            shadowed[self.index].zero_()
        blocks = self.items.capacity if parts.split else self.chunks.capacity
        kernel = make_shadow_kernel(settings.test, self.block if staged(settings.trace.staging, f.device) else 0)
        inputs = [
            self.lanes, places.space, places.grid, places.rays, f.camera, f.mesh, f.alpha, f.hits(0), self.chunks.of_rays,
            parts,
        ]  # fmt: skip
        kernel = specialised(kernel, settings.effects.switches(self.index))
        outputs = [shadowed, self.no_tests if tests is None else tests]
        f.launch(kernel, blocks * self.lanes, inputs, outputs, self.block)
