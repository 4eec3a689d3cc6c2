"""Load balancing (paper, section 4.3): rays sorted by light tile become chunks of at most r, one thread block each.

Two ways to the same array G of first rays (outArr), C_total + 1 long: the last entry is the number of shadow rays,
so that the rays of chunk b are G[b] .. G[b + 1] - 1.

algorithm-1  Algorithm 1 and Figure 8 word by word: hard boundaries where the tile changes (flagScan, array C),
             a segmented scan of ones (segScan, D), soft boundaries every r rays (getChunk, E), stream compaction
             of the thread numbers F (strCompact, G)
direct       ceil(R / r) chunks for a tile of R rays, their scan, and each tile writes its own

The paper's arrays hold every pixel. Pixels without a shadow ray carry the key ``tiles``, sort behind every tile and
start no chunk.
"""

import warp as wp

from ....harness.frame.geometry import filled
from .sorting import TileLists


@wp.struct
class RayChunks:
    """Chunks of one light's shadow rays, which are sorted by tile.

    tiles, pixels  int32 [rays or more]: the light tile and the pixel of each ray
    first  int32 [rays + 1]: first ray of each chunk, then the number of rays (the paper's outArr)
    total  int32 [1]: chunks
    """

    tiles: wp.array(dtype=wp.int32)
    pixels: wp.array(dtype=wp.int32)
    first: wp.array(dtype=wp.int32)
    total: wp.array(dtype=wp.int32)


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


@wp.kernel(enable_backward=False, grid_stride=False)
def chunk_count_kernel(
    r: wp.int32, begin: wp.array(dtype=wp.int32), end: wp.array(dtype=wp.int32), chunks: wp.array(dtype=wp.int32)
):
    """ceil(R / r) chunks for a tile of R rays (paper, section 4.3)."""
    tile = wp.tid()
    chunks[tile] = (end[tile] - begin[tile] + r - 1) // r


@wp.kernel(enable_backward=False, grid_stride=False)
def chunk_kernel(
    r: wp.int32,
    begin: wp.array(dtype=wp.int32),
    end: wp.array(dtype=wp.int32),
    chunks: wp.array(dtype=wp.int32),
    scan: wp.array(dtype=wp.int32),
    outArr: wp.array(dtype=wp.int32),
    numCBlocks: wp.array(dtype=wp.int32),
):
    """The first ray of every chunk of a tile; the last occupied tile closes the array."""
    tile = wp.tid()
    total = scan[scan.shape[0] - 1]
    if tile == 0:
        numCBlocks[0] = total
        if total == 0:
            outArr[0] = 0
    for j in range(chunks[tile]):
        outArr[scan[tile] - chunks[tile] + j] = begin[tile] + j * r
    if chunks[tile] > 0 and scan[tile] == total:
        outArr[total] = end[tile]


def most_chunks(rays: int, tiles: int, r: int) -> int:
    """C_total = sum of ceil(R_j / r) is at most one chunk a non-empty tile and one for every r rays."""
    return min(rays, min(rays, tiles) + rays // r)


class Chunks:
    """Chunks of one light's sorted rays. ``lists``: the rays of each tile; keys from ``tiles`` on are no shadow rays.

    outArr      int32 [rays + 1]: first ray of each chunk, then the number of shadow rays
    numCBlocks  int32 [1]: C_total
    of_rays     :class:`RayChunks`
    The other arrays are the paper's, int32 [rays], and exist with ``algorithm-1`` only.
    """

    def __init__(self, lists: TileLists, rays: int, tiles: int, r: int, balancing: str, device: str):
        self.lists, self.rays, self.tiles, self.r, self.device = lists, rays, tiles, r, device
        self.capacity = most_chunks(rays, tiles, r)
        self.direct = balancing == "direct"

        def ints(size: int) -> wp.array:
            return wp.zeros(size, dtype=wp.int32, device=device)

        self.outArr, self.numCBlocks = ints(rays + 1), ints(1)
        if self.direct:
            self.chunks, self.scan = ints(tiles), ints(tiles)
        else:
            self.threadArr, self.pseudoArr, self.scratchArr, self.validArr = (ints(rays) for _ in range(4))
            self.segment, self.start, self.scan = (ints(rays) for _ in range(3))
        self.of_rays = filled(
            RayChunks, tiles=lists.keys, pixels=lists.values, first=self.outArr, total=self.numCBlocks
        )

    def launch(self) -> None:
        if not self.direct:
            self._algorithm1(self.lists.keys)
            return
        runs = [self.r, self.lists.begin, self.lists.end]
        self._launch(chunk_count_kernel, self.tiles, runs, [self.chunks])
        wp.utils.array_scan(self.chunks, self.scan, inclusive=True)
        self._launch(chunk_kernel, self.tiles, [*runs, self.chunks, self.scan], [self.outArr, self.numCBlocks])

    def _algorithm1(self, tileIDArr: wp.array) -> None:
        n, tiles = self.rays, self.tiles
        self._launch(tag_thread_kernel, n, [], [self.threadArr])
        self._launch(flag_scan_kernel, n, [tiles, tileIDArr], [self.pseudoArr])
        self.scratchArr.fill_(1)
        # segScan of ones: a cell's number in its segment is its distance from the segment's first cell.
        wp.utils.array_scan(self.pseudoArr, self.segment, inclusive=True)
        self._launch(segment_start_kernel, n, [self.pseudoArr, self.segment], [self.start])
        self._launch(segment_scan_kernel, n, [self.segment, self.start], [self.scratchArr])
        self._launch(get_chunk_kernel, n, [tiles, self.r, tileIDArr, self.scratchArr], [self.validArr])
        wp.utils.array_scan(self.validArr, self.scan, inclusive=True)
        inputs = [tiles, tileIDArr, self.threadArr, self.validArr, self.scan]
        self._launch(compact_kernel, n, inputs, [self.outArr, self.numCBlocks])

    def _launch(self, kernel: wp.Kernel, dim: int, inputs: list, outputs: list) -> None:
        wp.launch(kernel, dim=dim, inputs=inputs, outputs=outputs, device=self.device)
