"""Mirrored rays: a list of the pixels that have one; the traversal of each; then, in float64, the pairs that it left, t,
weights and the origin of shadow rays; and those, of the same list.

After the first bounce few pixels have a ray, spread over the image. In the list they stand side by side, so that the warps
that trace them are full.
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray, Rays
from ...exact.hit_point import flat_hit_point, plane_distance
from ...exact.triangle import to_float32
from ...gpu.entries import entry, set_entry
from ...gpu.reserve import reserve
from ..nodes import Tree
from ..records.planes import triangle_corners
from .primary import Part, found_of, make_resolve, pixel_at
from .shadow import make_hidden
from .walk_ray import make_ray_walk
from .walk_shadow import make_shadow_walk

RESOLVE_REGISTERS = 96

resolve_hit, resolve_holes = make_resolve(False), make_resolve(True)


@wp.kernel(enable_backward=False, grid_stride=False)
def list_kernel(
    camera: Camera,
    part: Part,
    rays: Rays,
    hits: Hits,
    count: wp.array(dtype=wp.int32),
    listed: wp.array(dtype=wp.int32),
):
    """One thread per pixel, 8 x 4 per warp: the pixels that have a ray; all others miss."""
    at = pixel_at(camera, part, wp.tid())
    if at[0] < 0:
        return
    pixel = at[1] * camera.width + at[0]
    if entry(rays.active, pixel) != wp.uint8(0):
        set_entry(listed, reserve(count, 0, 1), pixel)
    else:
        set_entry(hits.triangle, pixel, -1)
        set_entry(hits.t, pixel, wp.float32(wp.INF))
        set_entry(hits.u, pixel, 0.0)
        set_entry(hits.v, pixel, 0.0)


@functools.cache
def make_exact_kernel(node_bytes: int, registers: int) -> Any:
    """One thread per listed pixel: the certain closest hit (-1: none), and its chain of doubts."""
    walk, walk_holes = (make_ray_walk("exact", node_bytes, holes) for holes in (False, True))

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def exact_kernel(
        count: wp.array(dtype=wp.int32),
        listed: wp.array(dtype=wp.int32),
        rays: Rays,
        tree: Tree,
        records: wp.array(dtype=wp.vec4f),
        reach: wp.array(dtype=wp.float32),
        counts: wp.array(dtype=wp.int32),
        doubts: wp.array(dtype=wp.vec2i),
        found: wp.array(dtype=wp.vec4i),
    ):
        k = wp.tid()
        if k >= entry(count, 0):
            return
        pixel = entry(listed, k)
        origin = entry(rays.origin, pixel)
        direction = entry(rays.direction, pixel)
        if wp.static(effects.alpha):
            walked = walk_holes(
                origin, direction, tree.nodes, tree.root, records, reach, tree.masked, counts, doubts
            )
        else:
            walked = walk(
                origin, direction, tree.nodes, tree.root, records, reach, tree.masked, counts, doubts
            )
        set_entry(found, k, found_of(walked))

    return exact_kernel


@functools.cache
def make_float32_kernel(node_bytes: int, registers: int) -> Any:
    """One thread per listed pixel: answers in float32, and the origins of shadow rays."""
    walk = make_ray_walk("float32", node_bytes)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def float32_kernel(
        count: wp.array(dtype=wp.int32),
        listed: wp.array(dtype=wp.int32),
        rays: Rays,
        tree: Tree,
        records: wp.array(dtype=wp.vec4f),
        reach: wp.array(dtype=wp.float32),
        counts: wp.array(dtype=wp.int32),
        doubts: wp.array(dtype=wp.vec2i),
        hits: Hits,
        start: wp.array(dtype=wp.vec3f),
    ):
        k = wp.tid()
        if k >= entry(count, 0):
            return
        pixel = entry(listed, k)
        found = walk(
            entry(rays.origin, pixel), entry(rays.direction, pixel), tree.nodes, tree.root, records, reach,
            tree.masked, counts, doubts,
        )  # fmt: skip
        best = wp.cast(found[3], wp.int32)
        distance = wp.float32(wp.INF)
        if best >= 0:
            distance = found[0]
            set_entry(start, pixel, entry(rays.origin, pixel) + entry(rays.direction, pixel) * distance)
        set_entry(hits.triangle, pixel, best)
        set_entry(hits.t, pixel, distance)
        set_entry(hits.u, pixel, found[1])
        set_entry(hits.v, pixel, found[2])

    return float32_kernel


@wp.kernel(enable_backward=False, grid_stride=False, cuda_max_registers=RESOLVE_REGISTERS)
def resolve_kernel(
    count: wp.array(dtype=wp.int32),
    listed: wp.array(dtype=wp.int32),
    rays: Rays,
    mesh: Mesh,
    alpha: Alpha,
    doubts: wp.array(dtype=wp.vec2i),
    found: wp.array(dtype=wp.vec4i),
    hits: Hits,
    start: wp.array(dtype=wp.vec3f),
):
    """The nearest of the certain hit and the doubtful ones; its t, weights and hit point in float64."""
    k = wp.tid()
    if k >= entry(count, 0):
        return
    pixel = entry(listed, k)
    ray = Ray(entry(rays.origin, pixel), entry(rays.direction, pixel))
    # Mirrored rays start in the scene, never far from it.
    if wp.static(effects.alpha):
        flat = resolve_holes(ray, entry(found, k), pixel, mesh, alpha, doubts, False, hits, start)
    else:
        flat = resolve_hit(ray, entry(found, k), pixel, mesh, alpha, doubts, False, hits, start)
    if flat >= 0:
        again = triangle_corners(mesh, flat)
        set_entry(start, pixel, to_float32(flat_hit_point(ray, plane_distance(ray, again), again)))


@functools.cache
def make_shadow_kernel(precision: str, node_bytes: int, registers: int) -> Any:
    """One thread per listed pixel: the shadow bit of its hit. Bits of other pixels stay."""
    walk, walk_holes = (make_shadow_walk(precision, node_bytes, holes) for holes in (False, True))
    hidden, hidden_by_opaque = make_hidden(False), make_hidden(True)
    exact = precision == "exact"

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def shadow_kernel(
        count: wp.array(dtype=wp.int32),
        listed: wp.array(dtype=wp.int32),
        light: wp.int32,
        lights: wp.array(dtype=wp.vec3f),
        tree: Tree,
        records: wp.array(dtype=wp.vec4f),
        sides: wp.array(dtype=wp.vec4f),
        facing: wp.array(dtype=wp.uint8),
        reach: wp.array(dtype=wp.float32),
        extent: wp.array(dtype=wp.float32),
        mesh: Mesh,
        alpha: Alpha,
        rays: Rays,
        hits: Hits,
        starts: wp.array(dtype=wp.vec3f),
        receivers: wp.array2d(dtype=wp.uint8),
        counts: wp.array(dtype=wp.int32),
        doubts: wp.array(dtype=wp.vec2i),
        shadowed: wp.array2d(dtype=wp.uint8),
    ):
        k = wp.tid()
        if k >= entry(count, 0):
            return
        pixel = entry(listed, k)
        hit = entry(hits.triangle, pixel)
        wanted = hit >= 0
        if wp.static(effects.receivers):
            wanted = wanted and receivers[light, pixel] != wp.uint8(0)
        if wanted:
            start = entry(starts, pixel)
            place = entry(lights, light)
            if wp.static(effects.alpha):
                found = walk_holes(
                    start, place, hit, reach, extent, tree.nodes, tree.root, records, sides, facing, tree.masked,
                    counts, doubts,
                )  # fmt: skip
            else:
                found = walk(
                    start, place, hit, reach, extent, tree.nodes, tree.root, records, sides, facing, tree.masked,
                    counts, doubts,
                )  # fmt: skip
            if wp.static(exact):
                ray = Ray(entry(rays.origin, pixel), entry(rays.direction, pixel))
                if wp.static(effects.alpha):
                    shadowed[light, pixel] = hidden_by_opaque(found, ray, hit, place, mesh, alpha, doubts)
                else:
                    shadowed[light, pixel] = hidden(found, ray, hit, place, mesh, alpha, doubts)
            else:
                shadowed[light, pixel] = wp.uint8(found)

    return shadow_kernel
