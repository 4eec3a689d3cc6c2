"""Pairs sorted by cell, by either sort: every pair once, every tile its run, and no lists where pairs did not fit."""

import numpy as np
import pytest
import warp as wp
from shadowbench.methods.perspective_spherical.lists.sorting import TileSort
from shadowbench.methods.perspective_spherical.parameters import SORTS


@pytest.mark.parametrize("sort", SORTS)
def test_pairs_come_out_sorted_and_a_tile_has_its_run(sort):
    random = np.random.default_rng(5)
    tiles, slices, count, capacity = 40, 7, 500, 600
    needs = wp.zeros(1, dtype=wp.int64, device="cpu")
    bins = TileSort(tiles, slices, capacity, needs, 0, sort, "cpu")
    bins.clear()
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
    needs.assign([count])
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


@pytest.mark.parametrize("sort", SORTS)
def test_pairs_that_do_not_fit_are_no_lists(sort):
    needs = wp.array([101], dtype=wp.int64, device="cpu")
    bins = TileSort(3, 2, 100, needs, 0, sort, "cpu")
    bins.pairs.keys.assign(np.zeros(bins.pairs.keys.shape[0], dtype=np.int32))
    if sort == "counting":
        bins.pairs.ranks.assign(np.arange(100))
        bins.pairs.cell_count.assign([100, 0, 0, 0, 0, 0])
    for needed, length in ((101, 0), (100, 100)):
        needs.assign([needed])
        bins.launch_sort()
        assert bins.lengths().tolist() == [length, 0, 0]
