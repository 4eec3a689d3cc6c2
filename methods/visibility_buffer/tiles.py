"""Larger triangles in tiles of 8 x 8 pixels or texels, so that many threads rasterise one triangle.

A triangle whose box is large is put into a list (``Queue.large``), and the tiles of its box into groups of 32
(``Queue.items``). A second kernel tests every tile against the triangle, and a third one rasterises the tiles that are left
(``Queue.chunks``). This is the hierarchy of software rasterisers (Laine and Karras 2011) in two levels.

    large  (triangle and face << 24, first column and last << 16, first row and last << 16, bits of a bound)
    items  (place in ``large``, first tile, bits of a depth, 0)
    chunks  (place in ``large``, column of the tile and its row << 16)
"""

import warp as wp

from ..gpu.entries import set_entry
from ..gpu.reserve import next_number, reserve
from ..streams.queues import CHUNKS, ITEMS, LARGE, Queue

TILE_SHIFT = wp.constant(3)
"""A tile is 8 wide and high: as the tiles of :mod:`..streams.cube.farthest`, which the lights' maps use."""

TILE_SIZE = wp.constant(8)

TILE_TEXELS = wp.constant(64)

GROUP = wp.constant(32)
"""Tiles of an item: the 32 lanes of the GPU's warp test one each."""

INDEX_BITS = wp.constant(24)


@wp.func
def tiles_across(columns: wp.int32) -> wp.int32:
    """Tiles that first column | last << 16 reach over; rows likewise."""
    return (columns >> 19) - ((columns & 65535) >> TILE_SHIFT) + 1


@wp.func
def queue_large(queue: Queue, i: wp.int32, face: wp.int32, box: wp.vec4i, bound: wp.float32) -> wp.int32:
    """Put a triangle's box (first column and row, last column and row) into ``large``; its place there."""
    place = next_number(queue.counts, LARGE)
    if place < queue.large.shape[0]:
        columns = box[0] | (box[2] << 16)
        rows = box[1] | (box[3] << 16)
        work = wp.vec4i(i | (face << INDEX_BITS), columns, rows, wp.cast(bound, wp.int32))
        set_entry(queue.large, place, work)
    return place


@wp.func
def queue_groups(queue: Queue, place: wp.int32, box: wp.vec4i, depth: wp.float32):
    """Queue the tiles of the box at a place of ``large``, in groups of 32."""
    tiles = tiles_across(box[0] | (box[2] << 16)) * tiles_across(box[1] | (box[3] << 16))
    groups = (tiles + GROUP - 1) // GROUP
    at = reserve(queue.counts, ITEMS, groups)
    for g in range(groups):
        if at + g < queue.items.shape[0]:
            set_entry(queue.items, at + g, wp.vec4i(place, g * GROUP, wp.cast(depth, wp.int32), 0))


@wp.func
def queued_triangle(work: wp.vec4i) -> wp.int32:
    return work[0] & 0xFFFFFF


@wp.func
def queued_face(work: wp.vec4i) -> wp.int32:
    return work[0] >> INDEX_BITS


@wp.func
def queued_box(work: wp.vec4i) -> wp.vec4i:
    """First column and row, last column and row of a queued triangle."""
    return wp.vec4i(work[1] & 65535, work[2] & 65535, work[1] >> 16, work[2] >> 16)


@wp.func
def item_tile(work: wp.vec4i, k: wp.int32) -> wp.vec2i:
    """Column and row of the k-th tile of a queued triangle; (-1, -1) beyond the last."""
    across = tiles_across(work[1])
    down = wp.int32(wp.uint32(k) // wp.uint32(across))
    if down >= tiles_across(work[2]):
        return wp.vec2i(-1, -1)
    return wp.vec2i(((work[1] & 65535) >> TILE_SHIFT) + k - down * across, ((work[2] & 65535) >> TILE_SHIFT) + down)


@wp.func
def tile_box(work: wp.vec4i, tile: wp.vec2i) -> wp.vec4i:
    """The part of a queued triangle's box that lies in a tile."""
    box = queued_box(work)
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
def held_large(queue: Queue) -> wp.int32:
    return wp.min(queue.counts[LARGE], queue.large.shape[0])


@wp.func
def held_items(queue: Queue) -> wp.int32:
    return wp.min(queue.counts[ITEMS], queue.items.shape[0])


@wp.func
def held_chunks(queue: Queue) -> wp.int32:
    return wp.min(queue.counts[CHUNKS], queue.chunks.shape[0])
