"""A triangle against rays: what float32 decides of them, the shadow bits, and pairs that are left to float64.

A set bit stays set, so the order in which triangles arrive does not matter. What the planes cannot decide is queued for
``occludes`` in float64 (:mod:`.undecided`). A ray's own triangle passes through its hit point, so it is always among the
undecided; it occludes no ray of its own, and is left out.
"""

from typing import Any

import warp as wp

from ....harness.frame.geometry import struct_with_bases
from ...gpu.entries import entry, entry_if, set_entry
from ..queues import Queue, queue_undecided
from ..rays.sort import span_of
from .planes import Occluder


class BitFields:
    """The shadow bits of one light.

    light       its row of ``shadowed``      triangle  int32 [pixels]: what each pixel's ray hit
    shadowed  uint8 [lights, pixels]: 1 = shadowed
    """

    light: wp.int32
    triangle: wp.array(dtype=wp.int32)
    shadowed: wp.array2d(dtype=wp.uint8)


@struct_with_bases
class ShadowBits(BitFields):
    """The bits alone."""


@struct_with_bases
class RememberedBits(BitFields):
    """The bits, and ``last`` int32 [pixels]: 1 + the triangle that last shadowed each pixel's ray, or 0."""

    last: wp.array(dtype=wp.int32)


@wp.func
def value_at(plane: wp.vec4f, h: wp.vec4f) -> wp.float32:
    """n . h + c, in three operations on a GPU."""
    return plane[0] * h[0] + (plane[1] * h[1] + (plane[2] * h[2] + plane[3]))


@wp.func
def certain(h: wp.vec4f, occluder: Occluder) -> tuple[wp.bool, wp.bool]:
    """Whether a ray (hit point and pixel) certainly misses a triangle, and whether it certainly hits it."""
    low = wp.min(value_at(occluder.e0, h), wp.min(value_at(occluder.e1, h), value_at(occluder.e2, h)))
    side = value_at(occluder.plane, h)
    return low < -occluder.bound or side > occluder.bound, low > occluder.sure and side < -occluder.sure


@wp.func
def set_shadowed(bits: ShadowBits, pixel: wp.int32, i: wp.int32):
    """Set the pixel's bit: triangle i shadows it."""
    set_entry(bits.shadowed, bits.light, pixel, wp.uint8(1))


@wp.func
def set_shadowed(bits: RememberedBits, pixel: wp.int32, i: wp.int32):
    """Set the pixel's bit: triangle i shadows it. Of several triangles any one is remembered."""
    set_entry(bits.shadowed, bits.light, pixel, wp.uint8(1))
    set_entry(bits.last, pixel, i + 1)


@wp.func
def queue_if_lit(bits: Any, queue: Queue, i: wp.int32, pixel: wp.int32):
    """Queue an undecided pair for float64, unless the pixel is shadowed already."""
    if entry(bits.shadowed, bits.light, pixel) == wp.uint8(0):
        queue_undecided(queue, i, pixel)


@wp.func
def test_ray(bits: Any, queue: Queue, h: wp.vec4f, occluder: Occluder):
    """Test a ray (hit point and pixel) against a triangle. Few pairs are undecided, but nearly every warp meets one; if
    it were decided here, all lanes of the warp would wait."""
    misses, hits = certain(h, occluder)
    if not misses:
        pixel = wp.cast(h[3], wp.int32)
        if hits:
            set_shadowed(bits, pixel, occluder.i)
        elif entry(bits.triangle, pixel) != occluder.i:
            queue_if_lit(bits, queue, occluder.i, pixel)


@wp.func
def test_rays_of_box(
    bits: Any, queue: Queue, cells: Any, along: wp.int32, face: wp.int32, box: wp.vec4i, occluder: Occluder
):
    """Test the rays in a box of cells; ``along``: cells along a face.

    One loop over the rays of all rows, two at a time: in a loop of its own for each row, the lanes of a warp would
    wait for the longest row every time, and for memory at every ray.
    """
    y = wp.int32(box[1])
    span = span_of(cells.offset, face, box[0], box[2], y, along)
    at = wp.int32(span[0])
    end = wp.int32(span[1])
    while at < end or y < box[3]:
        if at >= end:
            y += 1
            span = span_of(cells.offset, face, box[0], box[2], y, along)
            at = span[0]
            end = span[1]
        if at < end:
            h = entry(cells.rays, at)
            g = wp.vec4f()
            two = at + 1 < end
            if two:
                g = entry(cells.rays, at + 1)
            at += 2
            misses, hits = certain(h, occluder)
            misses_other, hits_other = certain(g, occluder)
            i = occluder.i
            pixel = wp.cast(h[3], wp.int32)
            pixel_other = wp.cast(g[3], wp.int32)
            # Both are loaded before either is looked at.
            own = entry_if(not misses and not hits, bits.triangle, pixel, i)
            own_other = entry_if(two and not misses_other and not hits_other, bits.triangle, pixel_other, i)
            if hits:
                set_shadowed(bits, pixel, i)
            if two and hits_other:
                set_shadowed(bits, pixel_other, i)
            if own != i:
                queue_if_lit(bits, queue, i, pixel)
            if own_other != i:
                queue_if_lit(bits, queue, i, pixel_other)
