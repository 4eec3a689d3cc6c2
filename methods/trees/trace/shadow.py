"""Shadow rays of one light: the traversal; then, in the same kernel in float64, the triangles that it left."""

import functools
from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.receivers import hit_receives
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Hits, Mesh, Ray, Rays, ray_of
from ...common.reads import corners_at, weld_at
from ...exact.hit_point import hit_point, plane_distance
from ...exact.holes import opaque_to_light
from ...exact.segment import occludes
from ...exact.triangle import largest
from ...gpu.entries import entry, set_entry
from ..constants import REGISTERS
from ..nodes import Tree
from ..records.planes import LightPlanes
from .closest import Listed, pixel_at, ray_at
from .traversal import make_any, make_count_any
from .undecided import Undecided


@wp.func
def hidden(
    found: wp.vec4i, ray: Ray, own: wp.int32, light: wp.vec3f, mesh: Mesh, alpha: Alpha, undecided: Undecided
) -> wp.uint8:
    """The shadow bit of an exact ray: that of a traversal that gave ``found`` (:func:`.traversal.make_any`), or float64's
    verdict on what it left, for which the hit point of ``ray`` on the triangle ``own`` is computed again."""
    i = found[0]
    following = found[1]
    last = found[2]
    bit = wp.uint8(found[3])
    if bit == wp.uint8(0) and (i >= 0 or last >= 0):
        met = corners_at(mesh, own)
        h = hit_point(ray, plane_distance(ray, met), met)
        size = wp.float64(largest(ray.origin))
        while bit == wp.uint8(0) and (i >= 0 or last >= 0):
            if i < 0:
                pair = entry(undecided.pairs, last)
                last = pair[1]
                i = pair[0]
            corners = corners_at(mesh, i)
            weld = weld_at(mesh, i)
            occluded = occludes(h, light, corners, weld, size)
            if wp.static(effects.alpha):
                if occluded:
                    occluded = opaque_to_light(alpha, i, h, light, corners, weld, size)
            if occluded:
                bit = wp.uint8(1)
            i = following
            following = -1
    return bit


@functools.cache
def make_shadow(exact: bool, marks: bool, levels: int = 1) -> Any:
    """A function of a pixel and the triangle that it ``hit``, or -1, that writes its shadow bit.

    ``starts``: the hit points, rounded; nothing at a miss. ``marks``: if only some hits receive the light, they are marked,
    too; else they are marked already. ``faces``: only those that face it do.
    """
    between, between_holes = (make_any(exact, holes, levels) for holes in (False, True))

    @wp.func(module="unique")
    def trace_shadow(
        pixel: wp.int32,
        hit: wp.int32,
        camera: Camera,
        light: wp.int32,
        faces: wp.bool,
        lights: wp.array(dtype=wp.vec3f),
        spots: wp.array2d(dtype=wp.float64),
        front_facing: wp.array2d(dtype=wp.uint8),
        tree: Tree,
        planes: LightPlanes,
        mesh: Mesh,
        alpha: Alpha,
        rays: Rays,
        starts: wp.array(dtype=wp.vec3f),
        undecided: Undecided,
        receivers: wp.array2d(dtype=wp.uint8),
        shadowed: wp.array2d(dtype=wp.uint8),
    ):
        wanted = hit >= 0
        if wp.static(effects.receivers):
            if wp.static(marks):
                if wanted:
                    seen = ray_of(camera, pixel)
                    wanted = hit_receives(light, faces, seen, hit, mesh, lights, spots, front_facing)
                set_entry(receivers, light, pixel, wp.uint8(wanted))
            else:
                wanted = wanted and entry(receivers, light, pixel) != wp.uint8(0)
        found = wp.vec4i(-1, -1, -1, 0)
        place = entry(lights, light)
        if wanted:
            start = entry(starts, pixel)
            if wp.static(effects.alpha):
                found = between_holes(start, place, hit, tree, planes, undecided)
            else:
                found = between(start, place, hit, tree, planes, undecided)
        if wp.static(exact):
            ray = ray_of(camera, pixel)
            if wp.static(effects.bounced):
                ray = ray_at(rays, pixel)
            bit = hidden(found, ray, hit, place, mesh, alpha, undecided)
        else:
            bit = wp.uint8(found[3])
        set_entry(shadowed, light, pixel, bit)

    return trace_shadow


@functools.cache
def make_shadow_kernel(exact: bool, marks: bool, levels: int = 1) -> Any:
    """One thread per pixel, 8 x 4 per warp, or per listed pixel: :func:`make_shadow`. The bits of pixels that are not listed
    stay."""
    trace_shadow = make_shadow(exact, marks, levels)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def shadow_kernel(
        camera: Camera,
        tiles: wp.array(dtype=wp.int32),
        listed: Listed,
        light: wp.int32,
        faces: wp.bool,
        lights: wp.array(dtype=wp.vec3f),
        spots: wp.array2d(dtype=wp.float64),
        front_facing: wp.array2d(dtype=wp.uint8),
        tree: Tree,
        planes: LightPlanes,
        mesh: Mesh,
        alpha: Alpha,
        rays: Rays,
        hits: Hits,
        starts: wp.array(dtype=wp.vec3f),
        undecided: Undecided,
        receivers: wp.array2d(dtype=wp.uint8),
        shadowed: wp.array2d(dtype=wp.uint8),
    ):
        k = wp.tid()
        if wp.static(effects.bounced):
            if k >= entry(listed.count, 0):
                return
            pixel = entry(listed.pixels, k)
        else:
            at = pixel_at(camera, tiles, k)
            if at[0] < 0:
                return
            pixel = at[1] * camera.width + at[0]
        trace_shadow(
            pixel, entry(hits.triangle, pixel), camera, light, faces, lights, spots, front_facing, tree, planes, mesh,
            alpha, rays, starts, undecided, receivers, shadowed,
        )  # fmt: skip

    return shadow_kernel


@functools.cache
def make_shadow_tests_kernel(exact: bool, levels: int = 1) -> Any:
    """One thread per pixel: how many triangles the shadow ray of its primary hit is tested against, added to its others."""
    count, count_holes = (make_count_any(exact, holes, levels) for holes in (False, True))

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def shadow_tests_kernel(
        light: wp.int32,
        lights: wp.array(dtype=wp.vec3f),
        tree: Tree,
        planes: LightPlanes,
        hits: Hits,
        starts: wp.array(dtype=wp.vec3f),
        receivers: wp.array2d(dtype=wp.uint8),
        tests: wp.array(dtype=wp.int32),
    ):
        pixel = wp.tid()
        hit = entry(hits.triangle, pixel)
        wanted = hit >= 0
        if wp.static(effects.receivers):
            wanted = wanted and entry(receivers, light, pixel) != wp.uint8(0)
        if wanted:
            place = entry(lights, light)
            start = entry(starts, pixel)
            if wp.static(effects.alpha):
                tests[pixel] += count_holes(start, place, hit, tree, planes)[0]
            else:
                tests[pixel] += count(start, place, hit, tree, planes)[0]

    return shadow_tests_kernel
