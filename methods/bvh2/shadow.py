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
from .records import Leaves, triangle_corners
from .walk_shadow import make_shadow_walk


@wp.struct
class Starts:
    """Where shadow rays start.

    seat   int32 [pixels]: the place of the hit triangle in the tree's order; or [triangles]: the place of each triangle
    point  vec3f [pixels]: the hit point, rounded; undefined at a miss
    """

    seat: wp.array(dtype=wp.int32)
    point: wp.array(dtype=wp.vec3f)


@functools.cache
def make_shadow_kernel(
    precision: str, node_bytes: int, registers: int, by_triangle: bool = False, group: int = 1
) -> Any:
    """One thread per pixel, 8 x 4 per warp: the shadow bit as far as float32 decides it, and doubts.

    ``by_triangle``: the places of ``starts`` are those of all triangles, not of the pixels' hits.
    """
    walk = make_shadow_walk(precision, node_bytes, group)

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
        starts: Starts,
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
            own = pixel
            if wp.static(by_triangle):
                own = hit
            bit = walk(
                entry(starts.point, pixel), entry(lights, light), entry(starts.seat, own), pixel, reach, extent,
                tree.nodes, tree.root, records, sides, counts, doubts,
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
    leaves: Leaves,
    hits: Hits,
    rays: Rays,
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
    visibility: wp.array2d(dtype=wp.uint8),
):
    """(place, pixel) pairs that float32 did not decide. The hit point is computed again, in float64."""
    k = wp.tid()
    stop = wp.min(entry(counts, 0), doubts.shape[0])
    while k < stop:
        pair = entry(doubts, k)
        k += threads
        pixel = pair[1]
        i = entry(leaves.order, pair[0])
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
