"""Boxes: of all valid triangles of a frame, reduced on the device without a read-back, and of each, padded."""

import math
from typing import Any

import warp as wp

from ...harness.frame.frame import Frame
from ...harness.frame.geometry import Mesh, corners_of, weld_of
from ..exact.triangle import U32
from .axes import longest_axis
from .corner_records import CornerRecords, store_invalid, store_record

BLOCK = 256
BLOCKS = 264
"""Two blocks per multiprocessor of a large GPU: enough to read at full bandwidth, with few atomics."""

PLACES = wp.constant(1024)
"""Warp's Morton codes have ten bits per axis."""

PADDED_UNITS = 16.0
"""Units of 2^-24 of the largest coordinate: more than the roundings of Warp's slab test can amount to.

With M a bound on the coordinates of scene and eye, no box is farther than 2 M from a ray's origin; the slab is wrong by
at most 3 u 2 M, the rounded box by u M, a shadow origin by u M and its direction by u 2 M: 10 u M in all.
"""


@wp.func
def lower_box(box: wp.array(dtype=wp.float32), lane: wp.int32, low: wp.vec3f, high: wp.vec3f):
    """Lower x, y, z, -x, -y, -z to what the threads of a block found: one reduction per block, then six atomics."""
    for axis in range(wp.static(3)):
        least = wp.tile_extract(wp.tile_min(wp.tile(low[axis])), 0)
        most = wp.tile_extract(wp.tile_min(wp.tile(-high[axis])), 0)
        if lane == 0:
            wp.atomic_min(box, axis, least)
            wp.atomic_min(box, 3 + axis, most)


@wp.kernel(enable_backward=False)
def bounds_kernel(count: wp.int32, blocks: wp.int32, mesh: Mesh, box: wp.array(dtype=wp.float32)):
    """Minimum over valid triangles of x, y, z, -x, -y, -z: one reduction per block, then six atomics."""
    block, lane = wp.tid()
    low = wp.vec3f(wp.INF, wp.INF, wp.INF)
    high = wp.vec3f(-wp.INF, -wp.INF, -wp.INF)
    i = block * wp.block_dim() + lane
    while i < count:
        if mesh.valid[i] != wp.uint8(0):
            corners = corners_of(mesh, i)
            low = wp.min(low, wp.min(corners.a, wp.min(corners.b, corners.c)))
            high = wp.max(high, wp.max(corners.a, wp.max(corners.b, corners.c)))
        i += blocks * wp.block_dim()
    lower_box(box, lane, low, high)


@wp.func
def box_low(box: wp.array(dtype=wp.float32)) -> wp.vec3f:
    return wp.vec3f(box[0], box[1], box[2])


@wp.func
def box_high(box: wp.array(dtype=wp.float32)) -> wp.vec3f:
    return wp.vec3f(-box[3], -box[4], -box[5])


def launch_bounds(frame: Frame, box: wp.array) -> None:
    """Fill ``box`` (float32 [6]: low, then negated high corner). All inf where no triangle is valid."""
    box.fill_(math.inf)
    blocks = 1 if wp.get_device(frame.device).is_cpu else BLOCKS
    wp.launch_tiled(
        bounds_kernel,
        dim=[blocks],
        inputs=[frame.triangle_count, blocks, frame.mesh],
        outputs=[box],
        block_dim=BLOCK,
        device=frame.device,
    )


@wp.func
def aside(low: wp.vec3f, high: wp.vec3f, i: wp.int32) -> wp.vec3f:
    """One of :data:`PLACES` points on the longest edge at the low corner of a box; consecutive indices get different
    points.

    Ten thousand boxes in one place have one Morton code, and Warp's rebuild on an H200 takes 25 ms for them.
    """
    axis = longest_axis(high - low)
    point = low
    point[axis] = wp.min(
        high[axis], low[axis] + (high[axis] - low[axis]) * (wp.float32(i % PLACES) / wp.float32(PLACES))
    )
    return point


@wp.kernel(enable_backward=False, grid_stride=False)
def boxes_kernel(
    units: wp.float32,
    mesh: Mesh,
    box: wp.array(dtype=wp.float32),
    bound: wp.array(dtype=wp.float32),
    lowers: wp.array(dtype=wp.vec3f),
    uppers: wp.array(dtype=wp.vec3f),
    records: CornerRecords,
):
    """Boxes padded by ``units`` of 2^-24 of the largest coordinate of scene and eye, 0 leaves them as they are; and the
    records of the triangles (:mod:`.corner_records`).

    An invalid triangle gets a point on an edge of the scene's box (:func:`aside`), or zero where nothing is valid.
    """
    i = wp.tid()
    low = box_low(box)
    if not wp.isfinite(low):
        lowers[i] = wp.vec3f(0.0, 0.0, 0.0)
        uppers[i] = wp.vec3f(0.0, 0.0, 0.0)
        store_invalid(records, i)
        return
    if mesh.valid[i] == wp.uint8(0):
        point = aside(low, box_high(box), i)
        lowers[i] = point
        uppers[i] = point
        store_invalid(records, i)
        return
    corners = corners_of(mesh, i)
    weld = weld_of(mesh, i)
    extent = wp.max(wp.max(wp.abs(low), wp.abs(box_high(box))), wp.vec3f(bound[0], bound[0], bound[0]))
    pad = (units * U32) * extent
    if units > 0.0:
        pad = pad + wp.vec3f(1.0e-37, 1.0e-37, 1.0e-37)
    lowers[i] = wp.min(corners.a, wp.min(corners.b, corners.c)) - pad
    uppers[i] = wp.max(corners.a, wp.max(corners.b, corners.c)) + pad
    store_record(records, i, corners, weld)


def launch_boxes(frame: Frame, box: wp.array, lowers: wp.array, uppers: wp.array, records: Any, units: float) -> None:
    """Fill ``lowers`` and ``uppers`` (vec3f [triangles]), ``records`` and the frame's ``box``, as
    :func:`launch_bounds` does.
    """
    launch_bounds(frame, box)
    inputs = [units, frame.mesh, box, frame.max_coordinate]
    outputs = [lowers, uppers, records]
    frame.launch(boxes_kernel, frame.triangle_count, inputs, outputs)
