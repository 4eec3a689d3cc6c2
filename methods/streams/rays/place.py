"""Places of a light's rays, one for each pixel; where what they cover is known, they are counted in their cells at once."""

import functools
from typing import Any

import warp as wp

from ....harness.frame.effects.receivers import note_receiver
from ...common.pixels import tile_pixel
from ...exact.triangle import spare_bits
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import number_among
from ..camera.pixels import index_of
from ..cube.cells import RayCells
from ..cube.density import expect_ray
from ..cube.farthest import empty_tiles
from ..cube.lights import Aim, Light, aim_of
from ..cube.rectangle import record_place
from ..cube.spacing import BINS
from .hit_points import HitPoint, Placed, PrimaryHits, placed, placed_exactly, point_of
from .receivers import mark_receiver
from .sort import STORED_FACE, count_in_table, set_row_edges

REGISTERS, REGISTERS_OF_MARKING = 40, 48
"""Registers per thread, for twelve blocks of 128 per multiprocessor; ten where the kernel decides which hits are
receivers. The few rays that take the exact path spill; with 32 the others would, too."""


@wp.func
def store_point(pixel: wp.int32, triangle: wp.int32, h: wp.vec3f, cells: Any):
    """Store a pixel's hit point and what its ray hit."""
    set_entry(cells.triangle, pixel, triangle)
    set_entry(cells.point, pixel, wp.vec4f(h[0], h[1], h[2], wp.cast(pixel, wp.float32)))


@wp.func
def place_ray(
    hits: PrimaryHits,
    point: HitPoint,
    wanted: wp.bool,
    pixel: wp.int32,
    at: wp.vec2i,
    aim: Aim,
    keeps: wp.bool,
    cells: Any,
):
    """Store the place of a pixel's ray, if it has one (``wanted``). All threads of a block must call it.

    Not ``keeps``: only points that the triangle gives are stored; what the word gives :func:`.sort.put_ray` computes again,
    which takes less than 24 bytes of memory traffic.
    """
    found = placed(point, wanted, aim)
    if found.place[2] >= 0.0:
        set_entry(cells.place, pixel, found.place)
        if keeps:
            store_point(pixel, point.triangle, found.h, cells)
        else:
            set_entry(cells.triangle, pixel, point.triangle)
    elif wanted:
        found = placed_exactly(hits, pixel, at, aim)
        store_point(pixel, point.triangle, found.h, cells)
        p = found.place
        if not keeps:
            p[2] += wp.float32(STORED_FACE)
        set_entry(cells.place, pixel, p)
    expect_ray(pixel, found.place, cells)
    record_place(found.place, found.size, cells.rectangle)


@wp.func
def count_quickly(pixel: wp.int32, triangle: wp.int32, found: Placed, cells: Any):
    """Count a ray that the word places: its point is not stored (:func:`place_ray`)."""
    set_entry(cells.triangle, pixel, triangle)
    count_in_table(pixel, found.place, False, cells)


@wp.func
def count_exactly(pixel: wp.int32, triangle: wp.int32, found: Placed, cells: Any):
    """Count a ray that the triangle places, and store its point."""
    store_point(pixel, triangle, found.h, cells)
    count_in_table(pixel, found.place, True, cells)


@wp.func
def in_region(place: wp.vec4f, cells: Any) -> wp.bool:
    """Whether a place lies in the region; a face without rays has no bins per unit."""
    r = entry(cells.table, wp.int32(place[2]))
    x = (place[0] - r[0]) * r[2]
    y = (place[1] - r[1]) * r[3]
    return r[2] > 0.0 and wp.min(x, y) >= 0.0 and wp.max(x, y) <= wp.float32(BINS)


@wp.func
def facing_of(hits: PrimaryHits, pixel: wp.int32, facing: wp.array(dtype=wp.uint8)) -> wp.uint8:
    """What ``facing`` says of the triangle that a pixel hits; 0 at a miss."""
    word = entry(hits.nearest, pixel)
    faces = wp.uint8(0)
    if word != wp.uint64(0):
        faces = entry(facing, index_of(word, spare_bits(hits.mesh.triangles.shape[0])))
    return faces


