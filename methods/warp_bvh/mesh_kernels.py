"""Kernels around Warp's own mesh queries: closest hits, and shadow rays from a start that an error bound gives."""

from __future__ import annotations

import warp as wp

from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Camera, Hits, Rays, mirrored_ray, ray_of
from ..common.pixels import pixel_of
from ..exact.triangle import write_miss


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=64)
def mesh_primary_kernel(
    blocks: wp.bool,
    tree: wp.uint64,
    names: wp.array(dtype=wp.int32),
    camera: Camera,
    mirrored: Rays,
    hits: Hits,
):
    """Closest hit of each pixel, as a query of the wp.Mesh ``tree`` finds it. ``names``: the triangle of each of its
    faces; empty where a face has its triangle's number.
    """
    pixel = pixel_of(wp.tid(), camera.width, camera.height, blocks)
    if pixel < 0:
        return
    ray = ray_of(camera, pixel)
    if wp.static(effects.bounced):
        if mirrored.active[pixel] == wp.uint8(0):
            write_miss(hits, pixel)
            return
        ray = mirrored_ray(mirrored, pixel)
    found = wp.mesh_query_ray(tree, ray.origin, ray.direction, wp.INF)
    if found.result:
        triangle = found.face
        if names.shape[0] > 0:
            triangle = names[triangle]
        hits.triangle[pixel] = triangle
        hits.t[pixel] = found.t
        # Warp's (u, v) are the weights of vertices 0 and 1; ours those of 1 and 2.
        hits.u[pixel] = found.v
        hits.v[pixel] = 1.0 - found.u - found.v
    else:
        write_miss(hits, pixel)


@wp.kernel(enable_backward=False, grid_stride=False)
def mesh_shadow_kernel(
    blocks: wp.bool,
    light: wp.int32,
    end: wp.float32,
    tree: wp.uint64,
    camera: Camera,
    lights: wp.array(dtype=wp.vec3f),
    hits: Hits,
    origins: wp.array(dtype=wp.vec3f),
    receivers: wp.array2d(dtype=wp.uint8),
    shadowed: wp.array2d(dtype=wp.uint8),
):
    """Whether the wp.Mesh ``tree`` finds anything between each hit, moved off its triangle, and ``end`` of the way.

    ``origins`` are found by a kernel of their own (:func:`..common.offset.launch_shadow_origins`): float64 takes half as
    many registers again as the query, and would halve how many queries a GPU has in flight.
    """
    pixel = pixel_of(wp.tid(), camera.width, camera.height, blocks)
    if pixel < 0:
        return
    if wp.static(effects.receivers):
        if receivers[light, pixel] == wp.uint8(0):
            shadowed[light, pixel] = wp.uint8(0)
            return
    occluded = wp.bool(False)
    if hits.triangle[pixel] >= 0:
        origin = origins[pixel]
        occluded = wp.mesh_query_ray_anyhit(tree, origin, lights[light] - origin, end)
    shadowed[light, pixel] = wp.uint8(occluded)
