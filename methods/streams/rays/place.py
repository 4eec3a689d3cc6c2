"""Places of a light's rays, one for each pixel; where what they cover is known, they are counted in their cells at once.

The receivers of a light are marked here, too: by the rule of :mod:`....harness.frame.effects.receivers`, with the same bits.
A cone is decided in float32, from the distance t, where a bound on the rounding allows. The triangle is read only in doubt,
and where eye and light must lie on one side of its plane and that is not known of each triangle
(:attr:`....harness.frame.frame.Frame.front_facing`). Where the region of the rays is known before them, what finds it
knows that, too (:mod:`.region`).
"""

import functools
from typing import Any

import warp as wp

from ....harness.frame.effects.receivers import note_receiver, receives
from ....harness.frame.geometry import Mesh, Ray
from ...common.pixels import tile_pixel, tile_threads
from ...common.reads import corners_at, ray_at
from ...exact.triangle import largest, spare_bits
from ...gpu.division import about_root
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import number_among
from ..camera.pixels import index_of
from ..cube.cells import RayCells
from ..cube.lights import Aim, Light, aim_of, position_of
from ..cube.rectangle import BINS, record_place
from ..cube.spacing import expect_ray
from .hit_points import HitPoint, PrimaryHits, placed, placed_exactly, point_of
from .sort import STORED_FACE, count_in_table

REGISTERS, REGISTERS_OF_MARKING = 40, 48
"""Registers per thread, for twelve blocks of 128 per multiprocessor; ten where the kernel decides which hits are
receivers. The few rays that take the exact path spill; with 32 the others would, too.
"""

ROUNDED = wp.constant(wp.float32(2.0**-19))
"""Bound on the error of a cone's margin in units of the sum of the coordinates that it is computed from: t is known to 2^-23
and float32 rounds to 2^-24, so a coordinate of the way from the light is off by less than 2^-22 of the sum, and the margin
by less than twice 2^-20 of it, the root's error included.
"""

LEAST_WAY, MOST_WAY = wp.constant(wp.float32(1.0e-15)), wp.constant(wp.float32(1.0e15))
"""Ways from a light whose squares float32 holds."""


@wp.func
def cone_margin(place: wp.vec3f, cone: wp.vec4f, ray: Ray, point: HitPoint) -> wp.float32:
    """Positive where a hit lies certainly in the cone (:func:`..cube.lights.cone_of`) of a light at ``place``, negative
    where it certainly does not; else 0, as where there is no cone.
    """
    v = (ray.origin + ray.direction * point.t) - place
    # In the cone: the part of v along its axis is at least cosine |v|.
    inside = wp.dot(wp.vec3f(cone[0], cone[1], cone[2]), v) - cone[3] * about_root(wp.dot(v, v))
    size = largest(v)
    bound = ROUNDED * ((point.way + largest(ray.origin)) + (largest(place) + size))
    margin = wp.float32(0.0)
    if size > LEAST_WAY and size < MOST_WAY and wp.abs(inside) > bound:
        margin = inside
    return margin


@wp.func
def is_receiver(light: Light, facing: wp.bool, ray: Ray, point: HitPoint, mesh: Mesh) -> wp.bool:
    """Whether the hit of a ray has a shadow ray to a light."""
    asked = facing
    wanted = wp.bool(True)
    unsure = wp.bool(True)
    if light.front_facing.shape[0] > 0:
        asked = wp.bool(False)
        wanted = entry(light.front_facing, light.index, point.triangle) != wp.uint8(0)
        unsure = wanted and light.spot[light.index, 0] != wp.float64(0.0)
    if unsure:
        margin = wp.float32(0.0)
        if not asked and not point.exact_path:
            margin = cone_margin(position_of(light), entry(light.cone, light.index), ray, point)
        wanted = margin > 0.0
        if margin == 0.0:
            corners = corners_at(mesh, point.triangle)
            wanted = receives(light.index, asked, ray, corners, light.position, light.spot)
    return wanted


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


