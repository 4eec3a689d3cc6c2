"""The visibility buffer: triangles rasterised at pixel centres, the nearest hit of a pixel stored in a 64-bit word.

Edge functions and words are those of :mod:`..streams.camera.pixels`: what float32 leaves undecided is queued for
float64.
"""

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.geometry import Camera, Mesh
from ..common.reads import corners_at, direction_at
from ..exact.triangle import spare_bits
from ..gpu.entries import entry
from ..streams.camera.pixels import candidate_of, is_outside, sign_bound, test_box, test_pixel_or_queue
from ..streams.camera.queued import store_candidate, stored_candidate, stored_planes
from ..streams.camera.stream import box_of
from ..streams.queues import Queue, Share, triangle_of
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
    candidate = candidate_of(i, o, corners, camera, alpha, share.triangles, exact_path)
    if (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= inline_pixels:
        test_box(nearest, queue, box, candidate, camera)
        return
    store_candidate(queue, candidate, wp.vec3f())
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
            planes = stored_planes(queue, queued_triangle(work)).planes
            k = wp.tid() % lanes
            while k < GROUP:
                tile = item_tile(work, group[1] + k)
                k += lanes
                if tile[0] >= 0:
                    box = tile_box(work, tile)
                    if not is_outside(planes, bound, camera, box):
                        queue_tile(queue, group[0], tile)


@wp.kernel(enable_backward=False, grid_stride=False)
def tile_kernel(
    threads: wp.int32, lanes: wp.int32, camera: Camera, alpha: Alpha, nearest: wp.array(dtype=wp.uint64), queue: Queue
):
    """Pixels of queued tiles, ``lanes`` threads per tile."""
    at = wp.tid() // lanes
    stop = held_chunks(queue)
    spare = spare_bits(queue.depths.shape[0])
    bound = sign_bound(camera.tangents)
    while at < stop:
        chunk = entry(queue.chunks, at)
        at += threads // lanes
        if chunk[0] < queue.large.shape[0]:
            work = entry(queue.large, chunk[0])
            tile = queued_tile(chunk)
            box = tile_box(work, tile)
            i = queued_triangle(work)
            candidate = stored_candidate(queue, i, stored_planes(queue, i).planes, spare, bound, alpha)
            k = wp.tid() % lanes
            while k < TILE_TEXELS:
                x = (tile[0] << TILE_SHIFT) + k % TILE_SIZE
                y = (tile[1] << TILE_SHIFT) + k // TILE_SIZE
                k += lanes
                if is_in(box, x, y):
                    pixel = y * camera.width + x
                    test_pixel_or_queue(nearest, queue, pixel, candidate, direction_at(camera, x, y))
