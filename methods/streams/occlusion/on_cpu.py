"""Shadow rays on a CPU: a thread takes eight triangles, and tests all their rays."""

from __future__ import annotations

from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Mesh
from ...common.reads import corners_at
from ...gpu.bits import lowest_bit, without_lowest_bit
from ...gpu.entries import entry
from ..cube.cells import RayCells
from ..cube.faces import on_face
from ..cube.farthest import all_rays_end_before
from ..cube.footprint import (
    Sides,
    beyond_face,
    cells_of_row,
    corners_on,
    depth_slack,
    extent_with_rays,
    first_cell,
    in_cube_space,
    last_cell,
    on_bins,
)
from ..cube.lights import Cube, Light, cube_of_light, position_of
from ..cube.rectangle import cells_of, faces_of, last_row, max_coordinate_of
from ..cube.spacing import BIN_SLACK, BINS
from ..eight import EIGHT, Window, boxes_of_eight, rays_found
from ..queues import Queue, Share, triangle_of
from ..rays.sort import rays_in_box, span_of
from .groups import sides_on_face
from .planes import Occluder, occluder_of, occludes_none
from .ray_test import ShadowBits, queue_if_lit, set_shadowed
from .stream import INLINE_ROWS, MANY


@wp.func
def window_of(cube: Cube, face: wp.int32, r: wp.vec4f) -> Window:
    """A face of the cube, in bins; ``r``: its row of the table."""
    w = Window()
    for k in range(3):
        across = on_face(wp.vec3f(cube.forward[k], cube.right[k], cube.up[k]), face)
        for row in range(3):
            w.axes[row, k] = across[row]
    w.origin = cube.middle
    w.shift = on_face(wp.vec3f(cube.distance, 0.0, 0.0), face)
    w.low = wp.vec2f(r[0], r[1])
    w.per = wp.vec2f(r[2], r[3])
    w.slack = BIN_SLACK
    return w


@wp.func
def test_rays_of_row(
    bits: Any,
    queue: Queue,
    cells: Any,
    along: wp.int32,
    face: wp.int32,
    y: wp.int32,
    ends: wp.vec2i,
    occluder: Occluder,
):
    """Test the rays in cells ends[0]..ends[1] of a row, eight at a time; ``along``: cells along a face."""
    span = span_of(cells.offset, face, ends[0], ends[1], y, along)
    at = wp.int32(span[0])
    while at < span[1]:
        found = rays_found(cells.rays, at, span[1] - at, occluder)
        while found != wp.uint32(0):
            k = lowest_bit(found)
            found = without_lowest_bit(found)
            pixel = wp.cast(entry(cells.rays, at + (k & 7))[3], wp.int32)
            if k < EIGHT:
                set_shadowed(bits, pixel, occluder.i)
            elif entry(bits.triangle, pixel) != occluder.i:
                queue_if_lit(bits, queue, occluder.i, pixel)
        at += EIGHT


@wp.kernel(enable_backward=False, grid_stride=False)
def stream_kernel(
    share: Share,
    inline_cells: wp.int32,
    inline_rays: wp.int32,
    light: Light,
    cells: RayCells,
    mesh: Mesh,
    alpha: Alpha,
    bits: ShadowBits,
    queue: Queue,
):
    """Of a triangle with more than ``inline_rays`` the rows are cut to it."""
    first = triangle_of(EIGHT * wp.tid(), share)
    if first >= share.triangles:
        return
    row = last_row(cells.table)
    along = cells_of(row)
    cube = cube_of_light(light)
    position = position_of(light)
    n = wp.float32(BINS)
    faces = faces_of(row)
    while faces != wp.uint32(0):
        face = lowest_bit(faces)
        faces = without_lowest_bit(faces)
        r = entry(cells.table, face)
        boxes = boxes_of_eight(mesh, first, 0.125 * max_coordinate_of(row), window_of(cube, face, r))
        i = wp.int32(first)
        while i < wp.min(first + EIGHT, share.triangles):
            k = i - first
            x0 = boxes[0, k]
            y0 = boxes[1, k]
            x1 = boxes[2, k]
            y1 = boxes[3, k]
            wanted = x0 <= n and y0 <= n and x1 >= 0.0 and y1 >= 0.0 and entry(mesh.valid, i) != wp.uint8(0)
            if wanted and x0 == -wp.INF:
                corners = corners_at(mesh, i)
                slack = depth_slack(extent_with_rays(cube, corners, row), cube)
                wanted = not beyond_face(corners_on(in_cube_space(corners, cube), face), slack)
            if wanted:
                box = wp.vec4i(
                    first_cell(cells, 0, face, x0, along),
                    first_cell(cells, 1, face, y0, along),
                    last_cell(cells, 0, face, x1, along),
                    last_cell(cells, 1, face, y1, along),
                )
                rows = box[3] - box[1] + 1
                number = wp.int32(MANY)
                if all_rays_end_before(boxes[4, k], cells.farthest, face, box, along):
                    number = 0
                elif (box[2] - box[0] + 1) * rows <= inline_cells and rows <= INLINE_ROWS:
                    number = rays_in_box(cells.offset, face, box, along)
                if number > 0:
                    corners = corners_at(mesh, i)
                    holes = wp.bool(False)
                    if wp.static(effects.alpha):
                        holes = alpha.masked[i] != wp.uint8(0)
                    large = number > inline_rays
                    occluder = occluder_of(i, holes, position, corners, row, large)
                    sides = Sides()
                    if large:
                        f = corners_on(in_cube_space(corners, cube), face)
                        flat = on_bins(f, extent_with_rays(cube, corners, row), r)
                        sides = sides_on_face(flat, position, cube, face, corners, r)
                    y = wp.int32(box[1])
                    if occludes_none(occluder):
                        y = box[3] + 1
                    while y <= box[3]:
                        ends = wp.vec2i(box[0], box[2])
                        if large:
                            ends = cells_of_row(sides, face, y, box[0], box[2], along, cells)
                        if ends[1] >= ends[0]:
                            test_rays_of_row(bits, queue, cells, along, face, y, ends, occluder)
                        y += 1
            i += 1