@wp.func
def count_placed(
    hits: PrimaryHits,
    point: HitPoint,
    pixel: wp.int32,
    at: wp.vec2i,
    aim: Aim,
    cone: wp.bool,
    outside_rays: wp.array(dtype=wp.int32),
    cells: Any,
):
    """Count the ray of a pixel in its cell, where the region is known. One that lies outside that of a ``cone`` gets no
    slot: it is listed.
    """
    found = placed(point, True, aim)
    if found.place[2] >= 0.0:
        set_entry(cells.triangle, pixel, point.triangle)
        count_in_table(pixel, found.place, False, cells)
        return
    found = placed_exactly(hits, pixel, at, aim)
    if cone:
        if not in_region(found.place, cells):
            set_entry(cells.slot, pixel, -1)
            set_entry(cells.triangle, pixel, point.triangle)
            set_entry(outside_rays, 1 + number_among(outside_rays, 0), pixel)
            return
    store_point(pixel, point.triangle, found.h, cells)
    count_in_table(pixel, found.place, True, cells)


@functools.cache
def make_place_kernel(receivers: str, region: str, keeps: bool = False) -> wp.Kernel:
    """Places of rays, a thread for each pixel, and what they cover if their region is found by that; else their cells.

    receivers  which pixels have a ray: "hits": all with a hit; "flagged": those that the harness has marked; "facing": hits
               of triangles that are ``facing``; "marked": those that this kernel decides. The last two are marked
    region     "found", "known" or "cone" (:class:`.placing.ByRays`)      keeps  of :func:`place_ray`
    """
    registers = REGISTERS_OF_MARKING if receivers == "marked" else REGISTERS

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def place_kernel(
        first: wp.int32,
        asks_facing: wp.bool,
        light: Light,
        hits: PrimaryHits,
        facing: wp.array(dtype=wp.uint8),
        cells: RayCells,
        flags: wp.array2d(dtype=wp.uint8),
        reached: wp.array(dtype=wp.int32),
        shadowed: wp.array2d(dtype=wp.uint8),
        outside_rays: wp.array(dtype=wp.int32),
    ):
        """Clears the shadow bits, unless the receivers' pass of the harness has; empties ``farthest`` where the region is
        found. Nothing else is written for pixels without ray.

        first         of an image's threads, the first one here     asks_facing  whether receivers must face the light
        facing        uint8 [triangles] (:func:`.region.bounds_kernel`)
        flags         uint8 [lights, pixels]: receivers             reached      int32 [1]: set to 1 if there is one; or []
        outside_rays  int32 [1 + pixels]: the number of rays outside the region, and their pixels
        """
        camera = hits.camera
        if wp.static(region == "found"):
            tile = wp.int32(first + wp.tid())
            while tile < cells.farthest.shape[0]:
                cells.farthest[tile] = 0
                tile += tile_threads(camera.width, camera.height)
        at = tile_pixel(first + wp.tid(), camera.width, camera.height)
        if wp.static(region != "found"):  # else all threads of a block go on
            if at[0] < 0:
                return
        point = HitPoint()
        wanted = wp.bool(False)
        pixel = at[1] * camera.width + at[0]
        if at[0] >= 0:
            if wp.static(receivers != "flagged"):
                set_entry(shadowed, light.index, pixel, wp.uint8(0))
            faces = wp.uint8(0)
            if wp.static(receivers == "facing"):
                # Before the point is computed: the byte is then on its way together with what that reads of the triangle.
                faces = facing_of(hits, pixel, facing)
            point = point_of(hits, pixel, at)
            wanted = point.triangle >= 0
            if wp.static(receivers == "flagged"):
                wanted = entry(flags, light.index, pixel) != wp.uint8(0)
            if wp.static(receivers == "facing"):
                wanted = faces != wp.uint8(0)
            if wp.static(receivers == "marked"):
                if wanted:
                    asked = asks_facing and wp.static(region == "found")
                    wanted = is_receiver(light, asked, ray_at(camera, at[0], at[1]), point, hits.mesh)
            if wp.static(receivers in ("facing", "marked")):
                set_entry(flags, light.index, pixel, wp.uint8(wanted))
                if wanted:
                    note_receiver(reached)
        if wp.static(region == "found"):
            place_ray(hits, point, wanted, pixel, at, aim_of(light), wp.static(keeps), cells)
        else:
            if not wanted:
                return
            count_placed(hits, point, pixel, at, aim_of(light), wp.static(region == "cone"), outside_rays, cells)

    return place_kernel
