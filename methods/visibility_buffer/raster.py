"""The visibility buffer: triangles rasterised at pixel centres, the nearest hit of a pixel stored in a 64-bit word.

Edge functions and words are those of :mod:`..streams.camera.pixels`: what float32 leaves undecided is queued for float64.

Larger triangles are rasterised in tiles of 8 x 8 pixels, or texels of a light's map, so that many threads take one triangle.
One whose box is large is put into a list (``Queue.large``), and the tiles of its box into groups of 32 (``Queue.items``). A
second kernel tests every tile against the triangle, and a third one rasterises the tiles that are left (``Queue.chunks``).
This is the hierarchy of software rasterisers (Laine and Karras 2011) in two levels.

    large  (triangle and face << 24, first column and last << 16, first row and last << 16, bits of a bound)
    items  (place in ``large``, first tile, bits of a depth, 0)
    chunks  (place in ``large``, column of the tile and its row << 16)
"""

import warp as wp

from ...harness.frame.alpha import Alpha
from ...harness.frame.geometry import Camera
from ..common.reads import direction_at
from ..exact.triangle import spare_bits
from ..gpu.entries import entry, set_entry
from ..gpu.reserve import next_number, reserve
from ..streams.camera.pixels import Candidate, is_outside, sign_bound, test_pixel_or_queue
from ..streams.camera.stream import store_candidate, stored_candidate, stored_planes
from ..streams.queues import CHUNKS, ITEMS, LARGE, Queue

TILE_SHIFT, TILE_SIZE, TILE_TEXELS = wp.constant(3), wp.constant(8), wp.constant(64)
"""A tile is 8 wide and high: as the tiles of :mod:`..streams.cube.cells`, which the lights' maps use."""

GROUP = wp.constant(32)
"""Tiles of an item: the 32 lanes of the GPU's warp test one each."""

INDEX_BITS = wp.constant(24)


@wp.struct
class Larger:
    """A triangle of the list. face: of a light's cube; box: first column and row, last column and row; bound: of the signs
    of its planes.
    """

    i: wp.int32
    face: wp.int32
    box: wp.vec4i
    bound: wp.float32


@wp.func
def queue_large(queue: Queue, i: wp.int32, face: wp.int32, box: wp.vec4i, bound: wp.float32) -> wp.int32:
    """Put a triangle into the list; its place there."""
    place = next_number(queue.counts, LARGE)
    if place < queue.large.shape[0]:
        columns = box[0] | (box[2] << 16)
        rows = box[1] | (box[3] << 16)
        work = wp.vec4i(i | (face << INDEX_BITS), columns, rows, wp.cast(bound, wp.int32))
        set_entry(queue.large, place, work)
    return place


@wp.func
def larger_at(queue: Queue, place: wp.int32) -> Larger:
    work = entry(queue.large, place)
    found = Larger()
    found.i = work[0] & 0xFFFFFF
    found.face = work[0] >> INDEX_BITS
    found.box = wp.vec4i(work[1] & 65535, work[2] & 65535, work[1] >> 16, work[2] >> 16)
    found.bound = wp.cast(work[3], wp.float32)
    return found


@wp.func
def tiles_along(first: wp.int32, last: wp.int32) -> wp.int32:
    """Tiles that columns, or rows, ``first`` to ``last`` reach over."""
    return (last >> TILE_SHIFT) - (first >> TILE_SHIFT) + 1


@wp.func
def queue_groups(queue: Queue, place: wp.int32, box: wp.vec4i, depth: wp.float32):
    """Queue the tiles of the box at a place of the list, in groups of 32."""
    groups = (tiles_along(box[0], box[2]) * tiles_along(box[1], box[3]) + GROUP - 1) // GROUP
    at = reserve(queue.counts, ITEMS, groups)
    for g in range(groups):
        if at + g < queue.items.shape[0]:
            set_entry(queue.items, at + g, wp.vec4i(place, g * GROUP, wp.cast(depth, wp.int32), 0))


