"""Shadow rays of larger triangles: rows of blocks, blocks, items of rays; and the pairs left to float64."""

from __future__ import annotations

import warp as wp

from ...harness.alpha import Alpha
from ...harness.specialise import effects
from ..common.alpha import shadow_counts
from ..common.reserve import reserve
from ..common.triangle import largest, occludes, total, weld_of
from .light_bins import CELLS, Cube, cell_index, on_face
from .light_cells import cube_space, on_cells, row_cells
from .light_stream import FEW_RAYS, Occluder, shade, span_of
from .queue import BLOCKS, DOUBTS, ITEMS, STRIPS
from .spans import Flat


@wp.func
def queue_rays(
    i: wp.int32,
    first: wp.int32,
    stop: wp.int32,
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
):
    """Queue rays first..stop for triangle i, 32 an item."""
    number = (stop - first + 31) // 32
    place = reserve(counts, ITEMS, number)
    for k in range(number):
        if place + k < items.shape[0]:
            items[place + k] = wp.vec4i(i, first + 32 * k, stop, 0)


@wp.func
def corner(
    points: wp.array(dtype=wp.vec3f), triangles: wp.array(dtype=wp.vec3i), i: wp.int32, k: wp.int32
) -> wp.vec3f:
    return points[triangles[i][k]]


@wp.func
def flat_of(cube: Cube, face: wp.int32, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, r: wp.vec4f) -> Flat:
    reach = wp.max(total(a - cube.middle), wp.max(total(b - cube.middle), total(c - cube.middle)))
    qa = on_face(cube_space(a, cube), face)
    qb = on_face(cube_space(b, cube), face)
    return on_cells(qa, qb, on_face(cube_space(c, cube), face), reach, r)


@wp.kernel(enable_backward=False, grid_stride=False)
def strip_kernel(
    threads: wp.int32,
    index: wp.int32,
    cells: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    cubes: wp.array(dtype=Cube),
    table: wp.array(dtype=wp.vec4f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    strips: wp.array(dtype=wp.vec4i),
    counts: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec4i),
):
    """One row of blocks of a large triangle a thread: queue the blocks between its edges."""
    k = wp.tid()
    stop = wp.min(counts[STRIPS], strips.shape[0])
    cube = cubes[0]
    while k < stop:
        strip = strips[k]
        k += threads
        i = strip[0]
        face = strip[1]
        a = corner(points, triangles, i, 0)
        b = corner(points, triangles, i, 1)
        c = corner(points, triangles, i, 2)
        flat = flat_of(cube, face, a, b, c, table[face])
        y = strip[2] * CELLS
        ends = row_cells(flat, lights[index], cube, face, a, b, c, table[face], y, y + CELLS - 1, cells)
        if ends[1] >= ends[0]:
            first = ends[0] // CELLS
            number = ends[1] // CELLS - first + 1
            place = reserve(counts, BLOCKS, number)
            for j in range(number):
                if place + j < blocks.shape[0]:
                    blocks[place + j] = wp.vec4i(i, face, first + j, strip[2])


@wp.kernel(enable_backward=False, grid_stride=False)
def block_kernel(
    threads: wp.int32,
    index: wp.int32,
    cells: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    cubes: wp.array(dtype=Cube),
    table: wp.array(dtype=wp.vec4f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    offset: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.vec4i),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
):
    """Queued blocks: all their rays where they are few, else eight threads, a cell row each, cut to the triangle."""
    k = wp.tid()
    stop = wp.min(counts[BLOCKS], blocks.shape[0]) * CELLS
    cube = cubes[0]
    while k < stop:
        block = blocks[k // CELLS]
        row = k % CELLS
        k += threads
        i = block[0]
        face = block[1]
        start = cell_index(face, block[2] * CELLS, block[3] * CELLS, cells)
        first = offset[start]
        last = offset[start + CELLS * CELLS]
        if last - first <= FEW_RAYS:
            if row == 0 and last > first:
                queue_rays(i, first, last, counts, items)
        else:
            first = offset[start + row * CELLS]
            last = offset[start + row * CELLS + CELLS]
            if last > first:
                a = corner(points, triangles, i, 0)
                b = corner(points, triangles, i, 1)
                c = corner(points, triangles, i, 2)
                flat = flat_of(cube, face, a, b, c, table[face])
                y = block[3] * CELLS + row
                ends = row_cells(flat, lights[index], cube, face, a, b, c, table[face], y, y, cells)
                x0 = wp.max(ends[0], block[2] * CELLS)
                x1 = wp.min(ends[1], block[2] * CELLS + CELLS - 1)
                if x1 >= x0:
                    part = span_of(offset, face, x0, x1, y, cells)
                    if part[1] > part[0]:
                        queue_rays(i, part[0], part[1], counts, items)


@wp.kernel(enable_backward=False, grid_stride=False)
def item_kernel(
    threads: wp.int32,
    index: wp.int32,
    records: wp.array2d(dtype=wp.vec4f),
    counts: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.vec4i),
    rays: wp.array(dtype=wp.vec4f),
    pixels: wp.array(dtype=wp.int32),
    alpha: Alpha,
    visibility: wp.array2d(dtype=wp.uint8),
    doubts: wp.array(dtype=wp.vec2i),
):
    """Queued items: 32 threads each, one a ray."""
    k = wp.tid()
    stop = wp.min(counts[ITEMS], items.shape[0])
    item = k // 32
    while item < stop:
        work = items[item]
        at = work[1] + k % 32
        if at < work[2]:
            i = work[0]
            occluder = Occluder()
            occluder.e0 = records[i, 0]
            occluder.e1 = records[i, 1]
            occluder.e2 = records[i, 2]
            occluder.plane = records[i, 3]
            occluder.bound = records[i, 4][0]
            sure = occluder.bound
            if wp.static(effects.alpha):
                if alpha.masked[i] != wp.uint8(0):
                    sure = wp.INF
            shade(i, at, index, occluder, sure, rays, pixels, visibility, counts, doubts)
        item += threads // 32


@wp.kernel(enable_backward=False, grid_stride=False)
def doubt_kernel(
    threads: wp.int32,
    index: wp.int32,
    lights: wp.array(dtype=wp.vec3f),
    eye: wp.array(dtype=wp.vec3f),
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    weld: wp.array(dtype=wp.int32),
    hit: wp.array(dtype=wp.vec3d),
    counts: wp.array(dtype=wp.int32),
    doubts: wp.array(dtype=wp.vec2i),
    alpha: Alpha,
    visibility: wp.array2d(dtype=wp.uint8),
):
    """Pairs that float32 could not decide."""
    k = wp.tid()
    stop = wp.min(counts[DOUBTS], doubts.shape[0])
    origin_size = wp.float64(largest(eye[0]))
    while k < stop:
        pair = doubts[k]
        k += threads
        if visibility[index, pair[1]] == wp.uint8(0):
            face = triangles[pair[0]]
            shadowed = occludes(
                hit[pair[1]], lights[index], points[face[0]], points[face[1]], points[face[2]], weld_of(weld, face),
                origin_size,
            )  # fmt: skip
            if wp.static(effects.alpha):
                if shadowed:
                    shadowed = shadow_counts(
                        alpha, pair[0], hit[pair[1]], lights[index], points[face[0]], points[face[1]],
                        points[face[2]], weld_of(weld, face), origin_size,
                    )  # fmt: skip
            if shadowed:
                visibility[index, pair[1]] = wp.uint8(1)
