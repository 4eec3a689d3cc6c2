"""Shadow rays of one light: the traversal; then, in the same kernel in float64, the triangles that it left."""

import functools
from typing import Any

import warp as wp

from ....harness.frame.effects.receivers import hit_receives
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Ray, ray_of
from ...common.reads import corners_at, weld_at
from ...exact.hit_point import hit_point, plane_distance
from ...exact.holes import opaque_to_light
from ...exact.segment import occludes
from ...exact.triangle import largest
from ...gpu.entries import entry, set_entry
from ..constants import EYE_REGISTERS, REGISTERS
from ..records.planes import LightPlanes
from .closest import Share, make_eye, pixel_at, ray_at
from .traversal import has_holes, make_any
from .undecided import Undecided


@wp.struct
class Lit:
    """What shadow rays to the light of index ``light`` take besides their :class:`.closest.Share`. ``faces``: only hits that
    face the light receive it.
    """

    light: wp.int32
    faces: wp.bool
    lights: wp.array[wp.vec3f]
    spots: wp.array2d[wp.float64]
    front_facing: wp.array2d[wp.uint8]
    planes: LightPlanes
    receivers: wp.array2d[wp.uint8]
    shadowed: wp.array2d[wp.uint8]


@wp.func
def hidden(found: wp.vec4i, ray: Ray, own: wp.int32, light: wp.vec3f, share: Share, undecided: Undecided) -> wp.uint8:
    """The shadow bit of an exact ray: that of a traversal that gave ``found`` (:func:`.traversal.make_any`), or float64's
    verdict on what it left, for which the hit point of ``ray`` on the triangle ``own`` is computed again.
    """
    i = found[0]
    following = found[1]
    last = found[2]
    bit = wp.uint8(found[3])
    if bit == wp.uint8(0) and (i >= 0 or last >= 0):
        met = corners_at(share.mesh, own)
        h = hit_point(ray, plane_distance(ray, met), met)
        size = wp.float64(largest(ray.origin))
        while bit == wp.uint8(0) and (i >= 0 or last >= 0):
            if i < 0:
                pair = entry(undecided.pairs, last)
                last = pair[1]
                i = pair[0]
            corners = corners_at(share.mesh, i)
            weld = weld_at(share.mesh, i)
            occluded = occludes(h, light, corners, weld, size)
            if wp.static(effects.alpha):
                if occluded:
                    occluded = opaque_to_light(share.alpha, i, h, light, corners, weld, size)
            if occluded:
                bit = wp.uint8(1)
            i = following
            following = -1
    return bit


@functools.cache
def make_shadow(exact: bool, marks: bool, levels: int = 1) -> Any:
    """A function of a pixel and the triangle that it ``hit``, or -1, that writes its shadow bit.

    ``marks``: if only some hits receive the light, they are marked, too; else they are marked already.
    """
    between = make_any(exact, levels)

    @wp.func(module="unique")
    def trace_shadow(pixel: wp.int32, hit: wp.int32, share: Share, lit: Lit, undecided: Undecided):
        wanted = hit >= 0
        if wp.static(effects.receivers):
            if wp.static(marks):
                if wanted:
                    seen = ray_of(share.camera, pixel)
                    wanted = hit_receives(
                        lit.light, lit.faces, seen, hit, share.mesh, lit.lights, lit.spots, lit.front_facing
                    )
                set_entry(lit.receivers, lit.light, pixel, wp.uint8(wanted))
            else:
                wanted = wanted and entry(lit.receivers, lit.light, pixel) != wp.uint8(0)
        found = wp.vec4i(-1, -1, -1, 0)
        place = entry(lit.lights, lit.light)
        if wanted:
            found = between(entry(share.starts, pixel), place, hit, share.tree, lit.planes, undecided, has_holes())
        if wp.static(exact):
            ray = ray_of(share.camera, pixel)
            if wp.static(effects.bounced):
                ray = ray_at(share.rays, pixel)
            bit = hidden(found, ray, hit, place, share, undecided)
        else:
            bit = wp.uint8(found[3])
        set_entry(lit.shadowed, lit.light, pixel, bit)

    return trace_shadow


@functools.cache
def make_shadow_kernel(exact: bool, marks: bool, levels: int = 1) -> Any:
    """One thread per pixel, 8 x 4 per warp, or per listed pixel: :func:`make_shadow`. The bits of pixels that are not listed
    stay.
    """
    trace_shadow = make_shadow(exact, marks, levels)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=REGISTERS)
    def shadow_kernel(share: Share, lit: Lit, undecided: Undecided):
        k = wp.tid()
        if wp.static(effects.bounced):
            if k >= entry(share.count, 0):
                return
            pixel = entry(share.listed, k)
        else:
            at = pixel_at(share, k)
            if at[0] < 0:
                return
            pixel = at[1] * share.camera.width + at[0]
        trace_shadow(pixel, entry(share.hits.triangle, pixel), share, lit, undecided)

    return shadow_kernel


@functools.cache
def make_together_kernel(exact: bool, packets: bool, levels: int = 1) -> Any:
    """One thread per pixel, 8 x 4 per warp: :func:`.closest.make_eye`, then :func:`make_shadow` of what it has hit.

    In passes of their own all shadow rays wait for the last primary ray. Of a small mesh few warps have long ways, and most
    of the time is waiting for these. The undecided triangles of both have lists of their own.
    """
    trace_eye, trace_shadow = make_eye(exact, packets, levels), make_shadow(exact, True, levels)

    @wp.kernel(
        enable_backward=False,
        grid_stride=False,
        module="unique",
        cuda_max_registers=EYE_REGISTERS if exact else REGISTERS,
    )
    def together_kernel(
        share: Share, records: wp.array[wp.vec4f], undecided: Undecided, lit: Lit, undecided_shadows: Undecided
    ):
        found = trace_eye(wp.tid(), share, records, undecided)
        if found[0] < 0:
            return
        trace_shadow(found[0], found[1], share, lit, undecided_shadows)

    return together_kernel


@functools.cache
def make_shadow_tests_kernel(exact: bool, levels: int = 1) -> Any:
    """One thread per pixel: how many triangles the shadow ray of its primary hit is tested against, added to its others."""
    count = make_any(exact, levels, counts=True)

    @wp.kernel(enable_backward=False, grid_stride=False, module="unique")
    def shadow_tests_kernel(share: Share, lit: Lit, undecided: Undecided, tests: wp.array[wp.int32]):
        pixel = wp.tid()
        hit = entry(share.hits.triangle, pixel)
        wanted = hit >= 0
        if wp.static(effects.receivers):
            wanted = wanted and entry(lit.receivers, lit.light, pixel) != wp.uint8(0)
        if wanted:
            place = entry(lit.lights, lit.light)
            start = entry(share.starts, pixel)
            tests[pixel] += count(start, place, hit, share.tree, lit.planes, undecided, has_holes())[0]

    return shadow_tests_kernel
