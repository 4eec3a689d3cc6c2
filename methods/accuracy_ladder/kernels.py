"""The tree's kernels, compiled once for each triangle test and each way of compiling floats."""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ..bvh.exact import SLACK
from ..common.hitpoint import hit_point, plane_distance
from ..common.pixels import pixel_of
from ..common.segment import may_occlude, occludes
from ..common.triangle import U32, largest, nearer, to_float64, weld_of
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
        width: wp.int32,
        height: wp.int32,
        eye: wp.array(dtype=wp.vec3f),
        column: wp.array(dtype=wp.vec3f),
        row: wp.array(dtype=wp.vec3f),
        points: wp.array(dtype=wp.vec3f),
        triangles: wp.array(dtype=wp.vec3i),
        weld: wp.array(dtype=wp.int32),
        valid: wp.array(dtype=wp.uint8),
        triangle: wp.array(dtype=wp.int32),
        t_out: wp.array(dtype=wp.float32),
        u_out: wp.array(dtype=wp.float32),
        v_out: wp.array(dtype=wp.float32),
        hit: wp.array(dtype=wp.vec3d),
    ):
        pixel = pixel_of(wp.tid(), width, height, True)
        if pixel < 0:
            return
        o = eye[0]
        d = column[pixel % width] + row[pixel // width]
        best = wp.int32(-1)
        best_t = wp.float64(wp.INF)
        u = wp.float32(0.0)
        v = wp.float32(0.0)
        limit = wp.float32(wp.INF)
        i = wp.int32(0)
        query = wp.bvh_query_ray(bvh, o, d)
        while wp.bvh_query_next(query, i, limit):
            if valid[i] != wp.uint8(0):
                face = triangles[i]
                found = tested(o, d, points[face[0]], points[face[1]], points[face[2]], weld_of(weld, face))
                if found[0] > wp.float64(0.0) and nearer(found[0], i, best_t, best):
                    best = i
                    best_t = found[0]
                    u = wp.float32(found[1])
                    v = wp.float32(found[2])
                    limit = wp.float32(best_t) * SLACK
        triangle[pixel] = best
        u_out[pixel] = u
        v_out[pixel] = v
        if best < 0:
            t_out[pixel] = wp.INF
            return
        t_out[pixel] = wp.float32(best_t)
        corners = triangles[best]
        # The shadow's origin never depends on the test: one knob at a time.
        t = plane_distance(o, d, points[corners[0]], points[corners[1]], points[corners[2]])
        hit[pixel] = hit_point(o, d, t, points[corners[0]], points[corners[1]], points[corners[2]])

    @wp.kernel(module="unique", module_options=options)
    def shadow_kernel(
        bvh: wp.uint64,
        width: wp.int32,
        height: wp.int32,
        light: wp.int32,
        scheme: wp.int32,
        eye: wp.array(dtype=wp.vec3f),
        column: wp.array(dtype=wp.vec3f),
        row: wp.array(dtype=wp.vec3f),
        lights: wp.array(dtype=wp.vec3f),
        box: wp.array(dtype=wp.float32),
        points: wp.array(dtype=wp.vec3f),
        triangles: wp.array(dtype=wp.vec3i),
        weld: wp.array(dtype=wp.int32),
        valid: wp.array(dtype=wp.uint8),
        triangle: wp.array(dtype=wp.int32),
        t_in: wp.array(dtype=wp.float32),
        u_in: wp.array(dtype=wp.float32),
        v_in: wp.array(dtype=wp.float32),
        hit: wp.array(dtype=wp.vec3d),
        visibility: wp.array2d(dtype=wp.uint8),
    ):
        pixel = pixel_of(wp.tid(), width, height, True)
        if pixel < 0:
            return
        own = triangle[pixel]
        if own < 0:
            visibility[light, pixel] = wp.uint8(0)
            return
        target = lights[light]
        corners = triangles[own]
        h = hit[pixel]
        start = start_of(
            scheme, eye[0], column[pixel % width] + row[pixel // width], t_in[pixel], u_in[pixel], v_in[pixel],
            h, points[corners[0]], points[corners[1]], points[corners[2]], target, scene_radius(box),
            wp.static(sheared),
        )  # fmt: skip
        error = wp.float32(0.0)
        size = wp.float64(0.0)
        if scheme == HIT_POINT:
            error = U32 * largest(start)
            size = wp.float64(largest(eye[0]))
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
            if i != own and valid[i] != wp.uint8(0):
                face = triangles[i]
                a = points[face[0]]
                b = points[face[1]]
                c = points[face[2]]
                w = weld_of(weld, face)
                if wp.static(in_float64):
                    maybe = wp.bool(True)
                    if wp.static(filtered):
                        maybe = may_occlude(start, target, a, b, c, error)
                    if maybe:
                        shadowed = occludes(h, target, a, b, c, w, size)
                else:
                    found = tested(start, way, a, b, c, w)
                    shadowed = found[0] > wp.float64(0.0) and found[0] < wp.float64(1.0)
        visibility[light, pixel] = wp.where(shadowed, wp.uint8(1), wp.uint8(0))

    return primary_kernel, shadow_kernel
