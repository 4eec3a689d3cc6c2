"""Load balancing (paper, section 4.3): rays sorted by light tile become chunks of at most r, one thread block each.

Two ways to the same array G of first rays (outArr), C_total + 1 long: the last entry is the number of shadow rays,
so that the rays of chunk b are G[b] .. G[b + 1] - 1.

algorithm-1  the paper's, word by word (:mod:`..variants.algorithm1`)
direct       ceil(R / r) chunks for a tile of R rays, their scan, and each tile writes its own

The paper's arrays hold every pixel. Pixels without a shadow ray carry the key ``tiles``, sort behind every tile and
start no chunk.
"""

import warp as wp

from ...common.pairs import zeroed
from ..variants.algorithm1 import Algorithm1
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


@wp.kernel(enable_backward=False, grid_stride=False)
def chunk_count_kernel(r: wp.int32, lists: TileLists, chunks: wp.array(dtype=wp.int32)):
    """ceil(R / r) chunks for a tile of R rays (paper, section 4.3)."""
    tile = wp.tid()
    chunks[tile] = (lists.end[tile] - lists.begin[tile] + r - 1) // r


@wp.kernel(enable_backward=False, grid_stride=False)
def chunk_kernel(
    r: wp.int32, lists: TileLists, chunks: wp.array(dtype=wp.int32), scan: wp.array(dtype=wp.int32), out: RayChunks
):
    """The first ray of every chunk of a tile; the last occupied tile closes the array."""
    tile = wp.tid()
    total = scan[scan.shape[0] - 1]
    if tile == 0:
        out.total[0] = total
        if total == 0:
            out.first[0] = 0
    for j in range(chunks[tile]):
        out.first[scan[tile] - chunks[tile] + j] = lists.begin[tile] + j * r
    if chunks[tile] > 0 and scan[tile] == total:
        out.first[total] = lists.end[tile]


def most_chunks(rays: int, tiles: int, r: int) -> int:
    """C_total = sum of ceil(R_j / r) is at most one chunk a non-empty tile and one for every r rays."""
    return min(rays, min(rays, tiles) + rays // r)


class Chunks:
    """Chunks of one light's sorted rays. ``lists``: the rays of each tile; keys from ``tiles`` on are no shadow rays.

    of_rays  :class:`RayChunks`     paper  what ``algorithm-1`` makes them with; else None
    """

    def __init__(self, lists: TileLists, rays: int, tiles: int, r: int, balancing: str, device: str):
        self.lists, self.tiles, self.r, self.device = lists, tiles, r, device
        self.capacity = most_chunks(rays, tiles, r)
        self.paper = Algorithm1(rays, lists.keys, device) if balancing == "algorithm-1" else None
        with wp.ScopedDevice(device):
            self.of_rays = zeroed(RayChunks, tiles=lists.keys, pixels=lists.values, first=rays + 1, total=1)
            if self.paper is None:
                self.chunks, self.scan = wp.zeros(tiles, dtype=wp.int32), wp.zeros(tiles, dtype=wp.int32)

    def launch(self) -> None:
        if self.paper is not None:
            self.paper.launch(self.tiles, self.r, self.of_rays.first, self.of_rays.total)
            return
        wp.launch(chunk_count_kernel, self.tiles, [self.r, self.lists, self.chunks], device=self.device)
        wp.utils.array_scan(self.chunks, self.scan, inclusive=True)
        inputs = [self.r, self.lists, self.chunks, self.scan, self.of_rays]
        wp.launch(chunk_kernel, self.tiles, inputs, device=self.device)
