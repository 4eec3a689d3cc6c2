"""Algorithm 1 and Figure 8 of the paper word by word: from sorted rays to the first rays of chunks.

Hard boundaries where the tile changes (flagScan, array C), a segmented scan of ones (segScan, D), soft boundaries every r
rays (getChunk, E), stream compaction of the thread numbers F (strCompact, G).
"""

import warp as wp


@wp.kernel(enable_backward=False)
def tag_thread_kernel(threadArr: wp.array(dtype=wp.int32)):
    """F: thread numbers."""
    i = wp.tid()
    threadArr[i] = i


@wp.kernel(enable_backward=False)
def flag_scan_kernel(tiles: wp.int32, tileIDArr: wp.array(dtype=wp.int32), pseudoArr: wp.array(dtype=wp.int32)):
    """C: 1 at a hard boundary, where another light tile begins."""
    i = wp.tid()
    flag = wp.int32(0)
    if tileIDArr[i] < tiles and (i == 0 or tileIDArr[i - 1] != tileIDArr[i]):
        flag = 1
    pseudoArr[i] = flag


@wp.kernel(enable_backward=False)
def segment_start_kernel(
    pseudoArr: wp.array(dtype=wp.int32), segment: wp.array(dtype=wp.int32), start: wp.array(dtype=wp.int32)
):
    """First cell of every segment; ``segment`` is the inclusive scan of the flags."""
    i = wp.tid()
    if pseudoArr[i] == 1:
        start[segment[i] - 1] = i


@wp.kernel(enable_backward=False)
def segment_scan_kernel(
    segment: wp.array(dtype=wp.int32), start: wp.array(dtype=wp.int32), scratchArr: wp.array(dtype=wp.int32)
):
    """D: the inclusive scan of ones within each segment, 1, 2, 3, ..."""
    i = wp.tid()
    if segment[i] > 0:
        scratchArr[i] = i - start[segment[i] - 1] + 1


@wp.kernel(enable_backward=False)
def get_chunk_kernel(
    tiles: wp.int32,
    r: wp.int32,
    tileIDArr: wp.array(dtype=wp.int32),
    scratchArr: wp.array(dtype=wp.int32),
    validArr: wp.array(dtype=wp.int32),
):
    """E: 1 at a soft boundary, every r rays of a segment. Every hard boundary is one too."""
    i = wp.tid()
    flag = wp.int32(0)
    if tileIDArr[i] < tiles and (scratchArr[i] - 1) % r == 0:
        flag = 1
    validArr[i] = flag


@wp.kernel(enable_backward=False)
def compact_kernel(
    tiles: wp.int32,
    tileIDArr: wp.array(dtype=wp.int32),
    threadArr: wp.array(dtype=wp.int32),
    validArr: wp.array(dtype=wp.int32),
    scan: wp.array(dtype=wp.int32),
    outArr: wp.array(dtype=wp.int32),
    numCBlocks: wp.array(dtype=wp.int32),
):
    """G: the thread numbers of soft boundaries, then the number of rays; C_total."""
    i = wp.tid()
    if validArr[i] == 1:
        outArr[scan[i] - 1] = threadArr[i]
    total = scan[scan.shape[0] - 1]
    if i == 0:
        numCBlocks[0] = total
        if tileIDArr[0] >= tiles:
            outArr[0] = 0
    last = i == scan.shape[0] - 1
    if not last:
        last = tileIDArr[i + 1] >= tiles
    if tileIDArr[i] < tiles and last:
        outArr[total] = i + 1


class Algorithm1:
    """The paper's arrays, int32 [rays]."""

    def __init__(self, rays: int, device: str):
        self.rays, self.device = rays, device
        with wp.ScopedDevice(device):
            self.threadArr, self.pseudoArr, self.scratchArr, self.validArr, self.segment, self.start, self.scan = (
                wp.zeros(rays, dtype=wp.int32) for _ in range(7)
            )

    def launch(self, tileIDArr: wp.array, tiles: int, r: int, outArr: wp.array, numCBlocks: wp.array) -> None:
        self._launch(tag_thread_kernel, [], [self.threadArr])
        self._launch(flag_scan_kernel, [tiles, tileIDArr], [self.pseudoArr])
        self.scratchArr.fill_(1)
        # segScan of ones: a cell's number in its segment is its distance from the segment's first cell.
        wp.utils.array_scan(self.pseudoArr, self.segment, inclusive=True)
        self._launch(segment_start_kernel, [self.pseudoArr, self.segment], [self.start])
        self._launch(segment_scan_kernel, [self.segment, self.start], [self.scratchArr])
        self._launch(get_chunk_kernel, [tiles, r, tileIDArr, self.scratchArr], [self.validArr])
        wp.utils.array_scan(self.validArr, self.scan, inclusive=True)
        self._launch(compact_kernel, [tiles, tileIDArr, self.threadArr, self.validArr, self.scan], [outArr, numCBlocks])

    def _launch(self, kernel: wp.Kernel, inputs: list, outputs: list) -> None:
        wp.launch(kernel, dim=self.rays, inputs=inputs, outputs=outputs, device=self.device)
