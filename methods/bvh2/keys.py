"""Morton keys of the triangles, and clearing at the start of a frame's build.

A key interleaves the bits of the middle of a triangle's box, on a cube as large as the scene's longest side (Lauterbach
et al. 2009). A triangle that is never hit (without area, or with a coordinate that is not a number) is left out: it gets
the largest key, which no other has, so that it comes after all others; builders stop before it.
"""

from __future__ import annotations

import math

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...harness.frame.frame import Frame
from ..common.bounds import BLOCK, BLOCKS, box_high, box_low, lower_box
from ..common.entries import entry, set_entry

EMPTY = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))
"""A flag at which neither child has arrived."""


@wp.kernel(enable_backward=False, grid_stride=False)
def box_kernel(
    count: wp.int32,
    blocks: wp.int32,
    points: wp.array(dtype=wp.vec3f),
    used: wp.array(dtype=wp.uint8),
    box: wp.array(dtype=wp.float32),
):
    """Minimum of x, y, z, -x, -y, -z over the finite vertices that triangles use.

    A triangle that is left out may enlarge the box: keys are then coarser, and bounds wider.
    """
    block, lane = wp.tid()
    low = wp.vec3f(wp.INF, wp.INF, wp.INF)
    high = wp.vec3f(-wp.INF, -wp.INF, -wp.INF)
    i = block * wp.block_dim() + lane
    while i < count:
        p = entry(points, i)
        if entry(used, i) != wp.uint8(0) and wp.isfinite(p):
            low = wp.min(low, p)
            high = wp.max(high, p)
        i += blocks * wp.block_dim()
    lower_box(box, lane, low, high)


def used_vertices(faces: NDArray[np.int32], vertices: int) -> NDArray[np.uint8]:
    """1 for each vertex that a triangle has."""
    used = np.zeros(max(1, vertices), dtype=np.uint8)
    used[faces.ravel()] = 1
    return used


def launch_box(frame: Frame, used: wp.array, box: wp.array) -> None:
    """Fill ``box`` (float32 [6]: low, then negated high corner). All inf where nothing is there."""
    box.fill_(math.inf)
    blocks = 1 if wp.get_device(frame.device).is_cpu else BLOCKS
    wp.launch_tiled(
        box_kernel,
        dim=[blocks],
        inputs=[frame.vertex_count, blocks, frame.points, used],
        outputs=[box],
        block_dim=BLOCK,
        device=frame.device,
    )


@wp.func
def spread(x: wp.int32) -> wp.int32:
    """Ten bits, two zeros after each."""
    x = (x | (x << 16)) & 0x030000FF
    x = (x | (x << 8)) & 0x0300F00F
    x = (x | (x << 4)) & 0x030C30C3
    return (x | (x << 2)) & 0x09249249


@wp.func
def cell(x: wp.float32, low: wp.float32, scale: wp.float32, last: wp.float32) -> wp.int32:
    """The cell of x, clamped to 0..last."""
    return wp.int32(wp.min(wp.max((x - low) * scale, 0.0), last))


@wp.func
def extent_of(box: wp.array(dtype=wp.float32)) -> wp.float32:
    """The largest coordinate of the scene's box; infinite where nothing is valid."""
    return wp.max(wp.max(wp.abs(box_low(box)), wp.abs(box_high(box))))


@wp.kernel(enable_backward=False, grid_stride=False)
def key_kernel(
    count: wp.int32,
    bits: wp.int32,
    points: wp.array(dtype=wp.vec3f),
    triangles: wp.array(dtype=wp.vec3i),
    valid: wp.array(dtype=wp.uint8),
    box: wp.array(dtype=wp.float32),
    keys: wp.array(dtype=wp.int32),
    values: wp.array(dtype=wp.int32),
    flags: wp.array(dtype=wp.uint64),
    root: wp.array(dtype=wp.int32),
    extent: wp.array(dtype=wp.float32),
):
    """Key and index of each triangle; empties the flags, and the tree. extent: the box's largest coordinate."""
    i = wp.tid()
    if i >= count:
        return
    face = entry(triangles, i)
    left_out = entry(valid, i) == wp.uint8(0)
    if i < flags.shape[0]:
        flags[i] = EMPTY
    set_entry(values, i, i)
    if i == 0:
        root[0] = -1
        root[1] = 0
        extent[0] = extent_of(box)
    largest = (wp.int32(1) << bits) - 1
    if left_out:
        set_entry(keys, i, largest)
        return
    a = entry(points, face[0])
    b = entry(points, face[1])
    c = entry(points, face[2])
    low = box_low(box)
    size = wp.max(box_high(box) - low)
    cells = wp.float32(wp.int32(1) << (bits // 3))
    scale = wp.float32(0.0)
    # In a scene too large or too small for this all keys are equal: the tree is correct, but slow to traverse.
    if size > 1.0e-30 and size < 1.0e30:
        scale = cells / size
    # Halves first: a sum may overflow.
    middle = 0.5 * wp.min(a, wp.min(b, c)) + 0.5 * wp.max(a, wp.max(b, c))
    x = cell(middle[0], low[0], scale, cells - 1.0)
    y = cell(middle[1], low[1], scale, cells - 1.0)
    z = cell(middle[2], low[2], scale, cells - 1.0)
    set_entry(keys, i, wp.min((spread(x) << 2) | (spread(y) << 1) | spread(z), largest - 1))
