"""Shares of the pixels: each pixel once, whatever the size of the image, and on a GPU the middle first."""

import numpy as np
import pytest
from shadowbench.methods.trees.trace.shares import WARPS, blocks_of


@pytest.mark.parametrize("middle_first", [False, True])
@pytest.mark.parametrize(("width", "height"), [(8, 4), (33, 21), (1000, 50), (1, 1), (64, 1024)])
def test_every_tile_is_in_one_block(width, height, middle_first):
    blocks = blocks_of(width, height, middle_first)
    tiles = np.sort(blocks[blocks >= 0])
    columns, rows = -(-width // 8), -(-height // 4)
    assert blocks.shape[1] == WARPS
    np.testing.assert_array_equal(tiles, (np.arange(columns) | np.arange(rows)[:, None] << 16).ravel())


def test_the_middle_comes_first_and_corners_last():
    blocks = blocks_of(1024, 1024, True)
    places = np.stack([8 * (blocks & 0xFFFF), 4 * (blocks >> 16)], axis=-1).mean(axis=1) - 512
    assert np.abs(places[:8]).max() < 32
    assert np.abs(places[-4:]).min() > 470
