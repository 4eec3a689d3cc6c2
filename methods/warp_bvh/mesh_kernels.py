"""Kernels around Warp's own mesh queries: closest hits, and shadow rays from starts that float32 may choose."""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Camera, Hits, Mesh, Rays, corners_of, mirrored_ray, ray_of
from ..common.pixels import pixel_of
from ..exact.triangle import write_miss
from ..rays.offset import SHADOW_END, stepped

END = wp.constant(SHADOW_END)

CUT = wp.constant(1.0e-6)
"""The share of the way to the light that ``origin = plain_cut`` leaves out."""


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=64)
def mesh_primary_kernel(tree: wp.uint64, names: wp.array(dtype=wp.int32), camera: Camera, mirrored: Rays, hits: Hits):
    """Closest hit of each pixel, as a query of the wp.Mesh ``tree`` finds it. ``names``: the triangle of each of its
    faces; empty where a face has its triangle's number.
    """
    pixel = pixel_of(wp.tid(), camera.width, camera.height)
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


@functools.cache
def make_mesh_shadow_kernel(origin: str) -> Any:
    """Whether the wp.Mesh ``tree`` finds anything between each hit and the light.

    origin  "exact": from ``starts``, moved off the hit's triangle by an error bound. They are found by a kernel of their
            own (:func:`..rays.offset.launch_shadow_origins`): float64 takes half as many registers again as the query, and
            would halve how many queries a GPU has in flight.
            The others are as a user of Warp writes them, float32 without a bound, so that some bits are wrong. "plain": from
            the point (u, v) of the triangle, moved along its normal as Waechter and Binder do (Ray Tracing Gems, ch. 6);
            "plain_cut": from the point at t of the ray, moved by :data:`CUT` of the way to the light
    """

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def mesh_shadow_kernel(
        light: wp.int32,
        tree: wp.uint64,
        camera: Camera,
        mesh: Mesh,
        lights: wp.array(dtype=wp.vec3f),
        mirrored: Rays,
        hits: Hits,
        starts: wp.array(dtype=wp.vec3f),
        receivers: wp.array2d(dtype=wp.uint8),
        shadowed: wp.array2d(dtype=wp.uint8),
    ):
        pixel = pixel_of(wp.tid(), camera.width, camera.height)
        if pixel < 0:
            return
        best = hits.triangle[pixel]
        if wp.static(effects.receivers):
            if receivers[light, pixel] == wp.uint8(0):
                best = wp.int32(-1)
        occluded = wp.bool(False)
        if best >= 0:
            target = lights[light]
            if wp.static(origin == "exact"):
                start = starts[pixel]
            elif wp.static(origin == "plain"):
                corners = corners_of(mesh, best)
                ab = corners.b - corners.a
                ac = corners.c - corners.a
                p = corners.a + hits.u[pixel] * ab + hits.v[pixel] * ac
                n = wp.normalize(wp.cross(ab, ac))
                if wp.dot(n, target - p) < 0.0:
                    n = -n
                start = stepped(p, n)
            else:
                ray = ray_of(camera, pixel)
                if wp.static(effects.bounced):
                    ray = mirrored_ray(mirrored, pixel)
                p = ray.origin + hits.t[pixel] * ray.direction
                start = p + CUT * (target - p)
            occluded = wp.mesh_query_ray_anyhit(tree, start, target - start, END)
        shadowed[light, pixel] = wp.uint8(occluded)

    return mesh_shadow_kernel
