"""Shadow rays of one light: the traversal; then, in the same kernel in float64, the pairs that it left."""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.receivers import hit_receives
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray, ray_of, weld_of
from ...exact.hit_point import hit_point, plane_distance
from ...exact.holes import opaque_to_light
from ...exact.segment import occludes
from ...exact.triangle import largest
from ...gpu.entries import entry, set_entry
from ..nodes import Tree
from ..records.planes import triangle_corners
from .primary import Part, pixel_at
from .walk_shadow import HIDING, NOTHING, make_shadow_walk

HIDDEN = wp.constant(HIDING)


@functools.cache
def make_hidden(holes: bool) -> Any:
    """A function that gives the shadow bit of an exact walk. ``holes``: doubtful triangles hide where they are opaque."""

    @wp.func
    def hidden(
        found: wp.vec3i,
        ray: Ray,
        own: wp.int32,
        light: wp.vec3f,
        mesh: Mesh,
        alpha: Alpha,
        doubts: wp.array(dtype=wp.vec2i),
    ) -> wp.uint8:
        """The shadow bit of an exact walk that gave ``found``: its own, or float64's verdict on what it left, for which the
        hit point of ``ray`` on the triangle ``own`` is computed again."""
        if found[0] == HIDDEN:
            return wp.uint8(1)
        bit = wp.uint8(0)
        last = found[0]
        i = found[1]
        following = found[2]
        if i >= 0 or last >= 0:
            met = triangle_corners(mesh, own)
            h = hit_point(ray, plane_distance(ray, met), met)
            size = wp.float64(largest(ray.origin))
            while bit == wp.uint8(0) and (i >= 0 or last >= 0):
                if i < 0:
                    doubt = entry(doubts, last)
                    last = doubt[1]
                    i = doubt[0]
                corners = triangle_corners(mesh, i)
                weld = weld_of(mesh, i)
                occluded = occludes(h, light, corners, weld, size)
                if wp.static(holes):
                    if occluded:
                        occluded = opaque_to_light(alpha, i, h, light, corners, weld, size)
                if occluded:
                    bit = wp.uint8(1)
                i = following
                following = -1
        return bit

    return hidden


@functools.cache
def make_shadow_kernel(precision: str, node_bytes: int, registers: int, marks: bool) -> Any:
    """One thread per pixel, 8 x 4 per warp: the shadow bit.

    ``starts``: the hit points, rounded; nothing at a miss. ``marks``: if only some hits receive the light, the kernel marks
    them, too; else they are marked already. ``faces``: only those that face it do.
    """
    walk, walk_holes = (make_shadow_walk(precision, node_bytes, holes) for holes in (False, True))
    hidden, hidden_by_opaque = make_hidden(False), make_hidden(True)
    exact = precision == "exact"
    nothing = wp.constant(wp.vec3i(*NOTHING) if exact else wp.int32(0))

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=registers)
    def shadow_kernel(
        camera: Camera,
        part: Part,
        light: wp.int32,
        faces: wp.bool,
        lights: wp.array(dtype=wp.vec3f),
        spots: wp.array2d(dtype=wp.float64),
        front_facing: wp.array2d(dtype=wp.uint8),
        tree: Tree,
        records: wp.array(dtype=wp.vec4f),
        sides: wp.array(dtype=wp.vec4f),
        facing: wp.array(dtype=wp.uint8),
        reach: wp.array(dtype=wp.float32),
        extent: wp.array(dtype=wp.float32),
        mesh: Mesh,
        alpha: Alpha,
        hits: Hits,
        starts: wp.array(dtype=wp.vec3f),
        receivers: wp.array2d(dtype=wp.uint8),
        counts: wp.array(dtype=wp.int32),
        doubts: wp.array(dtype=wp.vec2i),
        shadowed: wp.array2d(dtype=wp.uint8),
    ):
        at = pixel_at(camera, part, wp.tid())
        if at[0] < 0:
            return
        pixel = at[1] * camera.width + at[0]
        hit = entry(hits.triangle, pixel)
        wanted = hit >= 0
        if wp.static(effects.receivers):
            if wp.static(marks):
                if wanted:
                    ray = ray_of(camera, pixel)
                    wanted = hit_receives(light, faces, ray, hit, mesh, lights, spots, front_facing)
                set_entry(receivers, light, pixel, wp.uint8(wanted))
            else:
                wanted = wanted and receivers[light, pixel] != wp.uint8(0)
        found = nothing
        place = entry(lights, light)
        if wanted:
            start = entry(starts, pixel)
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
            ray = ray_of(camera, pixel)
            if wp.static(effects.alpha):
                shadowed[light, pixel] = hidden_by_opaque(found, ray, hit, place, mesh, alpha, doubts)
            else:
                shadowed[light, pixel] = hidden(found, ray, hit, place, mesh, alpha, doubts)
        else:
            shadowed[light, pixel] = wp.uint8(found)

    return shadow_kernel
