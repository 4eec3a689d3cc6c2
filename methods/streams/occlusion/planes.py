"""A triangle as a light's rays are tested against it: planes through the light in float32, what they decide, shadow bits.

Each plane is n . p + c, with a bound on its float32 error at any hit point of the frame. A set bit stays set, so the order
in which triangles arrive does not matter. What the planes cannot decide is queued for ``occludes`` in float64
(:mod:`.undecided`). A ray's own triangle passes through its hit point, so it is always among the undecided; it occludes no
ray of its own, and is left out.
"""

from typing import Any

import warp as wp

from ....harness.frame.geometry import Corners, struct_with_bases
from ...exact.planes import edge_plane, facing_to, plane_at
from ...exact.triangle import U32
from ...gpu.entries import entry, entry_if, set_entry
from ..camera.pixels import largest_of
from ..cube.rectangle import max_coordinate_of
from ..queues import Queue, queue_undecided
from ..rays.sort import span_of


@wp.struct
class Occluder:
    """A triangle as rays are tested against it: inward planes through the light and the edges, and the triangle's plane,
    positive on the light's side.

    Each plane is (n, c): signs of n . p + c beyond ``bound`` are certain for every hit point p of the frame. All are zero
    where float64 must decide.

    i      the triangle                     bound  :func:`bound_of`
    sure   signs beyond it are a certain hit: the bound, or infinite where the triangle has holes
    """

    e0: wp.vec4f
    e1: wp.vec4f
    e2: wp.vec4f
    plane: wp.vec4f
    i: wp.int32
    bound: wp.float32
    sure: wp.float32


@wp.func
def occluder_of(
    i: wp.int32, bound: wp.float32, sure: wp.float32, light: wp.vec3f, corners: Corners, closely: wp.bool
) -> Occluder:
    """Planes in float32: n = (p - light) x (q - p), scaled so that its parts are at most 2. What a scale is off is the same
    for all parts of a plane, so it moves none.

    A triangle that the light sees edge-on within rounding gets zeros: float64 decides all its candidates. With ``closely``
    it gets its planes, and one that every ray misses if float64 finds it edge-on, too. That is for large triangles: where
    the light stands in a surface, millions of pairs would be left to float64.
    """
    o = Occluder()
    o.i = i
    o.bound = bound
    o.sure = sure
    facing = facing_to(light, corners, closely)
    o.e0 = edge_plane(light, corners.b, corners.c, facing.toward)
    o.e1 = edge_plane(light, corners.c, corners.a, facing.toward)
    o.e2 = edge_plane(light, corners.a, corners.b, facing.toward)
    o.plane = plane_at(facing.normal, corners.a)
    if facing.never:
        o.e0 = wp.vec4f(0.0, 0.0, 0.0, -wp.INF)
    return o


@wp.func
def occludes_none(o: Occluder) -> wp.bool:
    """Whether every ray misses a triangle because the light lies in its plane (:func:`occluder_of`)."""
    return o.e0[3] == -wp.INF


@wp.func
def sign_bound(size: wp.float32) -> wp.float32:
    """Error of n . h + c, where ``size`` bounds every coordinate of the hit points and of the triangle.

    n is known to 8 u per component; over |h - p|_1 <= 6 size that is 48 u size, and n . h + c rounds by 78 u size more.
    A hit point may be off by u size more in each coordinate (:mod:`..rays.hit_points`), which is 6 u size.
    """
    return 134.0 * U32 * size + 1.0e-36


@wp.func
def bound_of(row: wp.vec4f, corners: Corners) -> wp.float32:
    """:func:`sign_bound` of a triangle and every hit point of a light (:func:`..cube.rectangle.last_row`)."""
    return sign_bound(wp.max(max_coordinate_of(row), largest_of(corners)))


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
    it were decided here, all lanes of the warp would wait.
    """
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
