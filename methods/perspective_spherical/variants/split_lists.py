"""Over-full triangle lists split into chunks that are tested in parallel (the paper's future work, section 6).

A work item is a source (a tile of the image, or a chunk of shadow rays) with one part of its triangle list. Only
lists longer than ``split`` have more than one. Parts are combined without order: the nearest hit by one 64-bit
minimum of (depth key, triangle), a shadow bit is set by any of them.
"""

import warp as wp

from ...common.pairs import need_kernel, zeroed
from ..lists.chunks import RayChunks
from ..lists.sorting import TileLists


@wp.struct
class ListParts:
    """Work items of lists that are split into parts of ``split`` triangles; 0: no list is split.

    items  vec2i [capacity]: (source, part)   scan  int64 [sources]: its last is the number of items
    """

    split: wp.int32
    items: wp.array(dtype=wp.vec2i)
    scan: wp.array(dtype=wp.int64)


@wp.func
def part_of(parts: ListParts, item: wp.int32) -> wp.vec2i:
    """(source, part) of a work item, source -1 beyond the last one. Where no list is split, an item is a source."""
    if parts.split == 0:
        return wp.vec2i(item, 0)
    if wp.int64(item) >= parts.scan[parts.scan.shape[0] - 1]:
        return wp.vec2i(-1, 0)
    return parts.items[item]


@wp.func
def pairs_of_part(lists: TileLists, tile: wp.int32, parts: ListParts, part: wp.int32) -> wp.vec2i:
    """First pair of a part of a tile's list, and the pair behind its last; the whole list where none is split."""
    first = lists.begin[tile] + part * parts.split
    stop = lists.end[tile]
    if parts.split > 0:
        stop = wp.min(stop, first + parts.split)
    return wp.vec2i(first, stop)


@wp.func
def part_count(lists: TileLists, tile: wp.int32, split: wp.int32) -> wp.int32:
    """Parts of a tile's list."""
    return (lists.end[tile] - lists.begin[tile] + split - 1) // split


@wp.kernel(enable_backward=False)
def count_tiles_kernel(split: wp.int32, lists: TileLists, count: wp.array(dtype=wp.int64)):
    """Parts of a tile's list; one where it is empty, so that its pixels are still written."""
    tile = wp.tid()
    count[tile] = wp.int64(wp.max(1, part_count(lists, tile, split)))


@wp.kernel(enable_backward=False)
def count_chunks_kernel(split: wp.int32, chunks: RayChunks, lists: TileLists, count: wp.array(dtype=wp.int64)):
    """Parts of the list that a chunk of shadow rays is tested against."""
    chunk = wp.tid()
    number = wp.int64(0)
    if chunk < chunks.total[0]:
        number = wp.int64(part_count(lists, chunks.tiles[chunks.first[chunk]], split))
    count[chunk] = number


@wp.kernel(enable_backward=False)
def write_kernel(count: wp.array(dtype=wp.int64), scan: wp.array(dtype=wp.int64), items: wp.array(dtype=wp.vec2i)):
    """(source, part) of every item. Beyond the capacity nothing is written; the harness repeats the frame."""
    source = wp.tid()
    place = scan[source] - count[source]
    for part in range(wp.int32(count[source])):
        at = place + wp.int64(part)
        if at < wp.int64(items.shape[0]):
            items[wp.int32(at)] = wp.vec2i(source, part)


class Items:
    """Work items of one grid (:class:`ListParts`). ``split``: triangles of a part, 0 where lists are not split."""

    def __init__(self, sources: int, capacity: int, split: int, device: str):
        self.sources, self.capacity, self.device = max(1, sources), max(1, capacity), device
        with wp.ScopedDevice(device):
            self.count = wp.zeros(self.sources, dtype=wp.int64)
            self.parts = zeroed(ListParts, self.sources, split=split, items=self.capacity)

    def launch(self, kernel: wp.Kernel, inputs: list, needs: wp.array, slot: int) -> None:
        """Count with ``kernel``, scan, write; the number of items goes to ``needs[slot]``."""
        scan = self.parts.scan
        wp.launch(kernel, self.sources, inputs, [self.count], device=self.device)
        wp.utils.array_scan(self.count, scan, inclusive=True)
        wp.launch(need_kernel, 1, [scan], [needs, slot], device=self.device)
        wp.launch(write_kernel, self.sources, [self.count, scan], [self.parts.items], device=self.device)
