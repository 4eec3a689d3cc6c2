"""A triangle's corners and weld indices in 48 contiguous bytes, and the triangle tests of a query that reads them so.

A tree finds triangles in no order of the mesh. Through the mesh, a test reads the triangle, then its points and their weld
indices: thirteen addresses, the later ones known only after the first. A record takes three reads of 16 bytes.
"""

from __future__ import annotations

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.geometry import Corners, Mesh, Ray, corners_of, weld_of
from .alpha import opaque_at_hit, opaque_to_light
from .entries import entry, set_entry
from .ray_queries import Found, Segment, with_hit
from .segment import may_occlude, occludes
from .triangle import hit_distance, may_hit, nearer_of

NOBODY = wp.constant(-1)
"""In place of the first weld index: the triangle is invalid, and no ray hits it."""


@wp.struct
class Triangle:
    """A triangle as its record gives it."""

    corners: Corners
    weld: wp.vec3i


@wp.func
def cornered(p: wp.vec3f, weld: wp.int32) -> wp.vec4f:
    return wp.vec4f(p[0], p[1], p[2], wp.cast(weld, wp.float32))


@wp.func
def store_record(records: wp.array(dtype=wp.vec4f), mesh: Mesh, i: wp.int32):
    """Write the record of triangle i: three vec4f, each a corner and its weld index."""
    if mesh.valid[i] == wp.uint8(0):
        set_entry(records, 3 * i, cornered(wp.vec3f(0.0, 0.0, 0.0), NOBODY))
        return
    corners = corners_of(mesh, i)
    weld = weld_of(mesh, i)
    set_entry(records, 3 * i, cornered(corners.a, weld[0]))
    set_entry(records, 3 * i + 1, cornered(corners.b, weld[1]))
    set_entry(records, 3 * i + 2, cornered(corners.c, weld[2]))


@wp.func
def triangle_at(records: wp.array(dtype=wp.vec4f), i: wp.int32) -> Triangle:
    """Triangle i; its first weld index is NOBODY where it is invalid."""
    a = entry(records, 3 * i)
    b = entry(records, 3 * i + 1)
    c = entry(records, 3 * i + 2)
    triangle = Triangle()
    triangle.corners = Corners(
        wp.vec3f(a[0], a[1], a[2]), wp.vec3f(b[0], b[1], b[2]), wp.vec3f(c[0], c[1], c[2])
    )
    triangle.weld = wp.vec3i(wp.cast(a[3], wp.int32), wp.cast(b[3], wp.int32), wp.cast(c[3], wp.int32))
    return triangle


@wp.func
def closest_hit(
    triangle: Triangle, count: wp.int32, alpha: Alpha, i: wp.int32, ray: Ray, found: Found
) -> Found:
    """:func:`.ray_queries.closest_hit` of triangle i of ``count``."""
    if may_hit(ray, triangle.corners):
        t = hit_distance(ray, triangle.corners, triangle.weld)
        if t > wp.float64(0.0) and nearer_of(count, t, i, found.t, found.triangle):
            found = with_hit(found, i, t)
    return found


@wp.func
def closest_opaque_hit(
    triangle: Triangle, count: wp.int32, alpha: Alpha, i: wp.int32, ray: Ray, found: Found
) -> Found:
    """:func:`.ray_queries.closest_opaque_hit`."""
    if may_hit(ray, triangle.corners):
        t = hit_distance(ray, triangle.corners, triangle.weld)
        if t > wp.float64(0.0) and nearer_of(count, t, i, found.t, found.triangle):
            if opaque_at_hit(alpha, i, ray, triangle.corners, triangle.weld):
                found = with_hit(found, i, t)
    return found


@wp.func
def any_hit(
    triangle: Triangle, count: wp.int32, alpha: Alpha, i: wp.int32, segment: Segment, found: Found
) -> Found:
    """:func:`.ray_queries.any_hit`."""
    if i != segment.own:
        if may_occlude(segment.start, segment.light, triangle.corners, segment.error):
            found.done = occludes(
                segment.hit, segment.light, triangle.corners, triangle.weld, segment.origin_size
            )
    return found


@wp.func
def any_opaque_hit(
    triangle: Triangle, count: wp.int32, alpha: Alpha, i: wp.int32, segment: Segment, found: Found
) -> Found:
    """:func:`.ray_queries.any_opaque_hit`."""
    if i != segment.own:
        corners = triangle.corners
        if may_occlude(segment.start, segment.light, corners, segment.error):
            if occludes(segment.hit, segment.light, corners, triangle.weld, segment.origin_size):
                found.done = opaque_to_light(
                    alpha, i, segment.hit, segment.light, corners, triangle.weld, segment.origin_size
                )
    return found
