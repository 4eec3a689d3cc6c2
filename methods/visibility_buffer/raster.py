"""The visibility buffer: triangles rasterised at pixel centres, the nearest hit of a pixel stored in a 64-bit word.

Edge functions and words are those of :mod:`..streams.camera.pixels`: what float32 leaves undecided is queued for
float64.
"""

from __future__ import annotations

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.effects.specialise import effects
from ...harness.frame.geometry import Camera, Corners, Mesh
from ..exact.triangle import spare_bits
from ..gpu.entries import entry, entry_now, entry_of_four, set_entry_of_four
from ..streams.camera.pixels import (
    Candidate,
    Planes,
    edge_planes,
    inverse_depth,
    sign_bound,
    test_box,
    test_pixel_or_queue,
)
from ..streams.camera.stream import box_of
from ..streams.queues import Queue, Share, triangle_of
from ..streams.reads import corners_at, direction_at
from .tiles import (
    GROUP,
    TILE_SHIFT,
    TILE_SIZE,
    TILE_TEXELS,
    held_chunks,
    held_items,
    is_in,
    item_tile,
    queue_groups,
    queue_large,
    queue_tile,
    queued_tile,
    queued_triangle,
    tile_box,
)


@wp.func
def candidate_of(
    i: wp.int32, o: wp.vec3f, corners: Corners, camera: Camera, triangles: wp.int32
) -> Candidate:
    """A triangle as pixels are tested against it; without holes."""
    candidate = Candidate()
    candidate.i = i
    candidate.spare = spare_bits(triangles)
    candidate.bound = sign_bound(camera.tangents)
    candidate.sure = candidate.bound
    candidate.planes = edge_planes(o, corners)
    candidate.m = inverse_depth(o, corners)
    return candidate


@wp.func
def store_candidate(queue: Queue, candidate: Candidate):
    """Store what :func:`stored_candidate` reads. The fourth words are free."""
    n0 = candidate.planes.n0
    n1 = candidate.planes.n1
    n2 = candidate.planes.n2
    set_entry_of_four(queue.records, candidate.i, 0, wp.vec4f(n0[0], n0[1], n0[2], 0.0))
    set_entry_of_four(queue.records, candidate.i, 1, wp.vec4f(n1[0], n1[1], n1[2], 0.0))
    set_entry_of_four(queue.records, candidate.i, 2, wp.vec4f(n2[0], n2[1], n2[2], 0.0))
    queue.depths[candidate.i] = candidate.m


@wp.func
def stored_planes(queue: Queue, i: wp.int32) -> Planes:
    r0 = entry_of_four(queue.records, i, 0)
    r1 = entry_of_four(queue.records, i, 1)
    r2 = entry_of_four(queue.records, i, 2)
    planes = Planes()
    planes.n0 = wp.vec3f(r0[0], r0[1], r0[2])
    planes.n1 = wp.vec3f(r1[0], r1[1], r1[2])
    planes.n2 = wp.vec3f(r2[0], r2[1], r2[2])
    return planes


@wp.func
def stored_candidate(queue: Queue, i: wp.int32, camera: Camera) -> Candidate:
    """A queued triangle as :func:`candidate_of` made it."""
    candidate = Candidate()
    candidate.i = i
    candidate.spare = spare_bits(queue.depths.shape[0])
    candidate.bound = sign_bound(camera.tangents)
    candidate.sure = candidate.bound
    candidate.planes = stored_planes(queue, i)
    candidate.m = entry_now(queue.depths, i)
    return candidate


@wp.func
def is_outside(n: wp.vec3f, bound: wp.float32, camera: Camera, box: wp.vec4i) -> wp.bool:
    """Whether all pixels of a box lie certainly outside an edge plane.

    Directions are sums of a column's and a row's part, and each part is a multiple of an axis plus another, but for the
    rounding of the tables. So the largest edge function of the box is that of a corner; four bounds cover all rounding, as
    in :func:`..streams.camera.stream.plane_line`. A plane that is not a number leaves nothing out.
    """
    x = wp.max(wp.dot(n, entry(camera.column, box[0])), wp.dot(n, entry(camera.column, box[2])))
    y = wp.max(wp.dot(n, entry(camera.row, box[1])), wp.dot(n, entry(camera.row, box[3])))
    return x + y < -4.0 * bound


