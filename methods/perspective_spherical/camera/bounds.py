"""The first pass of the perspective grid: a triangle's box of tiles on the image, its range of depth and its record.

Camera space is (right, up, forward) from the eye.
"""

from __future__ import annotations

import warp as wp

from ....harness.frame.geometry import Camera, Corners, Mesh, corners_of, weld_of
from ...common.screen import in_camera_space, out_of_view, pixel_box
from ...exact.triangle import largest
from ...gpu.entries import set_entry
from ..culling import faces_away
from ..lists.binning import PieceQueue, queue_large
from .ray_tests import plane_record, vertex_record


@wp.func
def widened(corners: Corners, widening: wp.float32) -> Corners:
    """A triangle grown about its middle by ``widening`` of its size."""
    middle = (corners.a + corners.b + corners.c) / 3.0
    return Corners(
        corners.a + (corners.a - middle) * widening,
        corners.b + (corners.b - middle) * widening,
        corners.c + (corners.c - middle) * widening,
    )


@wp.func
def project(
    i: wp.int32,
    tile: wp.int32,
    widening: wp.float32,
    outward: wp.float64,
    test: wp.int32,
    camera: Camera,
    mesh: Mesh,
    boxes: wp.array(dtype=wp.vec4i),
    records: wp.array(dtype=wp.vec4f),
    queue: PieceQueue,
) -> wp.vec2f:
    """A valid triangle's box, record and place in the queue; returns its range of depth, (inf, -inf) if unseen."""
    unseen = wp.vec2f(wp.INF, -wp.INF)
    corners = corners_of(mesh, i)
    o = camera.eye[0]
    seen = widened(in_camera_space(camera, corners), widening)
    a = seen.a
    b = seen.b
    c = seen.c
    if out_of_view(a, b, c, camera.tangents[0], camera.tangents[1]):
        return unseen
    pixels = pixel_box(a, b, c, camera.tangents[0], camera.tangents[1], camera.width, camera.height)
    if pixels[2] < pixels[0] or pixels[3] < pixels[1]:
        return unseen
    if faces_away(outward, o, corners):
        return unseen
    box = wp.vec4i(pixels[0] // tile, pixels[1] // tile, pixels[2] // tile, pixels[3] // tile)
    set_entry(boxes, i, box)
    queue_large(i, box, queue)
    r = plane_record(o, corners, weld_of(mesh, i))
    if test == 2:  # Moeller-Trumbore
        r = vertex_record(o, corners, weld_of(mesh, i))
    set_entry(records, 3 * i, r.q0)
    set_entry(records, 3 * i + 1, r.q1)
    set_entry(records, 3 * i + 2, r.q2)
    reach = wp.max(largest(a), wp.max(largest(b), largest(c)))
    low = wp.max(0.0, wp.min(a[2], wp.min(b[2], c[2])) - 1.0e-6 * reach)
    return wp.vec2f(low, wp.max(a[2], wp.max(b[2], c[2])) + 1.0e-6 * reach)


@wp.kernel(enable_backward=False, grid_stride=False)
def project_kernel(
    triangle_count: wp.int32,
    tile: wp.int32,
    widening: wp.float32,
    outward: wp.float64,
    test: wp.int32,
    camera: Camera,
    mesh: Mesh,
    boxes: wp.array(dtype=wp.vec4i),
    depths: wp.array(dtype=wp.vec2f),
    depth_range: wp.array(dtype=wp.float32),
    records: wp.array(dtype=wp.vec4f),
    queue: PieceQueue,
):
    """Each triangle's box of tiles, range of depth and record; queue the large ones; range of all depths.

    widening  growth of each triangle about its middle; outward  see :func:`~.culling.faces_away`
    records   vec4f [3 * triangle_count], written where the box is not empty
    The range is reduced in each block: one atomic per triangle would cost more than everything else here.
    """
    i = wp.tid()
    depth = wp.vec2f(wp.INF, -wp.INF)
    if i < boxes.shape[0]:
        set_entry(boxes, i, wp.vec4i(0, 0, -1, -1))
        if i < triangle_count and mesh.valid[i] != wp.uint8(0):
            depth = project(i, tile, widening, outward, test, camera, mesh, boxes, records, queue)
            depths[i] = depth
    low = wp.tile_extract(wp.tile_min(wp.tile(depth[0])), 0)
    high = wp.tile_extract(wp.tile_max(wp.tile(depth[1])), 0)
    if i % wp.block_dim() == 0:
        if low < depth_range[0]:
            wp.atomic_min(depth_range, 0, low)
        if high > depth_range[1]:
            wp.atomic_max(depth_range, 1, high)
