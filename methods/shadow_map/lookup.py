"""Shadow bits looked up in a depth map, with the biases that engines use."""

import warp as wp

from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Hits, Mesh, corners_of
from ..exact.triangle import to_float32, to_float64
from .projection import face_axes, face_of, map_point
from .raster import DepthMap

NONE, CONSTANT, SLOPE, NORMAL = 0, 1, 2, 3
CURVED = wp.constant(0.3)
"""Share of the way aside by which a filtered lookup is nearer to the light: surfaces bend away from the receiver's plane."""

STEEPEST = wp.constant(10.0)
"""Texels that a slope-scaled bias amounts to at most: along the light it would be infinite."""

GRAIN = wp.constant(4.0e-6)
"""Share of the depth range that every bias but "none" adds for the rounding of stored depths."""


@wp.struct
class Lookup:
    """How a map is looked up.

    bias    0 none, 1 constant, 2 slope, 3 normal (:data:`.parameters.BIASES`)    amount  of the bias
    radius  0: the nearest texel; 1: the 3 x 3 around it, of which more than half decide
    spread  share of the target's way from the middle of its area that the lookup moves aside (:func:`filtered`); 0: none
    """

    bias: wp.int32
    amount: wp.float32
    radius: wp.int32
    spread: wp.float32


@wp.func
def filtered(p: wp.vec3f, n: wp.vec3f, way: wp.vec3f, offset: wp.vec3f) -> wp.vec3f:
    """Where to look instead of at ``p``: ``offset`` aside, in the receiver's plane (Isidoro 2006).

    n  normal of the plane      way  to the middle of the light
    """
    w = wp.normalize(way)
    aside = offset - w * wp.dot(w, offset)
    steep = STEEPEST * wp.length(aside)
    along = wp.max(wp.dot(n, w), 1.0e-6)
    return p + aside + w * (CURVED * wp.length(aside) - wp.clamp(wp.dot(n, aside) / along, -steep, steep))


@wp.func
def texel_at(s: wp.float32, size: wp.int32) -> wp.int32:
    n = wp.float32(size)
    return wp.int32(wp.floor(wp.clamp(0.5 * n * (s + 1.0), 0.0, n - 1.0)))


@wp.kernel(enable_backward=False)
def middle_kernel(
    first: wp.int32, count: wp.int32, lights: wp.array(dtype=wp.vec3f), origins: wp.array(dtype=wp.vec3f)
):
    """The middle of ``count`` targets from ``first`` on (one thread)."""
    total = wp.vec3d()
    for i in range(first, first + count):
        total += to_float64(lights[i])
    origins[first] = to_float32(total / wp.float64(count))


@wp.kernel(enable_backward=False)
def lookup_kernel(
    light: wp.int32,
    drawn: wp.int32,
    lookup: Lookup,
    mesh: Mesh,
    lights: wp.array(dtype=wp.vec3f),
    origins: wp.array(dtype=wp.vec3f),
    depths: DepthMap,
    hits: Hits,
    hit_points: wp.array(dtype=wp.vec3d),
    receivers: wp.array2d(dtype=wp.uint8),
    shadowed: wp.array2d(dtype=wp.uint8),
):
    """The shadow bit of each pixel's hit point; one pixel per thread. The map is that of light ``drawn``, looked from
    ``origins[drawn]``.
    """
    pixel = wp.tid()
    shadowed[light, pixel] = wp.uint8(0)
    best = hits.triangle[pixel]
    m = depths.light[0]
    # Where the map does not fit the frame is repeated with room for it.
    wanted = best >= 0 and m.faces <= depths.faces
    if wp.static(effects.receivers):
        wanted = wanted and receivers[light, pixel] != wp.uint8(0)
    if not wanted:
        return
    size = depths.size
    p = to_float32(hit_points[pixel])
    way = to_float32(to_float64(origins[drawn]) - hit_points[pixel])
    corners = corners_of(mesh, best)
    a64 = to_float64(corners.a)
    n = to_float32(wp.normalize(wp.cross(to_float64(corners.b) - a64, to_float64(corners.c) - a64)))
    if wp.dot(n, way) < 0.0:
        n = -n  # on the light's side
    if lookup.spread > 0.0:
        p = filtered(p, n, way, lookup.spread * (lights[light] - origins[drawn]))
    face = face_of(m, p)
    depth_range = m.far - m.near
    back = wp.float32(0.0)
    if lookup.bias == CONSTANT:
        back = lookup.amount * depth_range
    if lookup.bias >= SLOPE:
        local = face_axes(m, face, p - m.middle)
        z = wp.abs(m.distance + local[0])
        texel = 2.0 * wp.max(m.half[0], m.half[1]) * z / wp.float32(size)
        if lookup.bias == SLOPE:
            across = face_axes(m, face, n)
            along = wp.abs(wp.dot(n, wp.normalize(way)))
            slope = wp.min((wp.abs(across[1]) + wp.abs(across[2])) / wp.max(along, 1.0e-6), STEEPEST)
            back = lookup.amount * texel * slope
        else:
            cosine = wp.dot(n, wp.normalize(way))
            p = p + n * (lookup.amount * texel * wp.sqrt(wp.max(0.0, 1.0 - cosine * cosine)))
            face = face_of(m, p)
    if lookup.bias != NONE:
        back += GRAIN * depth_range
    q = map_point(m, face, p)
    depth = q[3] - back / depth_range
    x = texel_at(q[1] / q[0], size)
    y = texel_at(q[2] / q[0], size)
    nearer = wp.int32(0)
    for dy in range(-lookup.radius, lookup.radius + 1):
        for dx in range(-lookup.radius, lookup.radius + 1):
            column = wp.clamp(x + dx, 0, size - 1)
            row = wp.clamp(y + dy, 0, size - 1)
            if wp.cast(depths.texels[(face * size + row) * size + column], wp.float32) < depth:
                nearer += 1
    side = 2 * lookup.radius + 1
    shadowed[light, pixel] = wp.uint8(2 * nearer > side * side)