@wp.func
def item_tile(box: wp.vec4i, k: wp.int32) -> wp.vec2i:
    """Column and row of the k-th tile of a box; (-1, -1) beyond the last."""
    across = tiles_along(box[0], box[2])
    down = wp.int32(wp.uint32(k) // wp.uint32(across))
    if down >= tiles_along(box[1], box[3]):
        return wp.vec2i(-1, -1)
    return wp.vec2i((box[0] >> TILE_SHIFT) + k - down * across, (box[1] >> TILE_SHIFT) + down)


@wp.func
def tile_box(box: wp.vec4i, tile: wp.vec2i) -> wp.vec4i:
    """The part of a box that lies in a tile."""
    x = tile[0] << TILE_SHIFT
    y = tile[1] << TILE_SHIFT
    return wp.vec4i(
        wp.max(box[0], x), wp.max(box[1], y), wp.min(box[2], x + TILE_SIZE - 1), wp.min(box[3], y + TILE_SIZE - 1)
    )


@wp.func
def queue_tile(queue: Queue, large: wp.int32, tile: wp.vec2i):
    """Queue a tile that is to be rasterised."""
    place = next_number(queue.counts, CHUNKS)
    if place < queue.chunks.shape[0]:
        set_entry(queue.chunks, place, wp.vec2i(large, tile[0] | (tile[1] << 16)))


@wp.func
def queued_tile(chunk: wp.vec2i) -> wp.vec2i:
    """Column and row of a queued tile."""
    return wp.vec2i(chunk[1] & 65535, chunk[1] >> 16)


@wp.func
def is_in(box: wp.vec4i, x: wp.int32, y: wp.int32) -> wp.bool:
    return x >= box[0] and x <= box[2] and y >= box[1] and y <= box[3]


@wp.func
def queue_tiles(queue: Queue, box: wp.vec4i, candidate: Candidate, camera: Camera):
    """Queue a triangle's tiles of pixels, for :func:`..streams.camera.stream.make_stream_kernel`."""
    store_candidate(queue, candidate, wp.vec3f())
    queue_groups(queue, queue_large(queue, candidate.i, 0, box, 0.0), box, 0.0)


@wp.kernel(enable_backward=False, grid_stride=False)
def split_kernel(threads: wp.int32, lanes: wp.int32, camera: Camera, queue: Queue):
    """Tiles of larger triangles, ``lanes`` threads per item: tiles outside an edge plane are not queued."""
    item = wp.tid() // lanes
    stop = wp.min(queue.counts[ITEMS], queue.items.shape[0])
    bound = sign_bound(camera.tangents)
    while item < stop:
        group = entry(queue.items, item)
        item += threads // lanes
        if group[0] < queue.large.shape[0]:
            large = larger_at(queue, group[0])
            planes, _ = stored_planes(queue, large.i)
            k = wp.tid() % lanes
            while k < GROUP:
                tile = item_tile(large.box, group[1] + k)
                k += lanes
                if tile[0] >= 0:
                    if not is_outside(planes, bound, camera, tile_box(large.box, tile)):
                        queue_tile(queue, group[0], tile)


@wp.kernel(enable_backward=False, grid_stride=False)
def tile_kernel(
    threads: wp.int32, lanes: wp.int32, camera: Camera, alpha: Alpha, nearest: wp.array(dtype=wp.uint64), queue: Queue
):
    """Pixels of queued tiles, ``lanes`` threads per tile."""
    at = wp.tid() // lanes
    stop = wp.min(queue.counts[CHUNKS], queue.chunks.shape[0])
    spare = spare_bits(queue.depths.shape[0])
    bound = sign_bound(camera.tangents)
    while at < stop:
        chunk = entry(queue.chunks, at)
        at += threads // lanes
        if chunk[0] < queue.large.shape[0]:
            large = larger_at(queue, chunk[0])
            tile = queued_tile(chunk)
            box = tile_box(large.box, tile)
            planes, _ = stored_planes(queue, large.i)
            candidate = stored_candidate(queue, large.i, planes, spare, bound, alpha)
            k = wp.tid() % lanes
            while k < TILE_TEXELS:
                x = (tile[0] << TILE_SHIFT) + k % TILE_SIZE
                y = (tile[1] << TILE_SHIFT) + k // TILE_SIZE
                k += lanes
                if is_in(box, x, y):
                    pixel = y * camera.width + x
                    test_pixel_or_queue(nearest, queue, pixel, candidate, direction_at(camera, x, y))
