"""The tree's kernels, compiled once for each triangle test and each way of compiling floats."""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ...harness.frame.geometry import Camera, Hits, Mesh, Ray, corners_of, ray_of, weld_of
from ..bvh.exact import SLACK
from ..common.hitpoint import hit_point, plane_distance
from ..common.pixels import pixel_of
from ..common.segment import may_occlude, occludes
from ..common.triangle import U32, largest, nearer, to_float64
from .origins import HIT_POINT, IDENTITY, scene_radius, start_of
from .parameters import EXACT_TESTS, SHEARED_TESTS
from .tests import TESTS


@functools.cache
def make_kernels(test: str, fast_math: bool) -> tuple[Any, Any]:
    """(primary kernel, shadow kernel) with one triangle test compiled in."""
    tested = TESTS[test]
    in_float64 = test in EXACT_TESTS
    filtered = test == "exact"
    sheared = test in SHEARED_TESTS
    options = {"fast_math": fast_math, "enable_backward": False}

    @wp.kernel(module="unique", module_options=options)
    def primary_kernel(
        bvh: wp.uint64,
        camera: Camera,
        mesh: Mesh,
        hits: Hits,
        hit: wp.array(dtype=wp.vec3d),
    ):
        pixel = pixel_of(wp.tid(), camera.width, camera.height, True)
        if pixel < 0:
            return
        ray = ray_of(camera, pixel)
        best = wp.int32(-1)
        best_t = wp.float64(wp.INF)
        u = wp.float32(0.0)
        v = wp.float32(0.0)
        limit = wp.float32(wp.INF)
        i = wp.int32(0)
        query = wp.bvh_query_ray(bvh, ray.origin, ray.direction)
        while wp.bvh_query_next(query, i, limit):
            if mesh.valid[i] != wp.uint8(0):
                found = tested(ray, corners_of(mesh, i), weld_of(mesh, i))
                if found[0] > wp.float64(0.0) and nearer(found[0], i, best_t, best):
                    best = i
                    best_t = found[0]
                    u = wp.float32(found[1])
                    v = wp.float32(found[2])
                    limit = wp.float32(best_t) * SLACK
        hits.triangle[pixel] = best
        hits.u[pixel] = u
        hits.v[pixel] = v
        if best < 0:
            hits.t[pixel] = wp.INF
            return
        hits.t[pixel] = wp.float32(best_t)
        corners = corners_of(mesh, best)
        # The shadow's origin never depends on the test: one knob at a time.
        hit[pixel] = hit_point(ray, plane_distance(ray, corners), corners)

    @wp.kernel(module="unique", module_options=options)
    def shadow_kernel(
        bvh: wp.uint64,
        light: wp.int32,
        scheme: wp.int32,
        camera: Camera,
        lights: wp.array(dtype=wp.vec3f),
        box: wp.array(dtype=wp.float32),
        mesh: Mesh,
        hits: Hits,
        hit: wp.array(dtype=wp.vec3d),
        visibility: wp.array2d(dtype=wp.uint8),
    ):
        pixel = pixel_of(wp.tid(), camera.width, camera.height, True)
        if pixel < 0:
            return
        own = hits.triangle[pixel]
        if own < 0:
            visibility[light, pixel] = wp.uint8(0)
            return
        target = lights[light]
        h = hit[pixel]
        start = start_of(
            scheme, ray_of(camera, pixel), hits.t[pixel], hits.u[pixel], hits.v[pixel], h, corners_of(mesh, own),
            target, scene_radius(box), wp.static(sheared),
        )  # fmt: skip
        error = wp.float32(0.0)
        size = wp.float64(0.0)
        if scheme == HIT_POINT:
            error = U32 * largest(start)
            size = wp.float64(largest(camera.eye[0]))
        else:
            h = to_float64(start)
            if scheme != IDENTITY:
                own = wp.int32(-1)
        way = target - start
        shadowed = wp.bool(False)
        i = wp.int32(0)
        query = wp.bvh_query_ray(bvh, start, way)
        # Not left by a break: of some tests a GPU's compiler then makes a loop whose lanes go on one by one (3.4 of 32
        # active instead of 10.5, and three times as long), and it would be that, not the test, whose cost is seen.
        while not shadowed and wp.bvh_query_next(query, i, SLACK):
            if i != own and mesh.valid[i] != wp.uint8(0):
                corners = corners_of(mesh, i)
                w = weld_of(mesh, i)
                if wp.static(in_float64):
                    maybe = wp.bool(True)
                    if wp.static(filtered):
                        maybe = may_occlude(start, target, corners, error)
                    if maybe:
                        shadowed = occludes(h, target, corners, w, size)
                else:
                    found = tested(Ray(start, way), corners, w)
                    shadowed = found[0] > wp.float64(0.0) and found[0] < wp.float64(1.0)
        visibility[light, pixel] = wp.where(shadowed, wp.uint8(1), wp.uint8(0))

    return primary_kernel, shadow_kernel
