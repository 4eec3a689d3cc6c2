"""Over-full triangle lists split into chunks that are tested in parallel (the paper's future work, section 6).

A work item is a source (a tile of the image, or a chunk of shadow rays) with one part of its triangle list. Only
lists longer than ``split`` have more than one. Parts are combined without order: the nearest hit by one 64-bit
minimum of (depth key, triangle), a shadow bit by whoever sets it.
"""

from __future__ import annotations

import warp as wp

from ...common.pairs import need_kernel


@wp.kernel(enable_backward=False)
def count_tiles_kernel(
    split: wp.int32,
    begin: wp.array(dtype=wp.int32),
    end: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int64),
):
    """Parts of a tile's list; one where it is empty, so that its pixels are still written."""
    tile = wp.tid()
    count[tile] = wp.int64(wp.max(1, (end[tile] - begin[tile] + split - 1) // split))


@wp.kernel(enable_backward=False)
def count_chunks_kernel(
    split: wp.int32,
    ray_tiles: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.int32),
    total: wp.array(dtype=wp.int32),
    begin: wp.array(dtype=wp.int32),
    end: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int64),
):
    """Parts of the list that a chunk of shadow rays is tested against."""
    chunk = wp.tid()
    number = wp.int64(0)
    if chunk < total[0]:
        tile = ray_tiles[first[chunk]]
        number = wp.int64((end[tile] - begin[tile] + split - 1) // split)
    count[chunk] = number


@wp.kernel(enable_backward=False)
def write_kernel(
    count: wp.array(dtype=wp.int64), scan: wp.array(dtype=wp.int64), items: wp.array(dtype=wp.vec2i)
):
    """(source, part) of every item. Beyond the capacity nothing is written; the harness repeats the frame."""
    source = wp.tid()
    place = scan[source] - count[source]
    for part in range(wp.int32(count[source])):
        at = place + wp.int64(part)
        if at < wp.int64(items.shape[0]):
            items[wp.int32(at)] = wp.vec2i(source, part)


class Items:
    """Work items of one grid. items vec2i [capacity]: (source, part); scan int64 [sources], its last their number."""

    def __init__(self, sources: int, capacity: int, device: str):
        self.sources, self.capacity, self.device = max(1, sources), max(1, capacity), device
        with wp.ScopedDevice(device):
            self.count = wp.zeros(self.sources, dtype=wp.int64)
            self.scan = wp.zeros(self.sources, dtype=wp.int64)
            self.items = wp.zeros(self.capacity, dtype=wp.vec2i)

    def launch(self, kernel: wp.Kernel, inputs: list, needs: wp.array, slot: int) -> None:
        """Count with ``kernel``, scan, write; the number of items goes to ``needs[slot]``."""
        wp.launch(kernel, dim=self.sources, inputs=inputs, outputs=[self.count], device=self.device)
        wp.utils.array_scan(self.count, self.scan, inclusive=True)
        wp.launch(need_kernel, dim=1, inputs=[self.scan], outputs=[needs, slot], device=self.device)
        wp.launch(
            write_kernel,
            dim=self.sources,
            inputs=[self.count, self.scan],
            outputs=[self.items],
            device=self.device,
        )
