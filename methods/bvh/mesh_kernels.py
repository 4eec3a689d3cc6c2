"""Kernels around Warp's own mesh queries, and the index array that keeps invalid triangles harmless."""

from __future__ import annotations

import warp as wp

from ...harness.frame.specialise import effects
from ..common.offset import shadow_origin
from ..common.pixels import pixel_of
from ..common.triangle import write_miss


@wp.func
def finite_vertex(v: wp.int32, points: wp.array(dtype=wp.vec3f)) -> wp.bool:
    return wp.isfinite(points[v])


@wp.kernel(enable_backward=False)
def mesh_indices_kernel(
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    valid: wp.array(dtype=wp.uint8),
    indices: wp.array(dtype=wp.int32),
):
    """Indices of a triangle; an invalid one becomes a finite point, which no ray hits and no box suffers from."""
    i = wp.tid()
    if valid[i] != wp.uint8(0) and indices[3 * i] != indices[3 * i + 1]:
        return  # as it was: most frames of most meshes write nothing
    face = triangles[i]
    if valid[i] == wp.uint8(0):
        v = face[0]
        if not finite_vertex(v, points):
            v = face[1]
        if not finite_vertex(v, points):
            v = face[2]
        if not finite_vertex(v, points):
            v = wp.int32(0)
            while v < points.shape[0] - 1 and not finite_vertex(v, points):
                v += wp.int32(1)
        face = wp.vec3i(v, v, v)
    indices[3 * i] = face[0]
    indices[3 * i + 1] = face[1]
    indices[3 * i + 2] = face[2]


@wp.kernel(enable_backward=False)
def mesh_primary_kernel(
    mesh: wp.uint64,
    width: wp.int32,
    height: wp.int32,
    blocks: wp.bool,
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    origins: wp.array(dtype=wp.vec3f),
    directions: wp.array(dtype=wp.vec3f),
    active: wp.array(dtype=wp.uint8),
    triangle: wp.array(dtype=wp.int32),
    t: wp.array(dtype=wp.float32),
    u: wp.array(dtype=wp.float32),
    v: wp.array(dtype=wp.float32),
):
    pixel = pixel_of(wp.tid(), width, height, blocks)
    if pixel < 0:
        return
    o = eye[0]
    d = column[pixel % width] + row[pixel // width]
    if wp.static(effects.bounced):
        if active[pixel] == wp.uint8(0):
            write_miss(pixel, triangle, t, u, v)
            return
        o = origins[pixel]
        d = directions[pixel]
    found = wp.mesh_query_ray(mesh, o, d, wp.INF)
    if found.result:
        triangle[pixel] = found.face
        t[pixel] = found.t
        # Warp's (u, v) are the weights of vertices 0 and 1; ours those of 1 and 2.
        u[pixel] = found.v
        v[pixel] = 1.0 - found.u - found.v
    else:
        write_miss(pixel, triangle, t, u, v)


@wp.kernel(enable_backward=False)
def mesh_shadow_kernel(
    mesh: wp.uint64,
    width: wp.int32,
    height: wp.int32,
    blocks: wp.bool,
    light: wp.int32,
    end: wp.float32,
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    lights: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    triangle: wp.array(dtype=wp.int32),
    receivers: wp.array2d(dtype=wp.uint8),
    origins: wp.array(dtype=wp.vec3f),
    directions: wp.array(dtype=wp.vec3f),
    visibility: wp.array2d(dtype=wp.uint8),
):
    pixel = pixel_of(wp.tid(), width, height, blocks)
    if pixel < 0:
        return
    if wp.static(effects.masked):
        if receivers[light, pixel] == wp.uint8(0):
            visibility[light, pixel] = wp.uint8(0)
            return
    shadowed = wp.bool(False)
    best = triangle[pixel]
    if best >= 0:
        face = triangles[best]
        o = eye[0]
        d = column[pixel % width] + row[pixel // width]
        if wp.static(effects.bounced):
            o = origins[pixel]
            d = directions[pixel]
        target = lights[light]
        origin = shadow_origin(o, d, target, points[face[0]], points[face[1]], points[face[2]], True)
        shadowed = wp.mesh_query_ray_anyhit(mesh, origin, target - origin, end)
    visibility[light, pixel] = wp.uint8(shadowed)
