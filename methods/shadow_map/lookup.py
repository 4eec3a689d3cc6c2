"""Shadow bits looked up in a depth map, with the biases that engines use."""

from __future__ import annotations

import warp as wp

from ...harness.frame.specialise import effects
from ..common.triangle import to_float32, to_float64
from .projection import LightMap, face_axes, face_of, map_point

NONE, CONSTANT, SLOPE, NORMAL = 0, 1, 2, 3
STEEPEST = wp.constant(10.0)
"""Texels that a slope-scaled bias amounts to at most: along the light it would be infinite."""

GRAIN = wp.constant(4.0e-6)
"""Share of the depth range that every bias but "none" adds for the rounding of stored depths."""


@wp.func
def normal_to_light(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, way: wp.vec3f) -> wp.vec3f:
    """The triangle's unit normal on the light's side."""
    a64 = to_float64(a)
    n = to_float32(wp.normalize(wp.cross(to_float64(b) - a64, to_float64(c) - a64)))
    if wp.dot(n, way) < 0.0:
        return -n
    return n


@wp.func
def texel_at(s: wp.float32, size: wp.int32) -> wp.int32:
    n = wp.float32(size)
    return wp.int32(wp.floor(wp.clamp(0.5 * n * (s + 1.0), 0.0, n - 1.0)))


@wp.kernel(enable_backward=False)
def lookup_kernel(
    light: wp.int32,
    size: wp.int32,
    faces: wp.int32,
    bias: wp.int32,
    amount: wp.float32,
    radius: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    light_map: wp.array(dtype=LightMap),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    triangle: wp.array(dtype=wp.int32),
    hit: wp.array(dtype=wp.vec3d),
    receivers: wp.array2d(dtype=wp.uint8),
    texels: wp.array(dtype=wp.int32),
    visibility: wp.array2d(dtype=wp.uint8),
):
    """One pixel a thread. ``radius``: 0 nearest texel, 1 the 3 x 3 around it, of which more than half decide."""
    pixel = wp.tid()
    best = triangle[pixel]
    if best < 0:
        visibility[light, pixel] = wp.uint8(0)
        return
    if wp.static(effects.receivers):
        if receivers[light, pixel] == wp.uint8(0):
            visibility[light, pixel] = wp.uint8(0)
            return
    m = light_map[0]
    if m.faces > faces:
        visibility[light, pixel] = wp.uint8(0)  # the map does not fit: the frame is repeated with room for it
        return
    p = to_float32(hit[pixel])
    face = face_of(m, p)
    depth_range = m.far - m.near
    back = wp.float32(0.0)
    if bias == CONSTANT:
        back = amount * depth_range
    if bias >= SLOPE:
        corners = triangles[best]
        way = to_float32(to_float64(lights[light]) - hit[pixel])
        n = normal_to_light(points[corners[0]], points[corners[1]], points[corners[2]], way)
        local = face_axes(m, face, p - m.middle)
        z = wp.abs(m.distance + local[0])
        texel = 2.0 * wp.max(m.half[0], m.half[1]) * z / wp.float32(size)
        if bias == SLOPE:
            across = face_axes(m, face, n)
            along = wp.abs(wp.dot(n, wp.normalize(way)))
            slope = wp.min((wp.abs(across[1]) + wp.abs(across[2])) / wp.max(along, 1.0e-6), STEEPEST)
            back = amount * texel * slope
        else:
            cosine = wp.dot(n, wp.normalize(way))
            p = p + n * (amount * texel * wp.sqrt(wp.max(0.0, 1.0 - cosine * cosine)))
            face = face_of(m, p)
    if bias != NONE:
        back += GRAIN * depth_range
    q = map_point(m, face, p)
    depth = q[3] - back / depth_range
    x = texel_at(q[1] / q[0], size)
    y = texel_at(q[2] / q[0], size)
    nearer = wp.int32(0)
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            column = wp.clamp(x + dx, 0, size - 1)
            row = wp.clamp(y + dy, 0, size - 1)
            if wp.cast(texels[(face * size + row) * size + column], wp.float32) < depth:
                nearer += 1
    side = 2 * radius + 1
    visibility[light, pixel] = wp.where(2 * nearer > side * side, wp.uint8(1), wp.uint8(0))