@functools.cache
def make_map_kernel(receivers: str, keeps: bool = False) -> wp.Kernel:
    """Places of rays, a thread for each pixel, and what they cover.

    receivers  which pixels have a ray: "hits": all with a hit; "flagged": those that the harness has marked; "marked": those
               that this kernel decides and marks
    keeps      of :func:`place_ray`
    """
    registers = REGISTERS_OF_MARKING if receivers == "marked" else REGISTERS

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def map_kernel(
        first: wp.int32,
        asks_facing: wp.bool,
        light: Light,
        hits: PrimaryHits,
        cells: RayCells,
        flags: wp.array2d(dtype=wp.uint8),
        reached: wp.array(dtype=wp.int32),
        shadowed: wp.array2d(dtype=wp.uint8),
    ):
        """Clears the shadow bits, unless the receivers' pass of the harness has; empties ``farthest``. Nothing else is
        written for pixels without ray.

        first    of an image's threads, the first one here      asks_facing  whether receivers must face the light
        flags    uint8 [lights, pixels]: receivers               reached  of :func:`.receivers.mark_receiver`
        """
        camera = hits.camera
        empty_tiles(cells.farthest, first + wp.tid(), camera.width, camera.height)
        at = tile_pixel(first + wp.tid(), camera.width, camera.height)
        point = HitPoint()
        wanted = wp.bool(False)
        pixel = at[1] * camera.width + at[0]
        if at[0] >= 0:
            if wp.static(receivers == "marked"):
                set_entry(shadowed, light.index, pixel, wp.uint8(0))
            point = point_of(hits, pixel, at)
            if wp.static(receivers == "flagged"):
                wanted = entry(flags, light.index, pixel) != wp.uint8(0)
            if wp.static(receivers == "hits"):
                set_entry(shadowed, light.index, pixel, wp.uint8(0))
                wanted = point.triangle >= 0
            if wp.static(receivers == "marked"):
                wanted = mark_receiver(light, asks_facing, pixel, at, point, hits, flags, reached)
        place_ray(hits, point, wanted, pixel, at, aim_of(light), wp.static(keeps), cells)

    return map_kernel


@functools.cache
def make_place_kernel(receivers: str, cone: bool = False) -> wp.Kernel:
    """Places of rays, a thread for each pixel, and their cells, where what they cover is known. Sets where rows begin.

    receivers  which pixels have a ray: "hits": all with a hit; "facing": hits of triangles that are ``facing``; "marked":
               those that this kernel decides. Both of them are marked
    cone       whether the region may end before a ray (:mod:`.cone`). Such a ray gets no slot
    """
    registers = REGISTERS_OF_MARKING if receivers == "marked" else REGISTERS

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def place_kernel(
        first: wp.int32,
        light: Light,
        hits: PrimaryHits,
        facing: wp.array(dtype=wp.uint8),
        cells: RayCells,
        flags: wp.array2d(dtype=wp.uint8),
        reached: wp.array(dtype=wp.int32),
        shadowed: wp.array2d(dtype=wp.uint8),
        outside_rays: wp.array(dtype=wp.int32),
    ):
        """As :func:`make_map_kernel`'s.

        facing        uint8 [triangles] (:func:`.region.bounds_kernel`)
        outside_rays  int32 [1 + pixels]: the number of rays outside the region, and their pixels
        """
        camera = hits.camera
        set_row_edges(first + wp.tid(), camera, cells)
        at = tile_pixel(first + wp.tid(), camera.width, camera.height)
        if at[0] < 0:
            return
        pixel = at[1] * camera.width + at[0]
        set_entry(shadowed, light.index, pixel, wp.uint8(0))
        faces = wp.uint8(0)
        if wp.static(receivers == "facing"):
            # Before the point is computed: the byte is then on its way together with what that reads of the triangle.
            faces = facing_of(hits, pixel, facing)
        point = point_of(hits, pixel, at)
        wanted = point.triangle >= 0
        if wp.static(receivers == "facing"):
            wanted = faces != wp.uint8(0)
            set_entry(flags, light.index, pixel, wp.uint8(wanted))
            if wanted:
                note_receiver(reached)
        if wp.static(receivers == "marked"):
            wanted = mark_receiver(light, False, pixel, at, point, hits, flags, reached)
        if not wanted:
            return
        aim = aim_of(light)
        found = placed(point, True, aim)
        if found.place[2] >= 0.0:
            count_quickly(pixel, point.triangle, found, cells)
            return
        found = placed_exactly(hits, pixel, at, aim)
        if wp.static(cone):
            if not in_region(found.place, cells):
                set_entry(cells.slot, pixel, -1)
                set_entry(cells.triangle, pixel, point.triangle)
                set_entry(outside_rays, 1 + number_among(outside_rays, 0), pixel)
                return
        count_exactly(pixel, point.triangle, found, cells)

    return place_kernel
