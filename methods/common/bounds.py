"""The box of a frame's valid triangles, reduced on the device each frame without a read-back."""

from __future__ import annotations

import math

import warp as wp

from ...harness.frame import Frame

BLOCK = 256
BLOCKS = 264
"""Two blocks a multiprocessor of a large GPU: enough to read at full bandwidth, few enough atomics."""


@wp.kernel(enable_backward=False)
def bounds_kernel(
    count: wp.int32,
    blocks: wp.int32,
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    valid: wp.array(dtype=wp.uint8),
    box: wp.array(dtype=wp.float32),
):
    """Minimum over valid triangles of x, y, z, -x, -y, -z: one reduction a block, then six atomics."""
    block, lane = wp.tid()
    low = wp.vec3f(wp.INF, wp.INF, wp.INF)
    high = wp.vec3f(-wp.INF, -wp.INF, -wp.INF)
    i = block * wp.block_dim() + lane
    while i < count:
        if valid[i] != wp.uint8(0):
            face = triangles[i]
            a = points[face[0]]
            b = points[face[1]]
            c = points[face[2]]
            low = wp.min(low, wp.min(a, wp.min(b, c)))
            high = wp.max(high, wp.max(a, wp.max(b, c)))
        i += blocks * wp.block_dim()
    x0 = wp.tile_min(wp.tile(low[0]))
    y0 = wp.tile_min(wp.tile(low[1]))
    z0 = wp.tile_min(wp.tile(low[2]))
    x1 = wp.tile_min(wp.tile(-high[0]))
    y1 = wp.tile_min(wp.tile(-high[1]))
    z1 = wp.tile_min(wp.tile(-high[2]))
    vx0 = x0[0]
    vy0 = y0[0]
    vz0 = z0[0]
    vx1 = x1[0]
    vy1 = y1[0]
    vz1 = z1[0]
    if lane == 0:
        wp.atomic_min(box, 0, vx0)
        wp.atomic_min(box, 1, vy0)
        wp.atomic_min(box, 2, vz0)
        wp.atomic_min(box, 3, vx1)
        wp.atomic_min(box, 4, vy1)
        wp.atomic_min(box, 5, vz1)


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
        inputs=[frame.triangle_count, blocks, frame.points, frame.triangles, frame.valid],
        outputs=[box],
        block_dim=BLOCK,
        device=frame.device,
    )
