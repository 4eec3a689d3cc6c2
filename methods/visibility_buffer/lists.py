"""The irregular z-buffer of a light: a map whose texels hold lists of hit points.

Johnson et al. 2005; Wyman, Hoetzlein and Lefohn 2015. A texel holds the head of a linked list; the pixel of a hit point is
its place in memory. The map lies on the faces of a cube around the light (:mod:`..streams.cube.faces`).
"""

import warp as wp

from ...harness.frame.effects.specialise import effects
from ..common.pixels import tile_pixel
from ..gpu.entries import entry
from ..streams.cube.cells import RayCells
from ..streams.cube.farthest import raise_farthest, tile_index
from ..streams.cube.rectangle import cells_in_use, face_rectangle, set_table
from ..streams.occlusion.planes import Occluder
from ..streams.occlusion.ray_test import ShadowBits, test_ray
from ..streams.queues import Queue
from ..streams.rays.hit_points import PrimaryHits, has_hit
from ..streams.rays.sort import cell_of
from .tiles import TILE_SIZE, TILE_TEXELS

LEAST_DEPTH = wp.constant(1.0e-37)
"""Depth of a hit point at the light, so that a tile with hit points is never taken for an empty one."""


@wp.func
def texel_index(face: wp.int32, x: wp.int32, y: wp.int32, along: wp.int32) -> wp.int32:
    """The texels of a tile of 8 x 8 are neighbours in memory; ``along``: texels along a face."""
    return tile_index(face, x, y, along) * TILE_TEXELS + (y % TILE_SIZE) * TILE_SIZE + x % TILE_SIZE


@wp.kernel(enable_backward=False, grid_stride=False)
def insert_kernel(
    light: wp.int32,
    hits: PrimaryHits,
    receivers: wp.array2d(dtype=wp.uint8),
    cells: RayCells,
    head: wp.array(dtype=wp.int32),
):
    """Put every hit point in the list of its texel; the farthest of each tile; the faces' rectangles (``cells.table``).

    head: 1 + the pixel of the last hit point of a texel, 0 where the list is empty. The fourth word of ``cells.point``
    becomes the bits of the next one. The order of a list depends on that of the threads; no answer does.
    """
    along = cells_in_use(cells.rectangle, cells.cells)
    set_table(wp.tid(), cells.rectangle, cells.table, along)
    camera = hits.camera
    at = tile_pixel(wp.tid(), camera.width, camera.height)
    if at[0] < 0:
        return
    pixel = at[1] * camera.width + at[0]
    if wp.static(effects.receivers):
        if receivers[light, pixel] == wp.uint8(0):
            return
    elif not has_hit(hits, pixel):
        return
    p = entry(cells.place, pixel)
    face = wp.int32(p[2])
    texel = cell_of(p, face, face_rectangle(face, cells.rectangle), along, cells)
    raise_farthest(cells.farthest, face, texel[0], texel[1], wp.max(p[3], LEAST_DEPTH), along)
    following = wp.atomic_exch(head, texel_index(face, texel[0], texel[1], along), pixel + 1)
    cells.point[pixel][3] = wp.cast(following, wp.float32)


@wp.func
def test_node(bits: ShadowBits, queue: Queue, cells: RayCells, node: wp.int32, occluder: Occluder) -> wp.int32:
    """Test a hit point of a list against a triangle; the next of the list, 0 at its end."""
    h = entry(cells.point, node - 1)
    following = wp.cast(h[3], wp.int32)
    test_ray(bits, queue, wp.vec4f(h[0], h[1], h[2], wp.cast(node - 1, wp.float32)), occluder)
    return following


@wp.func
def test_list(bits: ShadowBits, queue: Queue, cells: RayCells, first: wp.int32, occluder: Occluder):
    """Test the hit points of a list against a triangle; ``first``: its head."""
    node = first
    while node > 0:
        node = test_node(bits, queue, cells, node, occluder)


@wp.func
def test_texels(
    bits: ShadowBits,
    queue: Queue,
    cells: RayCells,
    head: wp.array(dtype=wp.int32),
    along: wp.int32,
    face: wp.int32,
    box: wp.vec4i,
    occluder: Occluder,
    most: wp.int32,
) -> wp.bool:
    """Test the hit points in a small box of texels, ``most`` of them; whether those were all.

    One loop over all of them: in a loop for each texel the lanes of a warp would wait for the longest list each time.
    """
    left = wp.int32(most)
    x = wp.int32(box[0])
    y = wp.int32(box[1])
    node = wp.int32(0)
    while left >= 0 and (node > 0 or y <= box[3]):
        if node == 0:
            node = entry(head, texel_index(face, x, y, along))
            x += 1
            if x > box[2]:
                x = box[0]
                y += 1
        if node > 0:
            left -= 1
            if left >= 0:
                node = test_node(bits, queue, cells, node, occluder)
    return left >= 0
