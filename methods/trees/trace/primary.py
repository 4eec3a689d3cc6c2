"""Primary rays: the traversal; then, in float64, the pairs that it left, t, weights and the origin of shadow rays."""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray
from ...common.pixels import tile_pixel
from ...exact.certain_hit import certain_hit, is_far
from ...exact.hit_point import along, flat_hit_point, plane_distance
from ...exact.holes import opaque_at_hit
from ...exact.triangle import hit_distance, nearer, to_float32
from ...gpu.entries import entry, set_entry
from ..nodes import Tree
from ..records.planes import triangle_corners
from .walk_primary import make_walk

BLOCK = 128
"""Threads per block: :func:`pixel_at` and the stacks of packets depend on it."""

FLOAT64_REGISTERS = 56
"""Least limit of registers per thread where float64 computes t, weights and hit point after the walk."""


@wp.func
def weld_at(mesh: Mesh, triangle: wp.int32) -> wp.vec3i:
    """:func:`...harness.frame.geometry.weld_of`, read where it lies."""
    face = entry(mesh.triangles, triangle)
    return wp.vec3i(entry(mesh.weld, face[0]), entry(mesh.weld, face[1]), entry(mesh.weld, face[2]))


@wp.struct
class Part:
    """A share of the pixels: every ``shares``-th block of threads, from block ``share`` on."""

    share: wp.int32
    shares: wp.int32


@wp.func
def pixel_at(camera: Camera, part: Part, thread: wp.int32) -> wp.vec2i:
    """Column and row of a thread's pixel, 8 x 4 pixels per warp, or -1."""
    block = (thread >> 7) * part.shares + part.share
    return tile_pixel((block << 7) | (thread & 127), camera.width, camera.height)


@wp.func
def direction_at(camera: Camera, at: wp.vec2i) -> wp.vec3f:
    """The direction of a pixel; for a thread without a pixel, that of the first."""
    return entry(camera.column, wp.max(at[0], 0)) + entry(camera.row, wp.max(at[1], 0))


@wp.func
def found_of(walked: wp.vec4f) -> wp.vec4i:
    """What an exact walk gives: two doubtful triangles, the last entry of the others, the certain closest hit; -1: none."""
    return wp.vec4i(
        wp.cast(walked[0], wp.int32),
        wp.cast(walked[1], wp.int32),
        wp.cast(walked[2], wp.int32),
        wp.cast(walked[3], wp.int32),
    )


@functools.cache
def make_resolve(holes: bool) -> Any:
    """A function that stores the closest hit of a ray. ``holes``: doubtful hits count where the triangle is opaque."""

    @wp.func
    def resolve_hit(
        ray: Ray,
        found: wp.vec4i,
        pixel: wp.int32,
        mesh: Mesh,
        alpha: Alpha,
        doubts: wp.array(dtype=wp.vec2i),
        far: wp.bool,
        hits: Hits,
        start: wp.array(dtype=wp.vec3f),
    ) -> wp.int32:
        """Store the nearest of the certain hit and the doubtful ones (:func:`found_of`): t, weights and origin of shadow
        rays, in float64. Returns the hit triangle if that origin is still to be computed, because the ray is flat on it or
        starts ``far`` away, or -1."""
        i = found[0]
        following = found[1]
        last = found[2]
        best = found[3]
        if i >= 0 or last >= 0:
            nearest = wp.float64(wp.INF)
            if best >= 0:
                nearest = plane_distance(ray, triangle_corners(mesh, best))
            while i >= 0 or last >= 0:
                if i < 0:
                    doubt = entry(doubts, last)
                    last = doubt[1]
                    i = doubt[0]
                corners = triangle_corners(mesh, i)
                weld = weld_at(mesh, i)
                t = hit_distance(ray, corners, weld)
                wanted = t > wp.float64(0.0) and nearer(mesh, t, i, nearest, best)
                if wp.static(holes):
                    if wanted:
                        wanted = opaque_at_hit(alpha, i, ray, corners, weld)
                if wanted:
                    nearest = t
                    best = i
                i = following
                following = -1
        distance32 = wp.float32(wp.INF)
        uv = wp.vec2f()
        flat = wp.bool(False)
        if best >= 0:
            hit = certain_hit(ray, triangle_corners(mesh, best), weld_at(mesh, best))
            flat = hit.flat
            if far:
                flat = True
            distance32 = wp.float32(hit.t)
            uv = hit.uv
            set_entry(start, pixel, to_float32(along(ray, hit.t)))
        set_entry(hits.triangle, pixel, best)
        set_entry(hits.t, pixel, distance32)
        set_entry(hits.u, pixel, uv[0])
        set_entry(hits.v, pixel, uv[1])
        return wp.where(flat, best, -1)

    return resolve_hit