@wp.kernel(enable_backward=False, grid_stride=False)
def raster_kernel(
    share: Share,
    inline_pixels: wp.int32,
    camera: Camera,
    mesh: Mesh,
    alpha: Alpha,
    nearest: wp.array(dtype=wp.uint64),
    exact_path: wp.array(dtype=wp.uint8),
    queue: Queue,
):
    """One thread per triangle: a small one is rasterised, a larger one is queued."""
    i = triangle_of(wp.tid(), share)
    if i >= share.triangles:
        return
    # All loads before the first branch, valid or not: they wait for memory together.
    counted = entry(mesh.valid, i) != wp.uint8(0)
    o = entry(camera.eye, 0)
    corners = corners_at(mesh, i)
    box = box_of(corners, o, camera)
    if not counted or box[2] < box[0] or box[3] < box[1]:
        return
    candidate = candidate_of(i, o, corners, camera, share.triangles)
    exact_path[i] = wp.uint8(not candidate.planes.steep)
    if wp.static(effects.alpha):
        if alpha.masked[i] != wp.uint8(0):
            candidate.sure = wp.INF
    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= inline_pixels:
        test_box(nearest, queue, box, candidate, camera)
        return
    store_candidate(queue, candidate)
    queue_groups(queue, queue_large(queue, i, 0, box, 0.0), box, 0.0)


@wp.kernel(enable_backward=False, grid_stride=False)
def split_kernel(threads: wp.int32, lanes: wp.int32, camera: Camera, queue: Queue):
    """Tiles of larger triangles, ``lanes`` threads per item: tiles outside an edge plane are not queued."""
    item = wp.tid() // lanes
    stop = held_items(queue)
    bound = sign_bound(camera.tangents)
    while item < stop:
        group = entry(queue.items, item)
        item += threads // lanes
        if group[0] < queue.large.shape[0]:
            work = entry(queue.large, group[0])
            planes = stored_planes(queue, queued_triangle(work))
            k = wp.tid() % lanes
            while k < GROUP:
                tile = item_tile(work, group[1] + k)
                k += lanes
                if tile[0] >= 0:
                    box = tile_box(work, tile)
                    if not (
                        is_outside(planes.n0, bound, camera, box)
                        or is_outside(planes.n1, bound, camera, box)
                        or is_outside(planes.n2, bound, camera, box)
                    ):
                        queue_tile(queue, group[0], tile)


@wp.kernel(enable_backward=False, grid_stride=False)
def tile_kernel(
    threads: wp.int32,
    lanes: wp.int32,
    camera: Camera,
    alpha: Alpha,
    nearest: wp.array(dtype=wp.uint64),
    queue: Queue,
):
    """Pixels of queued tiles, ``lanes`` threads per tile."""
    at = wp.tid() // lanes
    stop = held_chunks(queue)
    while at < stop:
        chunk = entry(queue.chunks, at)
        at += threads // lanes
        if chunk[0] < queue.large.shape[0]:
            work = entry(queue.large, chunk[0])
            tile = queued_tile(chunk)
            box = tile_box(work, tile)
            candidate = stored_candidate(queue, queued_triangle(work), camera)
            if wp.static(effects.alpha):
                if alpha.masked[candidate.i] != wp.uint8(0):
                    candidate.sure = wp.INF
            k = wp.tid() % lanes
            while k < TILE_TEXELS:
                x = (tile[0] << TILE_SHIFT) + k % TILE_SIZE
                y = (tile[1] << TILE_SHIFT) + k // TILE_SIZE
                k += lanes
                if is_in(box, x, y):
                    pixel = y * camera.width + x
                    test_pixel_or_queue(nearest, queue, pixel, candidate, direction_at(camera, x, y))
