"""Algorithm 1 and Figure 8 of the paper word by word: from sorted rays to the first rays of chunks.

Hard boundaries where the tile changes (flagScan, array C), a segmented scan of ones (segScan, D), soft boundaries every r
rays (getChunk, E), stream compaction of the thread numbers F (strCompact, G).
"""

# ruff: noqa: N815  (the names are the paper's)

import warp as wp

from ...common.pairs import zeroed


@wp.struct
class Arrays:
    """The paper's arrays, int32 [rays]; the inclusive scans of C and E, and the first cell of every segment."""

    tileIDArr: wp.array(dtype=wp.int32)
    threadArr: wp.array(dtype=wp.int32)
    pseudoArr: wp.array(dtype=wp.int32)
    scratchArr: wp.array(dtype=wp.int32)
    validArr: wp.array(dtype=wp.int32)
    segment: wp.array(dtype=wp.int32)
    scan: wp.array(dtype=wp.int32)
    start: wp.array(dtype=wp.int32)


@wp.kernel(enable_backward=False)
def tag_thread_kernel(a: Arrays):
    """F: thread numbers."""
    i = wp.tid()
    a.threadArr[i] = i


@wp.kernel(enable_backward=False)
def flag_scan_kernel(tiles: wp.int32, a: Arrays):
    """C: 1 at a hard boundary, where another light tile begins."""
    i = wp.tid()
    flag = wp.int32(0)
    if a.tileIDArr[i] < tiles and (i == 0 or a.tileIDArr[i - 1] != a.tileIDArr[i]):
        flag = 1
    a.pseudoArr[i] = flag


@wp.kernel(enable_backward=False)
def segment_start_kernel(a: Arrays):
    """First cell of every segment."""
    i = wp.tid()
    if a.pseudoArr[i] == 1:
        a.start[a.segment[i] - 1] = i


@wp.kernel(enable_backward=False)
def segment_scan_kernel(a: Arrays):
    """D: the inclusive scan of ones within each segment, 1, 2, 3, ..."""
    i = wp.tid()
    if a.segment[i] > 0:
        a.scratchArr[i] = i - a.start[a.segment[i] - 1] + 1


@wp.kernel(enable_backward=False)
def get_chunk_kernel(tiles: wp.int32, r: wp.int32, a: Arrays):
    """E: 1 at a soft boundary, every r rays of a segment. Every hard boundary is one too."""
    i = wp.tid()
    flag = wp.int32(0)
    if a.tileIDArr[i] < tiles and (a.scratchArr[i] - 1) % r == 0:
        flag = 1
    a.validArr[i] = flag


@wp.kernel(enable_backward=False)
def compact_kernel(tiles: wp.int32, a: Arrays, outArr: wp.array(dtype=wp.int32), numCBlocks: wp.array(dtype=wp.int32)):
    """G: the thread numbers of soft boundaries, then the number of rays; C_total."""
    i = wp.tid()
    end = a.scan.shape[0] - 1
    if a.validArr[i] == 1:
        outArr[a.scan[i] - 1] = a.threadArr[i]
    if i == 0:
        numCBlocks[0] = a.scan[end]
        if a.tileIDArr[0] >= tiles:
            outArr[0] = 0
    last = i == end
    if not last:
        last = a.tileIDArr[i + 1] >= tiles
    if a.tileIDArr[i] < tiles and last:
        outArr[a.scan[end]] = i + 1


class Algorithm1:
    """:class:`Arrays`, and the launches that fill them. ``tileIDArr``: of the sorted rays, or more."""

    def __init__(self, rays: int, tileIDArr: wp.array, device: str):
        self.rays, self.device = rays, device
        with wp.ScopedDevice(device):
            self.arrays = zeroed(Arrays, rays, tileIDArr=tileIDArr)

    def launch(self, tiles: int, r: int, outArr: wp.array, numCBlocks: wp.array) -> None:
        a = self.arrays
        self._launch(tag_thread_kernel, [a])
        self._launch(flag_scan_kernel, [tiles, a])
        a.scratchArr.fill_(1)
        # segScan of ones: a cell's number in its segment is its distance from the segment's first cell.
        wp.utils.array_scan(a.pseudoArr, a.segment, inclusive=True)
        self._launch(segment_start_kernel, [a])
        self._launch(segment_scan_kernel, [a])
        self._launch(get_chunk_kernel, [tiles, r, a])
        wp.utils.array_scan(a.validArr, a.scan, inclusive=True)
        self._launch(compact_kernel, [tiles, a, outArr, numCBlocks])

    def _launch(self, kernel: wp.Kernel, inputs: list) -> None:
        wp.launch(kernel, self.rays, inputs, device=self.device)
