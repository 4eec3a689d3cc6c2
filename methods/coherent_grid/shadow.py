"""Packets of shadow rays through the uniform grid, slice by slice.

The rays of a packet are the segments from its pixels' hit points to the light. In each slice of cells the packet covers the
rectangle that holds what its segments cover; it is computed anew from the segments in every slice, so that it is tight, and
right at any distance of the light. Tests are those of ``ray_grids``: planes through light and edges
(:mod:`..ray_grids.light.rays`).
"""

from __future__ import annotations

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.geometry import Camera, Hits, Mesh
from ...harness.frame.specialise import effects
from ..common.entries import entry
from ..common.grid import cell_of, to_grid
from ..common.triangle import largest, to_float32, to_float64
from ..ray_grids.fetch import corners_at
from ..ray_grids.light.rays import (
    NO,
    Occluder,
    ShadowBits,
    float32_verdict,
    set_bit_or_queue,
    set_planes,
    sign_bound,
)
from ..ray_grids.queues import Queue
from ..uniform_grid.traversal import Cells
from .packets import across, cell_at, cells_within, packet_box

NEVER = wp.constant(wp.float64(wp.inf))


@wp.func
def part_in_slice(
    start: wp.vec3d, end: wp.vec3d, axis: wp.int32, low: wp.float64, high: wp.float64
) -> wp.vec4d:
    """(least u, least v, greatest u, greatest v) of the part of a segment with low <= its ``axis`` <= high; least > greatest
    where there is none."""
    s = start[axis]
    e = end[axis]
    su = across(start, axis)
    eu = across(end, axis)
    if wp.max(s, e) < low or wp.min(s, e) > high:
        return wp.vec4d(NEVER, NEVER, -NEVER, -NEVER)
    if s == e:
        least = wp.min(su, eu)
        most = wp.max(su, eu)
        return wp.vec4d(least[0], least[1], most[0], most[1])
    # From the hit point: its coordinates are those of the grid, where the light's may be far larger.
    p = su + (eu - su) * ((wp.clamp(low, wp.min(s, e), wp.max(s, e)) - s) / (e - s))
    q = su + (eu - su) * ((wp.clamp(high, wp.min(s, e), wp.max(s, e)) - s) / (e - s))
    return wp.vec4d(wp.min(p[0], q[0]), wp.min(p[1], q[1]), wp.max(p[0], q[0]), wp.max(p[1], q[1]))


@wp.kernel(enable_backward=False)
def start_kernel(
    light: wp.int32,
    hits: Hits,
    hit_points: wp.array(dtype=wp.vec3d),
    receivers: wp.array2d(dtype=wp.uint8),
    cells: Cells,
    starts: wp.array(dtype=wp.vec3d),
    points: wp.array(dtype=wp.vec4f),
    visibility: wp.array2d(dtype=wp.uint8),
):
    """Shadow rays of all pixels: where they start in the grid, and their hit points for float32 tests.

    points: (hit point, bits of the pixel). A pixel without a ray has bits of -1.
    """
    pixel = wp.tid()
    visibility[light, pixel] = wp.uint8(0)
    number = wp.int32(-1)
    wanted = entry(hits.triangle, pixel) >= 0
    if wp.static(effects.receivers):
        wanted = receivers[light, pixel] != wp.uint8(0)
    h = wp.vec3f()
    if wanted:
        number = pixel
        starts[pixel] = to_grid(cells.grid[0], hit_points[pixel])
        h = to_float32(hit_points[pixel])
    points[pixel] = wp.vec4f(h[0], h[1], h[2], wp.cast(number, wp.float32))


@wp.func
def slice_rectangle(
    box: wp.vec4i,
    width: wp.int32,
    axis: wp.int32,
    low: wp.float64,
    high: wp.float64,
    end: wp.vec3d,
    starts: wp.array(dtype=wp.vec3d),
    points: wp.array(dtype=wp.vec4f),
    bits: ShadowBits,
) -> wp.vec4d:
    """What the rays of a packet that are not yet shadowed cover of a slice."""
    r = wp.vec4d(NEVER, NEVER, -NEVER, -NEVER)
    for y in range(box[1], box[3] + 1):
        for x in range(box[0], box[2] + 1):
            pixel = y * width + x
            if wp.cast(entry(points, pixel)[3], wp.int32) >= 0:
                if bits.visibility[bits.light, pixel] == wp.uint8(0):
                    p = part_in_slice(starts[pixel], end, axis, low, high)
                    r = wp.vec4d(
                        wp.min(r[0], p[0]), wp.min(r[1], p[1]), wp.max(r[2], p[2]), wp.max(r[3], p[3])
                    )
    return r