@functools.cache
def make_exact_kernel(packets: bool, node_bytes: int, registers: int) -> Any:
    """One thread per pixel, 8 x 4 per warp: the closest hit; then its t, weights and hit point in float64."""
    walk, walk_holes = (make_walk("exact", packets, node_bytes, holes) for holes in (False, True))
    resolve_hit, resolve_holes = make_resolve(False), make_resolve(True)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def exact_kernel(
        camera: Camera,
        part: Part,
        tree: Tree,
        records: wp.array(dtype=wp.vec4f),
        reach: wp.array(dtype=wp.float32),
        mesh: Mesh,
        alpha: Alpha,
        extent: wp.array(dtype=wp.float32),
        counts: wp.array(dtype=wp.int32),
        doubts: wp.array(dtype=wp.vec2i),
        hits: Hits,
        start: wp.array(dtype=wp.vec3f),
    ):
        at = pixel_at(camera, part, wp.tid())
        seen = at[0] >= 0
        pixel = at[1] * camera.width + at[0]
        eye = entry(camera.eye, 0)
        direction = direction_at(camera, at)
        if wp.static(effects.alpha):
            walked = walk_holes(
                seen, eye, direction, tree.nodes, tree.root, records, reach, tree.masked, counts, doubts
            )
        else:
            walked = walk(
                seen, eye, direction, tree.nodes, tree.root, records, reach, tree.masked, counts, doubts
            )
        if seen:
            ray = Ray(entry(camera.eye, 0), direction_at(camera, at))
            far = is_far(ray.origin, entry(extent, 0))
            if wp.static(effects.alpha):
                flat = resolve_holes(ray, found_of(walked), pixel, mesh, alpha, doubts, far, hits, start)
            else:
                flat = resolve_hit(ray, found_of(walked), pixel, mesh, alpha, doubts, far, hits, start)
            # Flat rays are few, and slow to compute. The corners are read again, so that no register holds them until here.
            if flat >= 0:
                again = triangle_corners(mesh, flat)
                again_seen = Ray(entry(camera.eye, 0), direction_at(camera, at))
                set_entry(
                    start,
                    pixel,
                    to_float32(flat_hit_point(again_seen, plane_distance(again_seen, again), again)),
                )

    return exact_kernel


@functools.cache
def make_float32_kernel(packets: bool, node_bytes: int, registers: int) -> Any:
    """One thread per pixel, 8 x 4 per warp: answers in float32, and the origins of shadow rays."""
    walk = make_walk("float32", packets, node_bytes)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def float32_kernel(
        camera: Camera,
        part: Part,
        tree: Tree,
        records: wp.array(dtype=wp.vec4f),
        reach: wp.array(dtype=wp.float32),
        counts: wp.array(dtype=wp.int32),
        doubts: wp.array(dtype=wp.vec2i),
        hits: Hits,
        start: wp.array(dtype=wp.vec3f),
    ):
        at = pixel_at(camera, part, wp.tid())
        seen = at[0] >= 0
        pixel = at[1] * camera.width + at[0]
        found = walk(
            seen, entry(camera.eye, 0), direction_at(camera, at), tree.nodes, tree.root, records, reach,
            tree.masked, counts, doubts,
        )  # fmt: skip
        if seen:
            best = wp.cast(found[3], wp.int32)
            distance = wp.float32(wp.INF)
            if best >= 0:
                distance = found[0]
                set_entry(start, pixel, entry(camera.eye, 0) + direction_at(camera, at) * distance)
            set_entry(hits.triangle, pixel, best)
            set_entry(hits.t, pixel, distance)
            set_entry(hits.u, pixel, found[1])
            set_entry(hits.v, pixel, found[2])

    return float32_kernel
