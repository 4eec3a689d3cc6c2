"""Pairs of a triangle and a shadow ray that float64 decides: those that float32 left, and rays outside the region.

The exact hit points need not be stored: few are needed, and they are computed again.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Mesh
from ...common.reads import corners_at, ray_of_pixel, weld_at
from ...exact.hit_point import hit_point, plane_distance
from ...exact.holes import opaque_to_light
from ...exact.segment import occludes
from ...exact.triangle import largest, spare_bits
from ...gpu.entries import entry
from ..cube.lights import Light, position_of
from ..queues import Queue, held_undecided
from .closed import refuse, touches
from .planes import ShadowBits, set_shadowed

PAIRS_UNASKED = wp.constant(4)
"""Undecided pairs of a thread up to which it does not ask first whether the pixel is shadowed."""

REGISTERS = 96
"""Registers per thread: there are fewer threads than a GPU has room for."""


@functools.cache
def make_undecided_kernel(stored: bool, outside: bool) -> wp.Kernel:
    """The kernel. ``stored``: hit_points vec3d [pixels] are exact. ``outside``: there may be rays outside the region
    (:mod:`..rays.region`), which it tests against every triangle, too.
    """

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def undecided_kernel(
        threads: wp.int32,
        light: Light,
        camera: Camera,
        mesh: Mesh,
        alpha: Alpha,
        hit_points: wp.array(dtype=wp.vec3d),
        outside_rays: wp.array(dtype=wp.int32),
        bits: ShadowBits,
        queue: Queue,
    ):
        """outside_rays: int32 [1 + pixels]: how many rays lie outside the region, and their pixels; [0] without
        ``outside``.
        """
        pairs = held_undecided(queue, wp.tid())
        origin_size = wp.float64(largest(camera.eye[0]))
        place = position_of(light)
        # Whether the pixel is shadowed already: a thread with few pairs would wait for the answer, and what it reads of both
        # triangles is on its way at once without it. Where a light stands close to a surface, pairs are a hundred times as
        # many, and nearly all of their pixels are shadowed.
        asks = pairs > PAIRS_UNASKED * threads
        rounds = wp.int32(1)
        if wp.static(outside):
            rounds += entry(outside_rays, 0)
        for r in range(rounds):  # first the undecided pairs, then a round for each ray outside the region
            outside_ray = wp.int32(-1)
            stop = wp.int32(pairs)
            if wp.static(outside):
                if r > 0:
                    outside_ray = entry(outside_rays, r)
                    stop = mesh.triangles.shape[0]
            k = wp.int32(wp.tid())
            while k < stop:
                pair = wp.vec2i(k, outside_ray)
                if outside_ray < 0:
                    pair = entry(queue.undecided, k)
                k += threads
                i = pair[0]
                wanted = wp.bool(True)
                if outside_ray >= 0:
                    wanted = i != entry(bits.triangle, outside_ray) and entry(mesh.valid, i) != wp.uint8(0)
                elif asks:
                    wanted = entry(bits.shadowed, bits.light, pair[1]) == wp.uint8(0)
                if wanted:
                    corners = corners_at(mesh, i)
                    weld = weld_at(mesh, i)
                    h = wp.vec3d()
                    if wp.static(stored):
                        h = hit_points[pair[1]]
                    else:
                        ray = ray_of_pixel(camera, pair[1])
                        own = corners_at(mesh, entry(bits.triangle, pair[1]))
                        h = hit_point(ray, plane_distance(ray, own), own)
                    occluded = occludes(h, place, corners, weld, origin_size)
                    if wp.static(effects.closed):
                        if outside_ray < 0 and not occluded:
                            spare = spare_bits(mesh.triangles.shape[0])
                            if touches(entry(mesh.valid, i), h, camera.eye[0], place, corners, weld, spare):
                                refuse(mesh, i, queue.touched)
                    if wp.static(effects.alpha):
                        if occluded:
                            occluded = opaque_to_light(alpha, i, h, place, corners, weld, origin_size)
                    if occluded:
                        set_shadowed(bits, pair[1], i)

    return undecided_kernel