@wp.kernel(enable_backward=False)
def packet_kernel(
    side: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    cells: Cells,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    starts: wp.array(dtype=wp.vec3d),
    points: wp.array(dtype=wp.vec4f),
    stamps: wp.array(dtype=wp.int32),
    bits: ShadowBits,
    queue: Queue,
    tests: wp.array(dtype=wp.int64),
):
    """One packet of ``side`` x ``side`` pixels a thread, through all slices between its hit points and the light.

    Mailboxing: a triangle is tested in the first slice that offers it, against all rays of the packet.
    """
    packet = wp.tid()
    grid = cells.grid[0]
    res = grid.res
    light = lights[bits.light]
    end = to_grid(grid, to_float64(light))
    box = packet_box(packet, side, camera)
    low = wp.vec3d(NEVER, NEVER, NEVER)
    high = -low
    size = wp.float32(0.0)
    for y in range(box[1], box[3] + 1):
        for x in range(box[0], box[2] + 1):
            h = entry(points, y * camera.width + x)
            if wp.cast(h[3], wp.int32) >= 0:
                low = wp.min(low, starts[y * camera.width + x])
                high = wp.max(high, starts[y * camera.width + x])
                size = wp.max(size, largest(wp.vec3f(h[0], h[1], h[2])))
    if low[0] > high[0]:
        return
    way = wp.float64(0.5) * (low + high) - end
    axis = wp.int32(0)
    if wp.abs(way[1]) > wp.abs(way[0]):
        axis = 1
    if wp.abs(way[2]) > wp.abs(way[axis]):
        axis = 2
    u_axis = (axis + 1) % 3
    v_axis = (axis + 2) % 3
    first = cell_of(wp.min(low[axis], end[axis]) - grid.slack, res[axis])
    last = cell_of(wp.max(high[axis], end[axis]) + grid.slack, res[axis])
    for slice in range(first, last + 1):
        r = slice_rectangle(
            box,
            camera.width,
            axis,
            wp.float64(slice) - grid.slack,
            wp.float64(slice + 1) + grid.slack,
            end,
            starts,
            points,
            bits,
        )
        us = wp.vec2i(0, -1)
        vs = wp.vec2i(0, -1)
        if r[0] <= r[2]:
            us = cells_within(res[u_axis], r[0], r[2], grid.slack)
            vs = cells_within(res[v_axis], r[1], r[3], grid.slack)
        for v in range(vs[0], vs[1] + 1):
            for u in range(us[0], us[1] + 1):
                cell = cell_at(res, axis, slice, u, v)
                for m in range(entry(cells.begin, cell), entry(cells.end, cell)):
                    i = entry(cells.members, m)
                    if entry(stamps, i) != packet + 1:
                        stamps[i] = packet + 1
                        corners = corners_at(mesh, i)
                        occluder = Occluder()
                        occluder.i = i
                        reach = wp.max(largest(corners.a), wp.max(largest(corners.b), largest(corners.c)))
                        occluder.bound = sign_bound(wp.max(size, reach))
                        occluder.sure = occluder.bound
                        if wp.static(effects.alpha):
                            if alpha.masked[i] != wp.uint8(0):
                                occluder.sure = wp.INF
                        occluder = set_planes(occluder, light, corners)
                        for y in range(box[1], box[3] + 1):
                            for x in range(box[0], box[2] + 1):
                                h = entry(points, y * camera.width + x)
                                if wp.cast(h[3], wp.int32) >= 0:
                                    verdict = float32_verdict(h, occluder)
                                    tests[1 + bits.light] = tests[1 + bits.light] + wp.int64(1)
                                    if verdict != NO:
                                        set_bit_or_queue(bits, queue, verdict, i, h)
