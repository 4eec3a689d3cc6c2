"""Blocks of pixels (``trace/order.py``): each tile once in an image of any size; many vertices first, then the middle."""

import numpy as np
import pytest
from helpers.devices import DEVICES
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.frame import Frame
from shadowbench.methods.trees.trace import shares as shares_module
from shadowbench.methods.trees.trace.order import Order
from shadowbench.methods.trees.trace.shares import MOST_SQUARES, WARPS, Shares, side_of, squares_of, tiles_of


@pytest.mark.parametrize(
    ("width", "height"), [(8, 4), (33, 21), (1000, 50), (1, 1), (64, 1024), (1920, 1081), (4000, 40)]
)
def test_every_tile_is_in_one_square(width, height):
    squares, side = squares_of(width, height), side_of(width, height)
    columns, rows = -(-width // side) * side // 8, -(-height // side) * side // 4
    tiles = (np.arange(columns) | np.arange(rows)[:, None] << 16).ravel()
    assert len(squares) <= MOST_SQUARES
    np.testing.assert_array_equal(np.sort(tiles_of(squares, side), axis=None), tiles)


def test_the_middle_comes_first_and_corners_last():
    squares = squares_of(1024, 1024)
    places = 32 * np.stack([squares & 0xFFFF, squares >> 16], axis=-1) + 16 - 512
    assert np.abs(places[:4]).max() < 32
    assert np.abs(places[-4:]).min() > 480


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("count", "most"), [(1, 2048), (3, 2048), (2, 16)])
def test_squares_with_many_vertices_come_first(count, most, device, monkeypatch):
    """``most``: as few squares as a larger image has for its size."""
    monkeypatch.setattr(shares_module, "MOST_SQUARES", most)
    width, height = 300, 170
    # Some of its vertices lie behind the eye.
    prepared = make_scene(*soup(1, 40, size=0.05, spread=1.5), [(5.0, 4.0, 3.0)], eye=(0.3, 0.2, 1.0))
    frame, moment = Frame(prepared, width, height, 1, device), prepared.moment(0, width, height)
    shares = Shares(frame, count)
    side = shares.side
    assert side == (32 if most > 60 else 64)
    order = Order(frame, shares)
    for _ in range(2):  # what the frame before has counted is forgotten
        frame.load(moment)
        order.find()
    # The blocks that begin one after the other are dealt to one share after the other.
    dealt = np.stack([of.numpy().reshape(-1, WARPS) for of in shares.tiles], axis=1).reshape(-1, WARPS)
    tiles = dealt[(dealt >= 0).all(axis=1)].reshape(len(shares.squares), -1)

    way = moment.points - moment.eye
    depth = way @ moment.axes[2]
    across, up = way[depth > 0] @ moment.axes[0] / depth[depth > 0], way[depth > 0] @ moment.axes[1] / depth[depth > 0]
    columns, rows = (moment.column + moment.row[0]) @ moment.axes[0], (moment.column[0] + moment.row) @ moment.axes[1]
    shown = (np.abs(across) < moment.tangents[0]) & (np.abs(up) < moment.tangents[1])
    assert 0 < shown.sum() < len(way)
    x = np.abs(columns - across[shown, None]).argmin(axis=1)
    y = np.abs(rows - up[shown, None]).argmin(axis=1)
    seen = (x // side | (y // side) << 16)[:, None] == shares.squares
    digits = [int(number).bit_length() for number in seen.sum(axis=0)]
    assert len(set(digits)) > 2
    expected = shares.squares[np.argsort(-np.array(digits), kind="stable")]
    np.testing.assert_array_equal(tiles, tiles_of(expected, side))
