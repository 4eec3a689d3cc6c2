"""The tree's kernels, compiled once for each triangle test and each way of compiling floats."""

import functools
from typing import Any

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.geometry import Hits, Mesh, Ray, corners_of
from ..common.box_tree import walk
from ..common.corner_records import CornerRecords, corners_in, triangles_in, weld_in
from ..exact.hit_point import hit_point, plane_distance
from ..exact.ray_queries import Found, Segment, any_hit, closest_hit, with_hit
from ..exact.segment import occludes
from ..exact.triangle import nearer_of, to_float64, write_miss
from ..rays.kernels import make_primary_kernel, make_shadow_kernel
from .origins import HIT_POINT, IDENTITY, start_of
from .parameters import EXACT_TESTS
from .tests import TESTS


@wp.struct
class Rung:
    """:class:`..common.box_tree.Boxes`, the scheme of shadow rays' origins and whether the test is sheared
    (:func:`.origins.start_of`), and the scene's box.
    """

    tree: wp.uint64
    records: CornerRecords
    scheme: wp.int32
    sheared: wp.bool
    box: wp.array(dtype=wp.float32)


def closest_hit_by(test: str) -> Any:
    """A test of a traversal (:mod:`..exact.ray_queries`) that finds the closest hit by the triangle test named ``test``.

    The float64 test leaves the weights to the end: in the loop their divisions would change its layout.
    """
    if test == "exact":
        return closest_hit
    triangle_test = TESTS[test]

    @wp.func
    def closest_hit_of_ray(records: CornerRecords, alpha: Alpha, i: wp.int32, ray: Ray, found: Found) -> Found:
        hit = triangle_test(ray, corners_in(records, i), weld_in(records, i))
        if hit[0] > wp.float64(0.0) and nearer_of(triangles_in(records), hit[0], i, found.t, found.triangle):
            found = with_hit(found, i, hit[0])
            found.u = wp.float32(hit[1])
            found.v = wp.float32(hit[2])
        return found

    return closest_hit_of_ray


def any_hit_by(test: str) -> Any:
    """A test of a traversal that finds any occluder by the triangle test named ``test``."""
    if test == "exact":
        return any_hit
    if test == "float64":
        return any_hit_in_float64
    triangle_test = TESTS[test]

    @wp.func
    def any_hit_of_ray(records: CornerRecords, alpha: Alpha, i: wp.int32, segment: Segment, found: Found) -> Found:
        if i != segment.own:
            ray = Ray(segment.start, segment.light - segment.start)
            hit = triangle_test(ray, corners_in(records, i), weld_in(records, i))
            found.done = hit[0] > wp.float64(0.0) and hit[0] < wp.float64(1.0)
        return found

    return any_hit_of_ray


@wp.func
def any_hit_in_float64(records: CornerRecords, alpha: Alpha, i: wp.int32, segment: Segment, found: Found) -> Found:
    """:func:`..exact.ray_queries.any_hit` without its test in float32."""
    if i != segment.own:
        found.done = occludes(
            segment.hit, segment.light, corners_in(records, i), weld_in(records, i), segment.origin_size
        )
    return found


@wp.func
def write_found(hits: Hits, hit_points: wp.array(dtype=wp.vec3d), pixel: wp.int32, ray: Ray, found: Found, mesh: Mesh):
    """Write a hit with the distance and the weights that its test gave. Its hit point does not depend on them, so that each
    parameter changes one thing.
    """
    if found.triangle < 0:
        write_miss(hits, pixel)
        return
    hits.triangle[pixel] = found.triangle
    hits.t[pixel] = wp.float32(found.t)
    hits.u[pixel] = found.u
    hits.v[pixel] = found.v
    corners = corners_of(mesh, found.triangle)
    hit_points[pixel] = hit_point(ray, plane_distance(ray, corners), corners)


@wp.func
def started(rung: Rung, exact: Segment, ray: Ray, hits: Hits, pixel: wp.int32, mesh: Mesh) -> Segment:
    """A shadow ray of a scheme, given the exact one."""
    segment = exact
    if rung.scheme != HIT_POINT:
        found_at = wp.vec3f(hits.t[pixel], hits.u[pixel], hits.v[pixel])
        corners = corners_of(mesh, segment.own)
        segment.start = start_of(rung.scheme, ray, found_at, corners, segment.light, rung.box, rung.sheared)
        segment.hit = to_float64(segment.start)
        segment.error = 0.0
        segment.origin_size = wp.float64(0.0)
        if rung.scheme != IDENTITY:
            segment.own = -1
    return segment


@functools.cache
def make_kernels(test: str, fast_math: bool) -> tuple[Any, Any]:
    """(primary kernel, shadow kernel) with one triangle test compiled in, for :class:`..rays.launches.PixelRays`."""
    write = None if test in EXACT_TESTS else write_found
    primary = make_primary_kernel(Rung, walk, 0, closest_hit_by(test), write, fast_math)
    return primary, make_shadow_kernel(Rung, walk, 0, any_hit_by(test), started, fast_math)
