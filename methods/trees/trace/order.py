"""The order in which a GPU begins the blocks of an image: squares with many vertices first.

The frame of a small mesh takes little longer than its longest warp, if that is among the first to begin. Long ways are
where triangles are small and many, and there are vertices; most of the picture of a small mesh is empty. So in each frame,
beside the tree, the squares of the image are sorted by how many vertices they show, in powers of two, and within these
from the middle outwards (:mod:`.shares`).
"""

import numpy as np
import warp as wp

from ....harness.frame.frame import Frame
from ....harness.frame.geometry import Camera
from ....harness.frame.schedule.passes import Pass
from ...gpu.entries import entry, set_entry
from ...gpu.warps import LANES, of_lane, sum_to_lane
from .shares import WARPS, Shares

BLOCK_WARPS = wp.constant(WARPS)


@wp.kernel(enable_backward=False, grid_stride=False)
def count_kernel(
    points: wp.array[wp.vec3f], camera: Camera, side: wp.int32, place: wp.array[wp.int32], counts: wp.array[wp.int32]
):
    """One thread per vertex: counts it where the square that shows it is; ``place``: of the squares, row by row."""
    way = entry(points, wp.tid()) - entry(camera.eye, 0)
    depth = wp.dot(entry(camera.axes, 2), way)
    if not depth > 0.0:
        return
    right = wp.dot(entry(camera.axes, 0), way) / (depth * entry(camera.tangents, 0))
    up = wp.dot(entry(camera.axes, 1), way) / (depth * entry(camera.tangents, 1))
    if wp.abs(right) < 1.0 and wp.abs(up) < 1.0:
        x = wp.int32(0.5 * (1.0 + right) * wp.float32(camera.width))
        y = wp.int32(0.5 * (1.0 - up) * wp.float32(camera.height))
        columns = (camera.width + side - 1) // side
        square = wp.min(y, camera.height - 1) // side * columns + wp.min(x, camera.width - 1) // side
        wp.atomic_add(counts, entry(place, square), 1)


@wp.func
def magnitude(number: wp.int32) -> wp.int32:
    """The binary digits of a number from 0 on, as far as float32 tells them."""
    return wp.cast(wp.float32(number), wp.int32) >> 23


@wp.kernel(enable_backward=False, grid_stride=False)
def order_kernel(
    lanes: wp.int32,
    count: wp.int32,
    from_middle: wp.array[wp.int32],
    counts: wp.array[wp.int32],
    tiles: wp.array[wp.int32],
):
    """One thread per tile: copies it to where its square is in the new order, with the blocks dealt to ``count`` shares
    (:class:`.shares.Shares`). The ``lanes`` of a warp, 32 on a GPU, find the place of their square together.
    """
    squares = counts.shape[0]
    in_square = from_middle.shape[0] // squares
    at = wp.tid() // in_square
    own = magnitude(entry(counts, at))
    before = wp.int32(0)
    k = wp.tid() & (lanes - 1)
    while k < squares:
        other = magnitude(entry(counts, k))
        if other > own or (other == own and k < at):
            before += 1
        k += lanes
    place = of_lane(sum_to_lane(before), LANES - 1) * in_square + wp.tid() % in_square
    block = place // BLOCK_WARPS
    blocks = tiles.shape[0] // (count * BLOCK_WARPS)
    to = ((block % count) * blocks + block // count) * BLOCK_WARPS + place % BLOCK_WARPS
    set_entry(tiles, to, entry(from_middle, wp.tid()))


class Order:
    """Of the blocks of ``shares``, found anew where points or camera have changed."""

    def __init__(self, frame: Frame, shares: Shares):
        self.frame, self.shares = frame, shares
        with wp.ScopedDevice(frame.device):
            self.from_middle = wp.array(shares.ordered.ravel(), dtype=wp.int32)
            self.place = wp.array(np.argsort(shares.squares), dtype=wp.int32)
            self.counts = wp.zeros(len(shares.squares), dtype=wp.int32)

    def find(self) -> None:
        """Write the tiles of the shares."""
        f, shares = self.frame, self.shares
        self.counts.zero_()
        f.launch(count_kernel, f.vertex_count, [f.points, f.camera, shares.side, self.place], [self.counts])
        lanes = 1 if shares.threaded else LANES
        inputs = [lanes, shares.count, self.from_middle, self.counts]
        f.launch(order_kernel, len(self.from_middle), inputs, [shares.all_tiles])

    def find_pass(self) -> Pass:
        return Pass("order of blocks", "trace", ("points", "camera"), ("blocks",), self.find)
