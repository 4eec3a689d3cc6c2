"""Rays to blocks: Algorithm 1 on Figure 8's example, and the direct way to the same chunks."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from shadowbench.methods.perspective_spherical.chunks import Chunks
from test_paper_knobs import BALANCING, DEVICES


def test_algorithm_1_on_the_example_of_figure_8():
    """Nine rays in four tiles, r = 2; arrays as the figure draws them, from sorted tiles B to first rays G."""
    tiles = [0, 0, 0, 1, 1, 3, 4, 4, 4]
    keys = wp.array(tiles + [0] * len(tiles), dtype=wp.int32, device="cpu")
    chunks = Chunks(len(tiles), 6, 2, "algorithm-1", "cpu")
    chunks.launch(keys)
    assert chunks.threadArr.numpy().tolist() == [0, 1, 2, 3, 4, 5, 6, 7, 8]
    assert chunks.pseudoArr.numpy().tolist() == [1, 0, 0, 1, 0, 1, 1, 0, 0]
    assert chunks.scratchArr.numpy().tolist() == [1, 2, 3, 1, 2, 1, 1, 2, 3]
    assert chunks.validArr.numpy().tolist() == [1, 0, 1, 1, 0, 1, 1, 0, 1]
    assert chunks.numCBlocks.numpy()[0] == 6
    first = chunks.outArr.numpy()[:7]
    assert first.tolist() == [0, 2, 3, 5, 6, 8, 9]
    assert np.diff(first).tolist() == [2, 1, 2, 1, 2, 1]  # "the difference between the values" of G


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("seed", range(6))
def test_both_balancings_make_the_same_chunks(seed, device):
    random = np.random.default_rng(seed)
    rays, tiles = int(random.integers(1, 700)), int(random.integers(1, 60))
    ids = np.sort(
        random.choice(tiles + 1, rays) if seed else np.full(rays, tiles)
    )  # seed 0: no shadow ray at all
    keys = wp.array(np.concatenate([ids, ids]), dtype=wp.int32, device=device)
    for r in (1, 2, 7, 64, 1000):
        made = []
        for balancing in BALANCING:
            chunks = Chunks(rays, tiles, r, balancing, device)
            chunks.launch(keys)
            total = int(chunks.numCBlocks.numpy()[0])
            made.append(chunks.outArr.numpy()[: total + 1].tolist())
            assert total <= chunks.capacity
        assert made[0] == made[1]
        counts = np.bincount(ids[ids < tiles], minlength=tiles)
        assert len(made[0]) - 1 == int(np.ceil(counts / r).sum())
        assert made[0][-1] == counts.sum()
        assert max(np.diff(made[0]), default=0) <= r
