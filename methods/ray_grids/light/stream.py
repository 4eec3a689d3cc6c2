"""Shadow rays: triangles streamed over the rays in the cells of the light's cube.

Which cells a triangle covers is reckoned relative to the scene's middle in float32, with a pad that covers its rounding
(:mod:`.light.cells`); rays are placed in float64. How a ray is tested is in :mod:`.light.rays`.
"""

from __future__ import annotations

import functools

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.specialise import effects
from ...common.entries import entry, set_entry
from ...common.reserve import number_in
from ...common.triangle import U32, total
from ..aim import FACES, Cube
from ..cube import on_face
from ..queues import LARGE, triangle_of
from .bins import cells_of, span_of
from .cells import beyond_face, cells_of_row, cube_space, flat_box, on_cells, sides_of_flat, sides_of_planes
from .rays import bound_of, occluder_of, set_record, shade_box, shade_row
from .reach import all_end_before

INLINE_ROWS = wp.constant(16)
"""A triangle of more rows of cells is queued: its thread would look them up one after the other."""

MANY = wp.constant(2147483647)
"""Rays of a box that are not looked up: more than are tested here."""


@functools.cache
def make_stream_kernel(queued: bool) -> wp.Kernel:
    """One thread a triangle: few rays are tested here; more are queued, or tested here all the same (CPU).

    A large triangle is (triangle, face, first cell and last << 16, first row and last << 16).
    """

    # 64 registers: a triangle waits for memory more than it reckons, so more of them at a time pays.
    @wp.kernel(enable_backward=False, grid_stride=False, module="unique", cuda_max_registers=64)
    def stream_kernel(
        triangle_count: wp.int32,
        share: wp.int32,
        shares: wp.int32,
        index: wp.int32,
        inline_cells: wp.int32,
        inline_rays: wp.int32,
        lights: wp.array(dtype=wp.vec3f),
        cubes: wp.array(dtype=Cube),
        table: wp.array(dtype=wp.vec4f),
        points: wp.array(dtype=wp.vec3f),
        triangles: wp.array(dtype=wp.vec3i),
        valid: wp.array(dtype=wp.uint8),
        offset: wp.array(dtype=wp.int32),
        rays: wp.array(dtype=wp.vec4f),
        farthest: wp.array(dtype=wp.int32),
        triangle: wp.array(dtype=wp.int32),
        alpha: Alpha,
        visibility: wp.array2d(dtype=wp.uint8),
        counts: wp.array(dtype=wp.int32),
        records: wp.array2d(dtype=wp.vec4f),
        large: wp.array(dtype=wp.vec4i),
        doubts: wp.array(dtype=wp.vec2i),
    ):
        i = triangle_of(wp.tid(), share, shares)
        if i >= triangle_count:
            return
        # Asked for together, no branch between: what is invalid has corners, too, but no face is large enough for it.
        smallest = wp.where(entry(valid, i) != wp.uint8(0), wp.float32(0.0), wp.INF)
        corners = entry(triangles, i)
        a = entry(points, corners[0])
        b = entry(points, corners[1])
        c = entry(points, corners[2])
        cube = cubes[index]
        cells = cells_of(table)
        qa = cube_space(a, cube)
        qb = cube_space(b, cube)
        qc = cube_space(c, cube)
        reach = wp.max(total(a - cube.middle), wp.max(total(b - cube.middle), total(c - cube.middle)))
        slack = 32.0 * U32 * (reach + cube.distance)
        bound = bound_of(table, a, b, c)
        sure = bound
        if wp.static(effects.alpha):
            if alpha.masked[i] != wp.uint8(0):
                sure = wp.INF
        # What is tested here is tested after the loop, by all lanes at once whichever their faces. Few triangles have
        # little to do on two faces: the second is queued.
        here = wp.int32(-1)
        box_here = wp.vec4i()
        queued_too = wp.bool(False)
        face = wp.int32(-1)
        while face < FACES - 1:
            face += 1
            r = entry(table, face)
            if r[2] > smallest:
                fa = on_face(qa, face)
                fb = on_face(qb, face)
                fc = on_face(qc, face)
                if not beyond_face(fa, fb, fc, slack):
                    flat = on_cells(fa, fb, fc, reach, r)
                    box = wp.vec4i(0, 0, cells - 1, cells - 1)
                    if flat.known:
                        box = flat_box(flat, cells)
                    number = wp.int32(0)
                    # Depths of corners are known to 8 u reach, and receivers' to u of theirs.
                    least = wp.min(fa[0], wp.min(fb[0], fc[0])) - slack
                    if box[2] >= box[0] and not all_end_before(least, farthest, face, box, cells):
                        number = wp.int32(MANY)
                        rows = box[3] - box[1] + 1
                        if (box[2] - box[0] + 1) * rows <= inline_cells and rows <= INLINE_ROWS:
                            number = wp.int32(0)
                            for y in range(box[1], box[3] + 1):
                                span = span_of(offset, face, box[0], box[2], y, cells)
                                number += span[1] - span[0]
                    if number > 0:
                        if number <= inline_rays and here < 0:
                            here = face
                            box_here = box
                        else:
                            if wp.static(queued):
                                queued_too = True
                                place = number_in(counts, LARGE)
                                if place < large.shape[0]:
                                    work = wp.vec4i(i, face, box[0] | (box[2] << 16), box[1] | (box[3] << 16))
                                    set_entry(large, place, work)
                            else:
                                if flat.known:
                                    sides = sides_of_flat(flat)
                                else:
                                    sides = sides_of_planes(lights[index], cube, face, a, b, c, r, cells)
                                occluder = occluder_of(lights[index], a, b, c)
                                for y in range(box[1], box[3] + 1):
                                    ends = cells_of_row(sides, y, box[0], box[2])
                                    shade_row(
                                        i, face, ends[0], ends[1], y, cells, index, occluder, bound, sure, offset, rays,
                                        triangle, visibility, counts, doubts,
                                    )  # fmt: skip
        if here >= 0 or queued_too:
            # Corners are read again: kept, they would take the registers of the loop.
            again = entry(triangles, i)
            occluder = occluder_of(
                lights[index], entry(points, again[0]), entry(points, again[1]), entry(points, again[2])
            )
            if queued_too:
                set_record(records, i, occluder)
            if here >= 0:
                shade_box(
                    i, here, box_here, cells, index, occluder, bound, sure, offset, rays, triangle, visibility, counts,
                    doubts,
                )  # fmt: skip

    return stream_kernel
