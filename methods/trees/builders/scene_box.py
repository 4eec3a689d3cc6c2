"""The box of a frame's triangles, in one launch that needs nothing to be cleared before it.

The blocks lower six numbers, as integers in the order of floats. The last block to end writes the box, and leaves the
numbers as they were at first.
"""

import numpy as np
import warp as wp

from ....harness.frame.frame import Frame
from ...gpu.entries import entry
from ..native import BASICS

BLOCK = 256
BLOCKS = 264
"""At most so many, two for each multiprocessor of a large GPU: enough to read at full bandwidth, with few atomics."""

MOST = 0x7FFFFFFF

FINISH = (
    BASICS
    + """
const float least[6] = {lower[0], lower[1], lower[2], -upper[0], -upper[1], -upper[2]};
#if defined(__CUDA_ARCH__)
const unsigned int ALL = 0xffffffffu;
__shared__ int of_block[6];
int lane = threadIdx.x & 31;
if (threadIdx.x < 6) of_block[threadIdx.x] = MOST;
__syncthreads();
for (int k = 0; k < 6; k++) {
    int own = ordered((int)bits(least[k]));
    for (int step = 16; step > 0; step >>= 1) own = min(own, __shfl_xor_sync(ALL, own, step));
    if (lane == 0) atomicMin(of_block + k, own);
}
__syncthreads();
if (threadIdx.x >= 32) return;
if (lane < 6) {
    atomicMin(found.data + lane, of_block[lane]);
    __threadfence();
}
__syncwarp();
int ended = 0;
if (lane == 0) ended = atomicAdd(found.data + 6, 1);
if (__shfl_sync(ALL, ended, 0) != (int)gridDim.x - 1) return;
float side = 0.0f;
if (lane < 6) {
    side = real((unsigned int)ordered(atomicExch(found.data + lane, MOST)));
    box.data[lane] = side;
}
float largest = size(side);
for (int step = 4; step > 0; step >>= 1) largest = high(largest, __shfl_xor_sync(ALL, largest, step));
if (lane == 0) {
    extent.data[0] = largest;
    found.data[6] = 0;
}
#else
extent.data[0] = 0.0f;
for (int k = 0; k < 6; k++) {
    box.data[k] = least[k];
    extent.data[0] = high(extent.data[0], size(least[k]));
}
#endif
"""
)


@wp.func_native(f"constexpr int MOST = {MOST};" + FINISH)
def write_box(
    lower: wp.vec3f, upper: wp.vec3f, found: wp.array[wp.int32], box: wp.array[wp.float32], extent: wp.array[wp.float32]
):
    """Called by all threads, each with the corners of what it has read."""


@wp.kernel(enable_backward=False, grid_stride=False)
def box_kernel(
    count: wp.int32,
    threads: wp.int32,
    points: wp.array[wp.vec3f],
    used: wp.array[wp.uint8],
    found: wp.array[wp.int32],
    box: wp.array[wp.float32],
    extent: wp.array[wp.float32],
    cleared: wp.array[wp.int32],
):
    """The box of the finite vertices that triangles use; and ``cleared`` is filled with zeros.

    A triangle that is left out may enlarge the box: keys are then coarser, and bounds wider.
    """
    i = wp.tid()
    word = i
    while word < cleared.shape[0]:
        cleared[word] = 0
        word += threads
    lower = wp.vec3f(wp.INF, wp.INF, wp.INF)
    upper = wp.vec3f(-wp.INF, -wp.INF, -wp.INF)
    while i < count:
        p = entry(points, i)
        if entry(used, i) != wp.uint8(0) and wp.isfinite(p):
            lower = wp.min(lower, p)
            upper = wp.max(upper, p)
        i += threads
    write_box(lower, upper, found, box, extent)


class SceneBox:
    """The box of a frame's triangles.

    box     float32 [6]: its low and its negated high corner; all inf where nothing is in it
    extent  float32 [1]: its largest coordinate
    found   int32 [7]: what the blocks lower, and how many have ended
    cleared int32: filled with zeros by the same launch
    """

    def __init__(self, frame: Frame, extent: wp.array, cleared: wp.array | None = None):
        self.frame, self.extent = frame, extent
        used = np.zeros(max(1, frame.vertex_count), dtype=np.uint8)
        used[frame.prepared.faces.ravel()] = 1
        with wp.ScopedDevice(frame.device):
            self.used = wp.array(used, dtype=wp.uint8)
            self.box = wp.zeros(6, dtype=wp.float32)
            self.found = wp.array([MOST] * 6 + [0], dtype=wp.int32)
            self.cleared = wp.zeros(0, dtype=wp.int32) if cleared is None else cleared

    def launch(self) -> None:
        """Fill it."""
        f = self.frame
        cuda = wp.get_device(f.device).is_cuda
        threads = BLOCK * min(BLOCKS, -(-f.vertex_count // BLOCK)) if cuda else 1
        inputs = [f.vertex_count, threads, f.points, self.used]
        f.launch(box_kernel, threads, inputs, [self.found, self.box, self.extent, self.cleared], BLOCK)
