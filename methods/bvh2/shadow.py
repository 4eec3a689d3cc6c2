"""Shadow rays of one light: the traversal; then, in float64, the pairs that it left."""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ...harness.frame.geometry import Camera, Hits, Mesh, Rays, mirrored_ray, ray_of, weld_of
from ...harness.frame.specialise import effects
from ..common.entries import entry
from ..common.hitpoint import hit_point, plane_distance
from ..common.segment import occludes
from ..common.triangle import largest
from .primary import Part, Tree, pixel_at
from .records import triangle_corners
from .walk_shadow import make_shadow_walk


@functools.cache
def make_shadow_kernel(precision: str, node_bytes: int, registers: int) -> Any:
    """One thread per pixel, 8 x 4 per warp: the shadow bit as far as float32 decides it, and doubts.

    ``starts``: the hit points, rounded; nothing at a miss.
    """
    walk = make_shadow_walk(precision, node_bytes)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def shadow_kernel(
        camera: Camera,
        part: Part,
        light: wp.int32,
        lights: wp.array(dtype=wp.vec3f),
        tree: Tree,
        records: wp.array(dtype=wp.vec4f),
        sides: wp.array(dtype=wp.vec4f),
        reach: wp.array(dtype=wp.float32),
        extent: wp.array(dtype=wp.float32),
        hits: Hits,
        starts: wp.array(dtype=wp.vec3f),
        receivers: wp.array2d(dtype=wp.uint8),
        counts: wp.array(dtype=wp.int32),
        doubts: wp.array(dtype=wp.vec2i),
        visibility: wp.array2d(dtype=wp.uint8),
    ):
        at = pixel_at(camera, part, wp.tid())
        if at[0] < 0:
            return
        pixel = at[1] * camera.width + at[0]
        hit = entry(hits.triangle, pixel)
        wanted = hit >= 0
        if wp.static(effects.receivers):
            wanted = wanted and receivers[light, pixel] != wp.uint8(0)
        bit = wp.int32(0)
        if wanted:
            bit = walk(
                entry(starts, pixel), entry(lights, light), hit, pixel, reach, extent, tree.nodes, tree.root, records,
                sides, counts, doubts,
            )  # fmt: skip
        visibility[light, pixel] = wp.uint8(bit)

    return shadow_kernel


@wp.kernel(enable_backward=False, grid_stride=False)
def shadow_doubt_kernel(
    threads: wp.int32,
    camera: Camera,
    light: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    mesh: Mesh,
    hits: Hits,
    rays: Rays,
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
    visibility: wp.array2d(dtype=wp.uint8),
):
    """(triangle, pixel) pairs that float32 did not decide. The hit point is computed again, in float64."""
    k = wp.tid()
    stop = wp.min(entry(counts, 0), doubts.shape[0])
    while k < stop:
        pair = entry(doubts, k)
        k += threads
        pixel = pair[1]
        i = pair[0]
        own = entry(hits.triangle, pixel)
        if i != own and visibility[light, pixel] == wp.uint8(0):
            ray = ray_of(camera, pixel)
            if wp.static(effects.bounced):
                ray = mirrored_ray(rays, pixel)
            corners = triangle_corners(mesh, own)
            h = hit_point(ray, plane_distance(ray, corners), corners)
            size = wp.float64(largest(ray.origin))
            if occludes(h, entry(lights, light), triangle_corners(mesh, i), weld_of(mesh, i), size):
                visibility[light, pixel] = wp.uint8(1)
