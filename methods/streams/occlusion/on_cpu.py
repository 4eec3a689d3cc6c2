"""Shadow rays on a CPU: a thread takes a block of triangles, and tests all their rays."""

from __future__ import annotations

from typing import Any

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Mesh
from ...common.reads import corners_at
from ...gpu.bits import lowest_bit, without_lowest_bit
from ...gpu.entries import entry
from ..camera.pixels import sure_of
from ..cube.cells import RayCells, all_rays_end_before, on_face
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
    sides_on_face,
)
from ..cube.lights import Cube, Light, cube_of_light, position_of
from ..cube.rectangle import BINS, cells_of, faces_of, last_row, max_coordinate_of
from ..cube.spacing import BIN_SLACK
from ..eight import EIGHT, Window, boxes_met, boxes_of_eight, on_cpu
from ..queues import BLOCK_DIM, Queue, Share, triangle_of
from ..rays.sort import rays_in_box, span_of
from .closed import turned_away
from .planes import Occluder, ShadowBits, bound_of, occluder_of, occludes_none, queue_if_lit, set_shadowed
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


@wp.func_native(
    on_cpu(
        """
typedef float entries __attribute__((ext_vector_type(32), aligned(4)));
entries h = *(const entries*)(rays.data + at);
floats x = __builtin_shufflevector(h, h, 0, 4, 8, 12, 16, 20, 24, 28);
floats y = __builtin_shufflevector(h, h, 1, 5, 9, 13, 17, 21, 25, 29);
floats z = __builtin_shufflevector(h, h, 2, 6, 10, 14, 18, 22, 26, 30);
auto value = [&](wp::vec_t<4, float> p) { return p[0] * x + (p[1] * y + (p[2] * z + p[3])); };
floats e0 = value(o.e0), e1 = value(o.e1), e2 = value(o.e2), side = value(o.plane);
auto outside = (e0 < -o.bound) | (e1 < -o.bound) | (e2 < -o.bound) | (side > o.bound);
auto inside = (e0 > o.sure) & (e1 > o.sure) & (e2 > o.sure) & (side < -o.sure);
return packed(inside, number) | packed(~(inside | outside), number) << 8;
"""
    )
)
def rays_found(rays: wp.array(dtype=wp.vec4f), at: wp.int32, number: wp.int32, o: Occluder) -> wp.uint32:
    """Of the rays from ``at`` on, ``number`` or at most eight: a bit for each certain hit, and eight places higher one for
    each undecided ray (:func:`.planes.certain`).
    """


@wp.func
def test_triangle(
    i: wp.int32,
    face: wp.int32,
    bins: wp.vec4f,
    depth: wp.float32,
    inline_cells: wp.int32,
    inline_rays: wp.int32,
    light: Light,
    cells: Any,
    mesh: Mesh,
    alpha: Alpha,
    bits: Any,
    queue: Queue,
):
    """Test the rays on a face against a triangle that lies between ``bins`` there and is nowhere nearer than ``depth``."""
    row = last_row(cells.table)
    along = cells_of(row)
    cube = cube_of_light(light)
    corners = corners_at(mesh, i)
    f = corners_on(in_cube_space(corners, cube), face)
    extent = extent_with_rays(cube, corners, row)
    if bins[0] == -wp.INF and beyond_face(f, depth_slack(extent, cube)):
        return
    box = wp.vec4i(
        first_cell(cells, 0, face, bins[0], along),
        first_cell(cells, 1, face, bins[1], along),
        last_cell(cells, 0, face, bins[2], along),
        last_cell(cells, 1, face, bins[3], along),
    )
    if all_rays_end_before(depth, cells.farthest, face, box, along):
        return
    rows = box[3] - box[1] + 1
    number = wp.int32(MANY)
    if (box[2] - box[0] + 1) * rows <= inline_cells and rows <= INLINE_ROWS:
        number = rays_in_box(cells.offset, face, box, along)
    if number == 0:
        return
    large = number > inline_rays
    position = position_of(light)
    bound = bound_of(row, corners)
    occluder = occluder_of(i, bound, sure_of(i, bound, alpha), position, corners, large)
    if occludes_none(occluder):
        return
    sides = Sides()
    if large:
        r = entry(cells.table, face)
        sides = sides_on_face(on_bins(f, extent, r), position, cube, face, corners, r)
    y = wp.int32(box[1])
    while y <= box[3]:
        ends = wp.vec2i(box[0], box[2])
        if large:
            ends = cells_of_row(sides, face, y, box[0], box[2], along, cells)
        span = wp.vec2i(0, 0)
        if ends[1] >= ends[0]:
            span = span_of(cells.offset, face, ends[0], ends[1], y, along)
        at = wp.int32(span[0])
        while at < span[1]:
            found = rays_found(cells.rays, at, span[1] - at, occluder)
            while found != wp.uint32(0):
                k = lowest_bit(found)
                found = without_lowest_bit(found)
                pixel = wp.cast(entry(cells.rays, at + (k & 7))[3], wp.int32)
                if k < EIGHT:
                    set_shadowed(bits, pixel, i)
                elif entry(bits.triangle, pixel) != i:
                    queue_if_lit(bits, queue, i, pixel)
            at += EIGHT
        y += 1


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
    start = triangle_of(BLOCK_DIM * wp.tid(), share)
    end = wp.min(start + BLOCK_DIM, share.triangles)
    row = last_row(cells.table)
    size = wp.vec2f(wp.float32(BINS), wp.float32(BINS))
    faces = faces_of(row)
    while faces != wp.uint32(0):
        face = lowest_bit(faces)
        faces = without_lowest_bit(faces)
        window = window_of(cube_of_light(light), face, entry(cells.table, face))
        first = wp.int32(start)
        while first < end:
            boxes = boxes_of_eight(mesh, first, 0.125 * max_coordinate_of(row), window)
            met = boxes_met(boxes, size, False, end - first)
            while met != wp.uint32(0):
                k = lowest_bit(met)
                met = without_lowest_bit(met)
                i = first + k
                flags = entry(mesh.valid, i)
                wanted = flags != wp.uint8(0)
                if wp.static(effects.closed):
                    wanted = wanted and not turned_away(flags, position_of(light), corners_at(mesh, i))
                if wanted:
                    bins = wp.vec4f(boxes[0, k], boxes[1, k], boxes[2, k], boxes[3, k])
                    depth = boxes[4, k]
                    test_triangle(
                        i, face, bins, depth, inline_cells, inline_rays, light, cells, mesh, alpha, bits, queue
                    )
            first += EIGHT
