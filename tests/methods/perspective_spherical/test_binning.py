"""Work of the threads that put triangles into tiles: every tile of every box is somebody's, and nobody else's."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from shadowbench.harness.frame.geometry import filled
from shadowbench.methods.perspective_spherical.lists.binning import (
    ENOUGH,
    INLINE_TILES,
    LANES,
    THREAD_TILES,
    PieceQueue,
    TileBins,
    piece_of,
    queue_large,
)


@wp.kernel(enable_backward=False)
def queue_kernel(
    boxes: wp.array(dtype=wp.vec4i),
    queue: PieceQueue,
):
    i = wp.tid()
    if boxes[i][2] >= boxes[i][0]:
        queue_large(i, boxes[i], queue)


@wp.kernel(enable_backward=False)
def visit_kernel(
    boxes: wp.array(dtype=wp.vec4i),
    queue: PieceQueue,
    visits: wp.array3d(dtype=wp.int32),
    most: wp.array(dtype=wp.int32),
):
    p = piece_of(wp.tid(), boxes, queue)
    if p.item < 0:
        return
    number = wp.int32(0)
    for at in range(p.first, p.stop, p.step):
        wp.atomic_add(visits, p.item, p.y + at // p.w, p.x + at % p.w, 1)
        number += 1
    wp.atomic_max(most, 0, number)


@pytest.mark.parametrize("lanes", [1, LANES])
def test_every_tile_of_every_box_is_one_threads_work(lanes):
    side = 300
    shapes = [
        (1, 1),
        (4, 4),
        (16, 1),
        (17, 1),
        (1, 17),
        (5, 4),
        (33, 7),
        (1, side),
        (128, 128),
        (side, side),
        (0, 0),
    ]
    random = np.random.default_rng(lanes)
    boxes = []
    for w, h in shapes:
        x, y = random.integers(0, side - w + 1), random.integers(0, side - h + 1)
        boxes.append((x, y, x + w - 1, y + h - 1))
    boxes = wp.array(np.array(boxes), dtype=wp.vec4i, device="cpu")
    needs = wp.zeros(1, dtype=wp.int64, device="cpu")
    room = 5000
    pieces = wp.zeros(room, dtype=wp.vec2i, device="cpu")
    queue = filled(PieceQueue, lanes=lanes, slot=0, needs=needs, pieces=pieces)
    wp.launch(queue_kernel, dim=len(shapes), inputs=[boxes, queue], device="cpu")
    queued = int(needs.numpy()[0])
    assert 0 < queued <= room
    visits = wp.zeros((len(shapes), side, side), dtype=wp.int32, device="cpu")
    most = wp.zeros(1, dtype=wp.int32, device="cpu")
    threads = len(shapes) + room * lanes
    wp.launch(visit_kernel, dim=threads, inputs=[boxes, queue, visits, most], device="cpu")
    for seen, (x0, y0, x1, y1) in zip(visits.numpy(), boxes.numpy(), strict=True):
        expected = np.zeros((side, side), dtype=int)
        expected[y0 : y1 + 1, x0 : x1 + 1] = 1
        assert (seen == expected).all()
    assert int(INLINE_TILES) <= most.numpy()[0] <= int(THREAD_TILES)
    if lanes > 1:
        assert queued <= sum(1 + w * h // lanes for w, h in shapes)
        assert queued <= len(shapes) * (int(ENOUGH) // lanes + 1)


@pytest.mark.parametrize("sort", ["counting", "radix"])
def test_pairs_come_out_sorted_and_a_tile_has_its_run(sort):
    random = np.random.default_rng(5)
    tiles, slices, count, capacity = 40, 7, 500, 600
    needs = wp.zeros(2, dtype=wp.int64, device="cpu")
    bins = TileBins(10, tiles, slices, (capacity, 1, 0), needs, 0, sort, "cpu")
    bins.clear_pairs()
    cells = random.integers(0, tiles * slices, count)
    cells[cells // slices == 3] = 0  # an empty tile
    ranks = np.zeros(count, dtype=int)
    for i, cell in enumerate(cells):
        ranks[i] = (cells[:i] == cell).sum()
    keys = bins.pairs.keys.numpy()
    keys[:count] = cells
    bins.pairs.keys.assign(keys)
    values = bins.pairs.values.numpy()
    values[:count] = np.arange(count)
    bins.pairs.values.assign(values)
    needs.assign([count, 0])
    if sort == "counting":
        assert bins.counted
        bins.pairs.ranks.assign(np.pad(ranks, (0, capacity - count)))
        bins.pairs.cell_count.assign(np.bincount(cells, minlength=tiles * slices))
    bins.launch_sort()
    keys, values = bins.lists.keys.numpy()[:count], bins.lists.values.numpy()[:count]
    assert (np.diff(keys) >= 0).all()
    assert (keys == cells[values]).all()
    assert sorted(values) == list(range(count))
    begin, end = bins.lists.begin.numpy(), bins.lists.end.numpy()
    for tile in range(tiles):
        assert (keys[begin[tile] : end[tile]] // slices == tile).all()
    assert (end - begin).tolist() == np.bincount(cells // slices, minlength=tiles).tolist()


@pytest.mark.parametrize("sort", ["counting", "radix"])
def test_pairs_that_do_not_fit_are_no_lists(sort):
    needs = wp.array([101, 0], dtype=wp.int64, device="cpu")
    bins = TileBins(1, 3, 2, (100, 1, 0), needs, 0, sort, "cpu")
    bins.pairs.keys.assign(np.zeros(bins.pairs.keys.shape[0], dtype=np.int32))
    if sort == "counting":
        bins.pairs.ranks.assign(np.arange(100))
        bins.pairs.cell_count.assign([100, 0, 0, 0, 0, 0])
    for needed, length in ((101, 0), (100, 100)):
        needs.assign([needed, 0])
        bins.launch_sort()
        assert (bins.lists.end.numpy() - bins.lists.begin.numpy()).tolist() == [length, 0, 0]
