"""Rays that are decided in float64 during the traversal: all rays of a scene whose camera is orthographic.

Parallel rays have no origin in common. float32 rejects triangles and float64 decides, by the tests that all methods share.
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, Rays, mirrored_ray, ray_of, weld_of
from ...common.pixels import tile_pixel
from ...exact.hit_point import hit_point, plane_distance
from ...exact.holes import opaque_at_hit, opaque_to_light
from ...exact.segment import may_occlude, occludes
from ...exact.triangle import NO_HIT, U32, hit_distance, hit_weights, largest, may_hit, nearer, to_float32
from ...gpu.entries import entry
from ..native import INDEX, PAIR, STACK
from ..nodes import Tree, make_children_of
from ..records.planes import triangle_corners

MISSED = wp.constant(9.9e37)
FARTHEST = wp.constant(9.0e37)
SLACK = wp.constant(1.0 + 2.0**-20)
EMPTY_TREE = wp.constant(-1)
INDICES = wp.constant(INDEX)
PAIRED = wp.constant(PAIR)
DEEPEST = wp.constant(STACK)


@wp.func
def nearer_child(children: wp.vec4f) -> wp.int32:
    """0 or 1: the child that is met first; -1 where the ray meets neither."""
    if children[0] > MISSED and children[1] > MISSED:
        return -1
    if children[1] < children[0]:
        return 1
    return 0


@functools.cache
def make_closest_kernel(node_bytes: int) -> Any:
    """One thread per pixel, 8 x 4 per warp: the closest hit, and the origin of shadow rays."""
    children_of = make_children_of(node_bytes)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def closest_kernel(
        camera: Camera,
        tree: Tree,
        reach: wp.array(dtype=wp.float32),
        mesh: Mesh,
        alpha: Alpha,
        rays: Rays,
        hits: Hits,
        starts: wp.array(dtype=wp.vec3f),
    ):
        at = tile_pixel(wp.tid(), camera.width, camera.height)
        if at[0] < 0:
            return
        pixel = at[1] * camera.width + at[0]
        stack = wp.zeros(shape=DEEPEST, dtype=wp.int32)
        ray = ray_of(camera, pixel)
        now = entry(tree.root, 0)
        if wp.static(effects.bounced):
            ray = mirrored_ray(rays, pixel)
            if rays.active[pixel] == wp.uint8(0):
                now = EMPTY_TREE
        best = wp.int32(-1)
        best_t = wp.float64(wp.INF)
        limit = wp.float32(FARTHEST)
        held = wp.int32(0)
        while now != EMPTY_TREE:
            following = wp.int32(EMPTY_TREE)
            if now >= 0:
                children = children_of(tree.nodes, now, ray.origin, ray.direction, limit, reach)
                first = nearer_child(children)
                if first >= 0:
                    following = wp.cast(children[2 + first], wp.int32)
                    if children[0] < MISSED and children[1] < MISSED:
                        stack[held] = wp.cast(children[3 - first], wp.int32)
                        held += 1
            else:
                i = now & INDICES
                corners = triangle_corners(mesh, i)
                if may_hit(ray, corners):
                    distance = hit_distance(ray, corners, weld_of(mesh, i))
                    if wp.static(effects.alpha):
                        if distance > wp.float64(0.0):
                            if not opaque_at_hit(alpha, i, ray, corners, weld_of(mesh, i)):
                                distance = NO_HIT
                    if distance > wp.float64(0.0) and nearer(mesh, distance, i, best_t, best):
                        best = i
                        best_t = distance
                        limit = wp.min(wp.float32(distance) * SLACK, FARTHEST)
                if (now & PAIRED) != 0:
                    following = (now + 1) & ~PAIRED
            if following == EMPTY_TREE and held > 0:
                held -= 1
                following = stack[held]
            now = following
        hits.triangle[pixel] = best
        hits.t[pixel] = wp.float32(best_t)
        uv = wp.vec2f()
        if best >= 0:
            met = triangle_corners(mesh, best)
            uv = hit_weights(ray, met, weld_of(mesh, best))
            starts[pixel] = to_float32(hit_point(ray, best_t, met))
        hits.u[pixel] = uv[0]
        hits.v[pixel] = uv[1]

    return closest_kernel


@functools.cache
def make_shadow_kernel(node_bytes: int) -> Any:
    """One thread per pixel, 8 x 4 per warp: shadow bits, traversed from the hit points."""
    children_of = make_children_of(node_bytes)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def shadow_kernel(
        camera: Camera,
        light: wp.int32,
        lights: wp.array(dtype=wp.vec3f),
        tree: Tree,
        reach: wp.array(dtype=wp.float32),
        mesh: Mesh,
        alpha: Alpha,
        hits: Hits,
        receivers: wp.array2d(dtype=wp.uint8),
        rays: Rays,
        shadowed: wp.array2d(dtype=wp.uint8),
    ):
        at = tile_pixel(wp.tid(), camera.width, camera.height)
        if at[0] < 0:
            return
        pixel = at[1] * camera.width + at[0]
        target = entry(lights, light)
        stack = wp.zeros(shape=DEEPEST, dtype=wp.int32)
        own = entry(hits.triangle, pixel)
        now = entry(tree.root, 0)
        if own < 0:
            now = EMPTY_TREE
        if wp.static(effects.receivers):
            if receivers[light, pixel] == wp.uint8(0):
                now = EMPTY_TREE
        occluded = wp.bool(False)
        h = wp.vec3d()
        size = wp.float64(0.0)
        start = wp.vec3f()
        way = wp.vec3f()
        error = wp.float32(0.0)
        if now != EMPTY_TREE:
            ray = ray_of(camera, pixel)
            if wp.static(effects.bounced):
                ray = mirrored_ray(rays, pixel)
            met = triangle_corners(mesh, own)
            h = hit_point(ray, plane_distance(ray, met), met)
            size = wp.float64(largest(ray.origin))
            start = to_float32(h)
            way = target - start
            error = U32 * largest(start)
        held = wp.int32(0)
        while now != EMPTY_TREE:
            following = wp.int32(EMPTY_TREE)
            if now >= 0:
                children = children_of(tree.nodes, now, start, way, SLACK, reach)
                first = nearer_child(children)
                if first >= 0:
                    following = wp.cast(children[2 + first], wp.int32)
                    if children[0] < MISSED and children[1] < MISSED:
                        stack[held] = wp.cast(children[3 - first], wp.int32)
                        held += 1
            else:
                i = now & INDICES
                corners = triangle_corners(mesh, i)
                if i != own and may_occlude(start, target, corners, error):
                    occluded = occludes(h, target, corners, weld_of(mesh, i), size)
                    if wp.static(effects.alpha):
                        if occluded:
                            occluded = opaque_to_light(alpha, i, h, target, corners, weld_of(mesh, i), size)
                if (now & PAIRED) != 0 and not occluded:
                    following = (now + 1) & ~PAIRED
            if following == EMPTY_TREE and held > 0 and not occluded:
                held -= 1
                following = stack[held]
            now = following
        shadowed[light, pixel] = wp.where(occluded, wp.uint8(1), wp.uint8(0))

    return shadow_kernel
